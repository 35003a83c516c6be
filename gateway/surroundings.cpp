#include "gateway/surroundings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/angle.h"

namespace vgyro::gateway {

namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;

fusion::TemperatureFilter filter_of(const GyroPlan& gyro) {
  return fusion::TemperatureFilter(gyro.temperature ? gyro.temperature->step : 0.0);
}

}  // namespace

/// Where one input comes from, and whether a value was ever received.
struct Surroundings::Source {
  model::Need need;
  /// Null if it does not come from the gyro's own frames.
  void (*from_gyro)(Surroundings& to, std::size_t gyro, TimePoint t, const GyroInput& input);
  bool (*heard)(const Surroundings& from, std::size_t gyro);
};
constexpr std::array<Surroundings::Source, model::kNeedCount> Surroundings::kSources{{
    {model::kNeedsTemperature,
     [](Surroundings& to, std::size_t gyro, TimePoint t, const GyroInput& input) {
       to.add_temperature(gyro, t, input.temperature_c());
     },
     [](const Surroundings& from, std::size_t gyro) { return from.temperatures_[gyro].known(); }},
    {model::kNeedsAcceleration, nullptr,
     [](const Surroundings& from, std::size_t) { return from.vibration_.count() > 0; }},
    {model::kNeedsSupply,
     [](Surroundings& to, std::size_t gyro, TimePoint, const GyroInput& input) {
       to.add_supply(gyro, input.supply_v());
     },
     [](const Surroundings& from, std::size_t gyro) { return !std::isnan(from.supply_v_[gyro]); }},
    {model::kNeedsOtherAxes,
     [](Surroundings& to, std::size_t gyro, TimePoint, const GyroInput& input) {
       to.set_other_rates(gyro, input.other_rate_dps());
     },
     [](const Surroundings& from, std::size_t gyro) {
       const auto& rates = from.other_rate_dps_[gyro];
       return std::any_of(rates.begin(), rates.end(), [](double r) { return !std::isnan(r); });
     }},
}};

Surroundings::Surroundings(const Plan& plan)
    : temperatures_{filter_of(plan.gyros[0]), filter_of(plan.gyros[1])},
      rate_dps_(plan.calibration.rate_dps) {
  static_assert(model::answers_each_need(kSources));
  supply_v_.fill(model::Surroundings::kUnknown);
  for (std::array<double, 3>& rates : other_rate_dps_)
    rates.fill(model::Surroundings::kUnknown);
  acceleration_g_.fill(model::Surroundings::kUnknown);
  if (plan.accelerometer) accelerometer_.emplace(accelerometer_intake(*plan.accelerometer));
  if (plan.speed) speed_.emplace(speed_intake(*plan.speed));
}

void Surroundings::set_zero(TimePoint t) {
  begun_ = true;
  zero_ = t;
  newest_ = t;
  angle_at_ = t;
}

// Handles a time that does not simply follow the newest one.
void Surroundings::leap(TimePoint t) {
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

// Runs for every sample; the compiler sees each source as a constant and calls it directly.
template <std::size_t... places>
void Surroundings::hear_from(std::index_sequence<places...> /*all*/, std::size_t gyro, TimePoint t,
                             const GyroInput& input, std::uint8_t needs) {
  const auto hear = [&]<std::size_t place>() {
    constexpr Source kSource = kSources[place];
    if constexpr (kSource.from_gyro != nullptr) {
      if ((needs & kSource.need) != 0) kSource.from_gyro(*this, gyro, t, input);
    }
  };
  (hear.template operator()<places>(), ...);
}

void Surroundings::hear_gyro(std::size_t gyro, TimePoint t, const GyroInput& input,
                             std::uint8_t needs) {
  if (needs == 0) return;
  hear_from(std::make_index_sequence<model::kNeedCount>(), gyro, t, input, needs);
}

void Surroundings::add_supply(std::size_t gyro, double supply_v) {
  if (!std::isnan(supply_v)) supply_v_[gyro] = supply_v;
}

void Surroundings::add_temperature(std::size_t gyro, TimePoint t, double temperature_c) {
  if (std::isnan(temperature_c)) return;
  temperatures_[gyro].add(t, temperature_c);
  temperature_pasts_[gyro].add(temperatures_[gyro].temperature_c());
}

bool Surroundings::receive_acceleration(const can::Frame& frame, TimePoint raw,
                                        fusion::StampGuard& guard) {
  const AxesIntake::Result taken = accelerometer_->take(frame, raw, guard);
  if (taken.reject) return false;
  acceleration_g_ = taken.value;
  vibration_.add(taken.stamp.t, std::hypot(taken.value[0], taken.value[1], taken.value[2]));
  return true;
}

bool Surroundings::receive_speed(const can::Frame& frame, TimePoint raw,
                                 fusion::StampGuard& guard) {
  const ScalarIntake::Result taken = speed_->take(frame, raw, guard);
  // The sensor reports that its speed is unknown, so the last value is no longer usable either.
  const bool unknown = taken.reject == Reject::kOutOfRange || taken.reject == Reject::kNotFinite ||
                       taken.reject == Reject::kNoMeasurement;
  if (unknown) speed_at_ = std::nullopt;
  if (taken.reject) return false;
  speed_at_ = taken.stamp.t;
  speed_m_s_ = taken.value[0];
  return true;
}

void Surroundings::add_rate(TimePoint t, double rate_dps) {
  if (!std::isfinite(rate_dps) || t <= angle_at_ || t - newest_ > kLeap) return;
  const double turned_deg = 0.5 * (rate_dps_ + rate_dps) * to_seconds(t - angle_at_);
  angle_rad_ += turned_deg * kRadPerDeg;
  // remainder() changes nothing within half a turn; skip it.
  if (!(std::abs(angle_rad_) < std::numbers::pi))
    angle_rad_ = std::remainder(angle_rad_, kTurn_rad);
  angle_at_ = t;
  rate_dps_ = rate_dps;
}

model::Surroundings Surroundings::at(std::size_t gyro, TimePoint t) const {
  const Duration ahead = std::clamp<Duration>(t - angle_at_, -kAngleAhead, kAngleAhead);
  return {
      .t_s = to_seconds(t - zero_),
      .temperature_c = temperatures_[gyro].temperature_c(),
      .temperature_slope_c_s = temperatures_[gyro].slope_c_s(),
      .temperature_past = temperature_pasts_[gyro].empty() ? nullptr : &temperature_pasts_[gyro],
      .acceleration_g = acceleration_g_,
      .vibration_g2 = vibration_.variance(),
      .supply_v = supply_v_[gyro],
      .other_rate_dps = other_rate_dps_[gyro],
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
  for (const Source& source : kSources) {
    if (source.heard(*this, gyro)) heard |= source.need;
  }
  return static_cast<std::uint8_t>(needs & ~heard);
}

}  // namespace vgyro::gateway
