#include "gateway/surroundings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gateway/gyro_input.h"
#include "model/catalogue.h"

namespace vgyro::gateway {

namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr double kTurn_rad = 2.0 * std::numbers::pi;

fusion::TemperatureFilter filter_of(const GyroPlan& gyro) {
  return fusion::TemperatureFilter(gyro.temperature ? gyro.temperature->step : 0.0);
}

// A stamp that the guard has accepted for one of the streams that do not lead.
bool accept(fusion::StampGuard& guard, std::size_t stream, TimePoint raw, TimePoint& t) {
  return guard.check(stream, raw, t) == fusion::StampGuard::Verdict::kAccepted;
}

}  // namespace

Surroundings::Surroundings(const Plan& plan)
    : plan_(plan),
      temperatures_{filter_of(plan.gyros[0]), filter_of(plan.gyros[1])},
      rate_dps_(plan.calibration.rate_dps) {
  acceleration_g_.fill(model::Surroundings::kUnknown);
  if (plan.accelerometer) accelerometer_check_ = E2eCheck(plan.accelerometer->e2e);
  if (plan.speed) speed_check_ = E2eCheck(plan.speed->e2e);
}

void Surroundings::set_zero(TimePoint t) {
  begun_ = true;
  zero_ = t;
  newest_ = t;
  angle_at_ = t;
}

void Surroundings::reach(TimePoint t) {
  if (!begun_ || t < zero_) {
    // The first frame's stamp was garbage, or it came on the slower of two buses.
    set_zero(t);
    return;
  }
  const Duration step = span(newest_, t);
  if (step <= Duration::zero()) return;
  newest_ = t;
  if (step <= kLeap) return;
  zero_ += step;
  angle_at_ += step;
}

void Surroundings::add_temperature(std::size_t gyro, TimePoint t, double temperature_c) {
  if (!std::isnan(temperature_c)) temperatures_[gyro].add(t, temperature_c);
}

bool Surroundings::receive_acceleration(const can::Frame& frame, TimePoint raw,
                                        fusion::StampGuard& guard) {
  if (accelerometer_check_.judge(frame)) return false;
  std::array<double, 3> acceleration_g{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (decode_quantity(plan_.accelerometer->axes[axis], frame, acceleration_g[axis])) return false;
  }
  TimePoint t;
  if (!accept(guard, kAccelerometerStream, raw, t)) return false;
  acceleration_g_ = acceleration_g;
  vibration_.add(t, std::hypot(acceleration_g[0], acceleration_g[1], acceleration_g[2]));
  return true;
}

bool Surroundings::receive_speed(const can::Frame& frame, TimePoint raw,
                                 fusion::StampGuard& guard) {
  if (speed_check_.judge(frame)) return false;
  double speed_m_s = 0.0;
  const auto reject = decode_quantity(plan_.speed->speed, frame, speed_m_s);
  // The sensor says that it does not know: what it said before is worth no more.
  if (reject == Reject::kOutOfRange || reject == Reject::kNotFinite) speed_at_ = std::nullopt;
  TimePoint t;
  if (reject || !accept(guard, kSpeedStream, raw, t)) return false;
  speed_at_ = t;
  speed_m_s_ = speed_m_s;
  return true;
}

void Surroundings::add_rate(TimePoint t, double rate_dps) {
  if (!std::isfinite(rate_dps) || t <= angle_at_ || t - newest_ > kLeap) return;
  const double turned_deg = 0.5 * (rate_dps_ + rate_dps) * to_seconds(t - angle_at_);
  angle_rad_ = std::remainder(angle_rad_ + turned_deg * kRadPerDeg, kTurn_rad);
  angle_at_ = t;
  rate_dps_ = rate_dps;
}

model::Surroundings Surroundings::at(std::size_t gyro, TimePoint t) const {
  const Duration ahead = std::clamp<Duration>(t - angle_at_, -kAngleAhead, kAngleAhead);
  return {.t_s = to_seconds(t - zero_),
          .temperature_c = temperatures_[gyro].temperature_c(),
          .temperature_slope_c_s = temperatures_[gyro].slope_c_s(),
          .acceleration_g = acceleration_g_,
          .vibration_g2 = vibration_.variance(),
          .angle_rad = angle_rad_ + rate_dps_ * to_seconds(ahead) * kRadPerDeg};
}

fusion::Wheels Surroundings::wheels(TimePoint t) const {
  if (!speed_at_ || t - *speed_at_ > kSpeedStale) return fusion::Wheels::kUnknown;
  return std::abs(speed_m_s_) < kStandingBelow_m_s ? fusion::Wheels::kStanding
                                                   : fusion::Wheels::kRolling;
}

double Surroundings::vibration_g2() const {
  return vibration_.count() > 0 ? vibration_.variance() : model::Surroundings::kUnknown;
}

std::uint8_t Surroundings::missing(std::size_t gyro, std::uint8_t needs) const {
  std::uint8_t heard = 0;
  if (temperatures_[gyro].known()) heard |= model::kNeedsTemperature;
  if (vibration_.count() > 0) heard |= model::kNeedsAcceleration;
  return static_cast<std::uint8_t>(needs & ~heard);
}

}  // namespace vgyro::gateway
