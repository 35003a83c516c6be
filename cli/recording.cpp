#include "cli/recording.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "cli/role_frames.h"
#include "fusion/stamp_guard.h"
#include "gateway/e2e_check.h"
#include "gateway/gyro_input.h"
#include "gateway/surroundings.h"

namespace vgyro::cli {

namespace {

constexpr std::size_t kReferenceStream = 2;

// A limit beyond this is none of a gyro: a floating-point number has no other than what is
// plausible.
constexpr double kLimitMost_dps = 5e4;

double limit_of(const gateway::Quantity& rate) {
  const auto magnitude = [&](double raw) { return std::abs(raw * rate.scale + rate.shift); };
  const double low = magnitude(std::max(rate.minimum, rate.codec.representable_min()));
  const double high = magnitude(std::min(rate.maximum, rate.codec.representable_max()));
  const double limit_dps = std::max(low, high);
  return limit_dps < kLimitMost_dps ? limit_dps : 0.0;
}

class Recorder {
 public:
  explicit Recorder(const gateway::Plan& plan)
      : plan_(plan), inputs_{gateway::GyroInput(plan.gyros[0]), gateway::GyroInput(plan.gyros[1])} {
    for (std::size_t i = 0; i < 2; ++i) {
      const gateway::GyroPlan& gyro = plan.gyros[i];
      gap::GyroSeries& series = recording_.gyros[i];
      series.name = gyro.name;
      series.counter_modulus = gyro.e2e.counter ? gyro.e2e.counter->modulus : 0;
      series.step_dps = gyro.rate.step;
      series.limit_dps = limit_of(gyro.rate);
    }
    if (plan.reference) reference_check_ = gateway::E2eCheck(plan.reference->e2e);
    if (plan.accelerometer) accelerometer_check_ = gateway::E2eCheck(plan.accelerometer->e2e);
    recording_.has_reference = plan.reference.has_value();
    recording_.has_acceleration = plan.accelerometer.has_value();
    if (!plan.calibration.from_reference) recording_.rest_s = plan.calibration.rest_s;
    recording_.rest_rate_dps = plan.calibration.rate_dps;
  }

  void take(std::uint8_t roles, const can::LogRecord& record) {
    if ((roles & gateway::kGyro1) != 0) take_gyro(0, record);
    if ((roles & gateway::kGyro2) != 0) take_gyro(1, record);
    if ((roles & gateway::kReference) != 0) take_reference(record);
    if ((roles & gateway::kAccelerometer) != 0) take_acceleration(record);
    if ((roles & gateway::kSpeed) != 0) {
      accepted(gateway::Surroundings::kSpeedStream, record.stamp);
    }
  }

  [[nodiscard]] std::array<std::uint64_t, 2> used() const {
    return {recording_.gyros[0].t_s.size(), recording_.gyros[1].t_s.size()};
  }

  gap::Recording finish() {
    for (gap::GyroSeries& gyro : recording_.gyros) {
      shift(gyro.t_s);
      fill_beginning(gyro.temperature_c);
    }
    shift(recording_.reference_dps.t_s);
    shift(recording_.acceleration.t_s);
    recording_.seconds = newest_s_ - earliest_s_;
    return std::move(recording_);
  }

 private:
  // Seconds since the first frame; nothing for a stamp that is refused.
  std::optional<double> accepted(std::size_t stream, TimePoint stamp, bool repeats = false) {
    using Verdict = fusion::StampGuard::Verdict;
    TimePoint t;
    const Verdict verdict = guard_.check(stream, stamp, t);
    if (verdict == Verdict::kUnconfirmed) return std::nullopt;
    if (verdict == Verdict::kRepeated && !repeats) return std::nullopt;
    if (!begun_) zero_ = newest_ = t;
    begun_ = true;
    // A clock that was set by more than a day: the recording goes on where it was.
    if (t - newest_ > gateway::Surroundings::kLeap) zero_ += t - newest_;
    newest_ = std::max(newest_, t);
    const double t_s = to_seconds(t - zero_);
    earliest_s_ = std::min(earliest_s_, t_s);
    newest_s_ = std::max(newest_s_, t_s);
    return t_s;
  }

