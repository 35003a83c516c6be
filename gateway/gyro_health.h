#pragma once

// May this gyro be used? Gathers the evidence of its frames and values, sets it aside at
// once at a fault, and uses it again when it has been good for a while: longer each time that
// the fault returns. Counts faults. Attendance decides whether the gyro is silent.

#include <array>
#include <cstdint>
#include <optional>

#include "base/time.h"
#include "fusion/sensor_watch.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class GyroHealth {
 public:
  explicit GyroHealth(const GyroPlan& plan);

  /// A rate that the frame says is one. Nothing when it may be used, else the cause why not.
  /// `other` is the other gyro when that is in use, else null. `can_spare`: without this one the
  /// other carries on, so that a zero of the dead band need not be used.
  std::optional<Reject> judge(TimePoint t, double rate_dps, const GyroHealth* other,
                              bool can_spare);
  /// A frame without a rate, for this cause, with an accepted stamp.
  void refuse(TimePoint t, Reject cause);
  /// It timed out: it is silent.
  void fall_silent(TimePoint t);
  /// The corrector's result: far noisier than before, or blind to rotation. Such a gyro
  /// stays in use, with a smaller weight.
  void set_opinion(TimePoint t, bool noisy, bool blind);

  /// Is the cause evidence about the sensor, not about a foreign frame?
  static bool tells_of_sensor(Reject cause);

  [[nodiscard]] bool set_aside() const { return fault_.has_value(); }
  /// For VB_Health. Zeros of a dead band are no defect.
  [[nodiscard]] bool suspect() const {
    return noisy_ || blind_ || (fault_ && *fault_ != Fault::kDeadBand);
  }
  /// What is wrong at present; what sets it aside comes first.
  [[nodiscard]] std::optional<Fault> fault() const;
  /// How close two different values of late have been; 0.5 deg/s, or the frame's own step if that
  /// is larger, until any two differed. What lies within one step is not known.
  [[nodiscard]] double step_dps() const { return watch_.step_dps(); }
  /// Has it ever sent two different values? One that has not may be dead.
  [[nodiscard]] bool ever_changed() const { return watch_.ever_changed(); }
  [[nodiscard]] const std::array<FaultRecord, kFaultCount>& records() const { return records_; }

 private:
  /// Of a finding that is not kSound, or of one that may end a fault.
  [[gnu::cold, gnu::noinline]] std::optional<Reject> judge_finding(
      TimePoint t, fusion::SensorWatch::Finding finding, bool can_spare);
  [[nodiscard]] std::optional<Fault> fault_in(fusion::SensorWatch::Finding finding,
                                              bool can_spare) const;
  [[gnu::cold, gnu::noinline]] void bad(TimePoint t, Fault fault);
  void note(TimePoint t, Fault fault, bool begins);
  [[nodiscard]] bool recovered(TimePoint t) const;

  fusion::SensorWatch watch_;
  std::array<FaultRecord, kFaultCount> records_{};
  std::optional<Fault> fault_;  ///< for which it is set aside
  bool hasty_ = false;          ///< on a few samples, of which nothing worse was found since
  bool noisy_ = false;
  bool blind_ = false;
  std::uint32_t unusable_in_row_ = 0;
  TimePoint last_bad_;
  TimePoint last_episode_end_;
  bool any_episode_ = false;
  std::uint32_t good_in_row_ = 0;
  std::uint32_t relapses_ = 0;
};

}  // namespace vgyro::gateway
