#include "gateway/gyro_health.h"

#include <algorithm>

namespace vgyro::gateway {

namespace {

// Up to this many unusable frames in a row count as lost; more are a fault of the sensor.
constexpr std::uint32_t kUnusableMost = 2;

// A gyro recovers after so much time and so many samples, both doubled with each relapse within a
// minute. The samples outnumber the alignment's gap, so that no line is drawn across the fault.
struct Probation {
  Duration time;
  std::uint32_t samples;
};
constexpr Probation kShort{std::chrono::milliseconds(50), 5};
constexpr Probation kLong{std::chrono::milliseconds(500), 20};
constexpr std::uint32_t kRelapsesMost = 4;
constexpr Duration kRelapseWithin = std::chrono::minutes(1);

Probation probation_of(Fault fault) {
  return fault == Fault::kStuck || fault == Fault::kCounterStuck ? kLong : kShort;
}

// A healthy sensor, too, reaches its clip or its dead band now and then.
bool is_defect(Fault fault) {
  return fault != Fault::kSaturated && fault != Fault::kDeadBand;
}

Reject reject_of(Fault fault) {
  if (fault == Fault::kSaturated) return Reject::kSaturated;
  return fault == Fault::kStuck ? Reject::kStuck : Reject::kDeadBand;
}

fusion::SensorLimits limits_of(const GyroPlan& plan) {
  const Quantity& rate = plan.rate;
  const auto value = [&](double raw) { return raw * rate.scale + rate.shift; };
  const double low = value(rate.lowest());
  const double high = value(rate.highest());
  fusion::SensorLimits limits{.lowest_dps = std::min(low, high),
                              .highest_dps = std::max(low, high),
                              .dead_band_dps = plan.dead_band_dps,
                              .lattice_dps = rate.step};
  if (plan.sign) limits.lowest_dps = std::min(limits.lowest_dps, -limits.highest_dps);
  if (plan.sign) limits.highest_dps = -limits.lowest_dps;
  if (plan.saturation_dps) {
    limits.lowest_dps = std::max(limits.lowest_dps, -*plan.saturation_dps);
    limits.highest_dps = std::min(limits.highest_dps, *plan.saturation_dps);
  }
  return limits;
}

}  // namespace

GyroHealth::GyroHealth(const GyroPlan& plan) : watch_(limits_of(plan)) {}

bool GyroHealth::tells_of_sensor(Reject cause) {
  return cause == Reject::kFlaggedInvalid || cause == Reject::kNotFinite ||
         cause == Reject::kOutOfRange || cause == Reject::kNoMeasurement ||
         cause == Reject::kCounterRepeated;
}

std::optional<Fault> GyroHealth::fault_in(fusion::SensorWatch::Finding finding,
                                          bool can_spare) const {
  using Finding = fusion::SensorWatch::Finding;
  if (finding == Finding::kSaturated) return Fault::kSaturated;
  if (finding == Finding::kStuck || finding == Finding::kStanding) return Fault::kStuck;
  const bool defect = fault_ && is_defect(*fault_);
  if (finding == Finding::kBlind && can_spare && !defect) return Fault::kDeadBand;
  return std::nullopt;
}

std::optional<Reject> GyroHealth::judge(TimePoint t, double rate_dps, const GyroHealth* other,
                                        bool can_spare) {
  unusable_in_row_ = 0;
  const auto finding = watch_.judge(t, rate_dps, other != nullptr ? &other->watch_ : nullptr);
  const bool well = finding == fusion::SensorWatch::Finding::kSound && !fault_;
  return well ? std::nullopt : judge_finding(t, finding, can_spare);
}

std::optional<Reject> GyroHealth::judge_finding(TimePoint t, fusion::SensorWatch::Finding finding,
                                                bool can_spare) {
  if (const auto found = fault_in(finding, can_spare)) {
    hasty_ = finding == fusion::SensorWatch::Finding::kStanding && (hasty_ || !fault_);
    bad(t, *found);
    return reject_of(*found);
  }
  if (!fault_) return std::nullopt;
  ++good_in_row_;
  if (!recovered(t)) return Reject::kRecovering;
  if (is_defect(*fault_)) {
    last_episode_end_ = t;
    any_episode_ = true;
  }
  fault_.reset();
  return std::nullopt;
}

void GyroHealth::refuse(TimePoint t, Reject cause) {
  if (cause == Reject::kFlaggedInvalid) {
    unusable_in_row_ = 0;
    bad(t, Fault::kFlaggedInvalid);
  } else if (++unusable_in_row_ > kUnusableMost) {
    bad(t, cause == Reject::kCounterRepeated ? Fault::kCounterStuck : Fault::kUnreadable);
  }
}

void GyroHealth::bad(TimePoint t, Fault fault) {
  hasty_ = hasty_ && fault == Fault::kStuck;
  if (!fault_ && is_defect(fault)) {
    const bool relapse = any_episode_ && t - last_episode_end_ < kRelapseWithin;
    relapses_ = relapse ? std::min(relapses_ + 1, kRelapsesMost) : 0;
  }
  note(t, fault, fault_ != fault);
  fault_ = fault;
  last_bad_ = t;
  good_in_row_ = 0;
}

void GyroHealth::note(TimePoint t, Fault fault, bool begins) {
  FaultRecord& record = records_[static_cast<std::size_t>(fault)];
  if (begins) ++record.times;
  record.last = t;
}

bool GyroHealth::recovered(TimePoint t) const {
  const Probation probation = hasty_ ? kShort : probation_of(*fault_);
  const Duration time = is_defect(*fault_) ? probation.time * (1U << relapses_) : probation.time;
  return good_in_row_ > probation.samples && t - last_bad_ >= time;
}

void GyroHealth::fall_silent(TimePoint t) {
  fault_.reset();
  unusable_in_row_ = 0;
  note(t, Fault::kSilent, true);
}

void GyroHealth::set_opinion(TimePoint t, bool noisy, bool blind) {
  if (noisy) note(t, Fault::kNoisy, !noisy_);
  if (blind) note(t, Fault::kBlind, !blind_);
  noisy_ = noisy;
  blind_ = blind;
}

std::optional<Fault> GyroHealth::fault() const {
  if (fault_) return fault_;
  if (blind_) return Fault::kBlind;
  return noisy_ ? std::optional(Fault::kNoisy) : std::nullopt;
}

}  // namespace vgyro::gateway
