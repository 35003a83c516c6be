#include "cli/recording.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "cli/role_frames.h"
#include "fusion/stamp_guard.h"
#include "gateway/intake.h"
#include "gateway/surroundings.h"

namespace vgyro::cli {

namespace {

// A larger limit is not that of a gyro: the range of a floating-point number ends only where values
// are no longer plausible.
constexpr double kLimitMost_dps = 5e4;

double limit_of(const gateway::Quantity& rate) {
  const auto magnitude = [&](double raw) { return std::abs(raw * rate.scale + rate.shift); };
  const double low = magnitude(rate.lowest());
  const double high = magnitude(rate.highest());
  const double limit_dps = std::max(low, high);
  return limit_dps < kLimitMost_dps ? limit_dps : 0.0;
}

// A counter over all pages does not show which frames of the gyro's own page are missing.
bool counts_samples(const gateway::GyroPlan& gyro) {
  const auto& counter = gyro.e2e.counter;
  return counter && (gyro.rate.presence.always() || !counter->presence.always());
}

class Recorder {
 public:
  explicit Recorder(const gateway::Plan& plan)
      : plan_(plan),
        inputs_{gateway::GyroIntake(0, gateway::GyroInput(plan.gyros[0])),
                gateway::GyroIntake(1, gateway::GyroInput(plan.gyros[1]))} {
    for (std::size_t i = 0; i < 2; ++i) {
      const gateway::GyroPlan& gyro = plan.gyros[i];
      gap::GyroSeries& series = recording_.gyros[i];
      series.name = gyro.name;
      series.counter_modulus = counts_samples(gyro) ? gyro.e2e.counter->modulus : 0;
      series.step_dps = gyro.rate.step;
      series.limit_dps = limit_of(gyro.rate);
    }
    if (plan.reference) reference_.emplace(gateway::reference_intake(*plan.reference));
    if (plan.accelerometer)
      accelerometer_.emplace(gateway::accelerometer_intake(*plan.accelerometer));
    recording_.has_reference = plan.reference.has_value();
    recording_.has_acceleration = plan.accelerometer.has_value();
    if (!plan.calibration.from_reference) recording_.rest_s = plan.calibration.rest_s;
    recording_.rest_rate_dps = plan.calibration.rate_dps;
  }

  void take(std::uint8_t roles, const canlog::LogRecord& record) {
    if ((roles & gateway::kGyro1) != 0) take_gyro(0, record);
    if ((roles & gateway::kGyro2) != 0) take_gyro(1, record);
    if ((roles & gateway::kReference) != 0) take_reference(record);
    if ((roles & gateway::kAccelerometer) != 0) take_acceleration(record);
    if ((roles & gateway::kSpeed) != 0) take_speed(record);
  }

  [[nodiscard]] std::array<std::uint64_t, 2> used() const {
    return {recording_.gyros[0].t_s.size(), recording_.gyros[1].t_s.size()};
  }

  gap::Recording finish() {
    for (gap::GyroSeries& gyro : recording_.gyros) {
      shift(gyro.t_s);
      fill_beginning(gyro.temperature_c);
      fill_beginning(gyro.supply_v);
      for (std::vector<double>& axis : gyro.other_rate_dps) {
        fill_beginning(axis);
        if (!plan_.output.axes.empty()) take_off_level(gyro.t_s, axis);
      }
    }
    shift(recording_.reference_dps.t_s);
    shift(recording_.acceleration.t_s);
    recording_.seconds = newest_s_ - earliest_s_;
    recording_.began_s = to_seconds(zero_.time_since_epoch()) + earliest_s_;
    return std::move(recording_);
  }

 private:
  // Seconds since the first frame.
  double reach(TimePoint t) {
    if (!begun_) zero_ = newest_ = t;
    begun_ = true;
    // The clock was set ahead by more than a day: the recording continues from where it was.
    if (t - newest_ > gateway::Surroundings::kLeap) zero_ += t - newest_;
    newest_ = std::max(newest_, t);
    const double t_s = to_seconds(t - zero_);
    earliest_s_ = std::min(earliest_s_, t_s);
    newest_s_ = std::max(newest_s_, t_s);
    return t_s;
  }

  void take_gyro(std::size_t i, const canlog::LogRecord& record) {
    const gateway::GyroIntake::Result taken = inputs_[i].take(record.frame, record.stamp, guard_);
    // A frame with a counter is a sample of its own even if its stamp repeats.
    const bool counted = counts_samples(plan_.gyros[i]);
    const bool new_at_old_stamp = counted && taken.reject == gateway::Reject::kStampRepeated;
    if (taken.reject && !new_at_old_stamp) return;
    const double t_s = reach(taken.stamp.t);
    gap::GyroSeries& series = recording_.gyros[i];
    series.t_s.push_back(series.t_s.empty() ? t_s : std::max(series.t_s.back(), t_s));
    series.rate_dps.push_back(taken.rate_dps);
    if (counted) series.counter.push_back(inputs_[i].input().counter());
    if (plan_.gyros[i].temperature)
      series.temperature_c.push_back(inputs_[i].input().temperature_c());
    if (plan_.gyros[i].supply_voltage) series.supply_v.push_back(inputs_[i].input().supply_v());
    take_other_axes(i);
  }