  void take_gyro(std::size_t i, const can::LogRecord& record) {
    const gateway::GyroInput::Result input = inputs_[i].decode(record.frame);
    if (input.reject) return;
    // A frame whose counter moved is a new one, whatever its stamp.
    const auto& counter = plan_.gyros[i].e2e.counter;
    const auto t_s = accepted(i, record.stamp, counter.has_value());
    if (!t_s) return;
    gap::GyroSeries& series = recording_.gyros[i];
    series.t_s.push_back(series.t_s.empty() ? *t_s : std::max(series.t_s.back(), *t_s));
    series.rate_dps.push_back(input.rate_dps);
    if (counter) series.counter.push_back(inputs_[i].counter());
    if (plan_.gyros[i].temperature) series.temperature_c.push_back(inputs_[i].temperature_c());
  }

  void take_reference(const can::LogRecord& record) {
    double rate_dps = 0.0;
    if (reference_check_.judge(record.frame)) return;
    if (gateway::decode_quantity(plan_.reference->rate, record.frame, rate_dps)) return;
    if (const auto t_s = accepted(kReferenceStream, record.stamp)) {
      recording_.reference_dps.t_s.push_back(*t_s);
      recording_.reference_dps.value.push_back(rate_dps);
    }
  }

  void take_acceleration(const can::LogRecord& record) {
    if (accelerometer_check_.judge(record.frame)) return;
    std::array<double, 3> axes_g{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (gateway::decode_quantity(plan_.accelerometer->axes[axis], record.frame, axes_g[axis])) {
        return;
      }
    }
    const auto t_s = accepted(gateway::Surroundings::kAccelerometerStream, record.stamp);
    if (!t_s) return;
    recording_.acceleration.t_s.push_back(*t_s);
    for (std::size_t axis = 0; axis < 3; ++axis)
      recording_.acceleration.g[axis].push_back(axes_g[axis]);
  }

  // Zero is the earliest frame: on the slower of two buses it may come second.
  void shift(std::vector<double>& t_s) const {
    double last_s = 0.0;
    for (double& t : t_s) {
      last_s = std::max(last_s, t - earliest_s_);
      t = last_s;
    }
  }

  // The temperature may stand on a page that comes later; one that never came is not known.
  static void fill_beginning(std::vector<double>& temperature_c) {
    const auto known = std::find_if_not(temperature_c.begin(), temperature_c.end(),
                                        [](double value) { return std::isnan(value); });
    if (known == temperature_c.end()) {
      temperature_c.clear();
      return;
    }
    std::fill(temperature_c.begin(), known, *known);
  }

  const gateway::Plan& plan_;
  std::array<gateway::GyroInput, 2> inputs_;
  gateway::E2eCheck reference_check_;
  gateway::E2eCheck accelerometer_check_;
  fusion::StampGuard guard_;
  gap::Recording recording_;
  bool begun_ = false;
  TimePoint zero_;
  TimePoint newest_;
  double earliest_s_ = 0.0;
  double newest_s_ = 0.0;
};

}  // namespace

Expected<gap::Recording> read_recording(const std::string& log, const gateway::Plan& plan,
                                        const std::string& doing) {
  RoleFrames frames(plan);
  Recorder recorder(plan);
  const auto done = frames.read(log, doing, [&](std::uint8_t roles, const can::LogRecord& record) {
    recorder.take(roles, record);
  });
  if (!done) return tl::unexpected(done.error());
  if (const auto missing = frames.missing_gyro(log, recorder.used())) {
    return tl::unexpected(*missing);
  }
  return recorder.finish();
}

}  // namespace vgyro::cli
