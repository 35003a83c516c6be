#pragma once

// Decides whether a gyro may be used. Gathers evidence from its frames and values, sets it aside at
// once at a fault, and uses it again when it has been good for a while: longer each time that the
// fault returns. Counts faults. Attendance decides whether the gyro is silent.

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

  /// Judges a decoded rate. Returns nothing when it may be used, otherwise the cause of refusal.
  /// `other` is the other gyro if that is in use, else null. `can_spare`: the other gyro continues
  /// without this one, so that a zero of the dead band need not be used.
  std::optional<Reject> judge(TimePoint t, double rate_dps, const GyroHealth* other,
                              bool can_spare);
  /// A frame that holds no usable rate, for this cause, and whose stamp was accepted.
  void refuse(TimePoint t, Reject cause);
  /// The gyro timed out.
  void fall_silent(TimePoint t);
  /// The corrector's findings: far noisier than before, or blind to rotation. Such a gyro stays in
  /// use, with a smaller weight.
  void set_opinion(TimePoint t, bool noisy, bool blind);

  /// Is the cause evidence about the sensor, rather than about a foreign frame?
  static bool tells_of_sensor(Reject cause);

  [[nodiscard]] bool set_aside() const { return fault_.has_value(); }
  /// The bit of VB_Health. Zeros of a dead band are no defect.
  [[nodiscard]] bool suspect() const {
    return noisy_ || blind_ || (fault_ && *fault_ != Fault::kDeadBand);
  }
  /// The present fault; one that sets the gyro aside takes precedence.
  [[nodiscard]] std::optional<Fault> fault() const;
  /// The smallest recent distance between two different values; before any two differed, 0.5 deg/s,
  /// or the frame's own step if that is larger. Anything within one step is unknown.
  [[nodiscard]] double step_dps() const { return watch_.step_dps(); }
  /// Has it ever sent two different values? If not, it may be dead.
  [[nodiscard]] bool ever_changed() const { return watch_.ever_changed(); }
  [[nodiscard]] const std::array<FaultRecord, kFaultCount>& records() const { return records_; }

 private:
  /// Handles a finding other than kSound, or one that may end a fault.
  [[gnu::cold, gnu::noinline]] std::optional<Reject> judge_finding(
      TimePoint t, fusion::SensorWatch::Finding finding, bool can_spare);
  [[nodiscard]] std::optional<Fault> fault_in(fusion::SensorWatch::Finding finding,
                                              bool can_spare) const;
  [[gnu::cold, gnu::noinline]] void bad(TimePoint t, Fault fault);
  void note(TimePoint t, Fault fault, bool begins);
  [[nodiscard]] bool recovered(TimePoint t) const;

  fusion::SensorWatch watch_;
  std::array<FaultRecord, kFaultCount> records_{};
  std::optional<Fault> fault_;  ///< the fault for which the gyro is set aside
  bool hasty_ = false;          ///< set aside after a few samples, and nothing worse was found
                                ///< since
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