  void take_other_axes(std::size_t i) {
    const std::array<double, 3> rate_dps = inputs_[i].input().other_rate_dps();
    for (std::size_t axis = 0; axis < rate_dps.size(); ++axis) {
      if (plan_.gyros[i].*gateway::kOtherAxes[axis])
        recording_.gyros[i].other_rate_dps[axis].push_back(rate_dps[axis]);
    }
  }

  void take_reference(const canlog::LogRecord& record) {
    const auto taken = reference_->take(record.frame, record.stamp, guard_);
    if (taken.reject) return;
    recording_.reference_dps.t_s.push_back(reach(taken.stamp.t));
    recording_.reference_dps.value.push_back(taken.value[0]);
  }

  void take_acceleration(const canlog::LogRecord& record) {
    const auto taken = accelerometer_->take(record.frame, record.stamp, guard_);
    if (taken.reject) return;
    recording_.acceleration.t_s.push_back(reach(taken.stamp.t));
    for (std::size_t axis = 0; axis < 3; ++axis)
      recording_.acceleration.g[axis].push_back(taken.value[axis]);
  }

  // The speed is not used; its frames only extend the recording.
  void take_speed(const canlog::LogRecord& record) {
    gateway::StampResult stamp;
    gateway::judge_stamp(gateway::kSpeedStream, record.stamp, guard_, stamp);
    if (stamp.believed()) reach(stamp.t);
  }

  // Time 0 is that of the earliest frame, which need not be the first: on the slower of two buses
  // it may come second.
  void shift(std::vector<double>& t_s) const {
    double last_s = 0.0;
    for (double& t : t_s) {
      last_s = std::max(last_s, t - earliest_s_);
      t = last_s;
    }
  }

  // The reading of a unit's other axis at rest is its bias, which no other axis feels. Beside a
  // single gyro it is not known whether the bias belongs to that frame.
  void take_off_level(const std::vector<double>& t_s, std::vector<double>& rate_dps) const {
    const auto resting = std::lower_bound(t_s.begin(), t_s.end(), recording_.rest_s) - t_s.begin();
    if (resting == 0 || rate_dps.empty()) return;
    std::vector<double> rest(rate_dps.begin(), rate_dps.begin() + resting);
    const auto middle = rest.begin() + resting / 2;
    std::nth_element(rest.begin(), middle, rest.end());
    const double level_dps = *middle;
    for (double& rate : rate_dps)
      rate -= level_dps;
  }

  // The first value may be on a later page; a quantity that never came is removed.
  static void fill_beginning(std::vector<double>& beside) {
    const auto known = std::find_if_not(beside.begin(), beside.end(),
                                        [](double value) { return std::isnan(value); });
    if (known == beside.end()) {
      beside.clear();
      return;
    }
    std::fill(beside.begin(), known, *known);
  }

  const gateway::Plan& plan_;
  std::array<gateway::GyroIntake, 2> inputs_;
  std::optional<gateway::ScalarIntake> reference_;
  std::optional<gateway::AxesIntake> accelerometer_;
  fusion::StampGuard guard_;
  gap::Recording recording_;
  bool begun_ = false;
  TimePoint zero_;
  TimePoint newest_;
  double earliest_s_ = 0.0;
  double newest_s_ = 0.0;
};

}  // namespace

Expected<std::vector<gap::Recording>> read_recordings(const std::string& log,
                                                      std::span<const gateway::Plan> plans,
                                                      const std::string& doing) {
  RoleFrames frames(plans);
  std::vector<Recorder> recorders;
  recorders.reserve(plans.size());
  for (const gateway::Plan& plan : plans)
    recorders.emplace_back(plan);
  const auto done = frames.read(
      {log}, doing, [&](std::size_t pair, std::uint8_t roles, const canlog::LogRecord& record) {
        recorders[pair].take(roles, record);
      });
  if (!done) return tl::unexpected(done.error());
  std::vector<gap::Recording> recordings;
  recordings.reserve(plans.size());
  for (std::size_t pair = 0; pair < plans.size(); ++pair) {
    if (const auto missing = frames.missing_gyro(log, pair, recorders[pair].used())) {
      return tl::unexpected(*missing);
    }
    recordings.push_back(recorders[pair].finish());
  }
  return recordings;
}

}  // namespace vgyro::cli
