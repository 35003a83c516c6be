#pragma once

// Which gyros are in use: those with a frame within their time-out that are not set aside; and
// whether they form pairs or one is used alone. Owns their health, which sets gyros aside.
// Sends nothing and estimates nothing. Times are on the axis of fusion::StampGuard.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.h"
#include "fusion/alignment.h"
#include "fusion/corrector.h"
#include "fusion/stamp_guard.h"
#include "gateway/gyro_health.h"
#include "gateway/output_frames.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

class Attendance {
 public:
  /// A gyro that is silent for this many of its usual intervals is missing, within these limits.
  static constexpr int kTimeOutIntervals = 10;
  static constexpr Duration kTimeOutMin = std::chrono::milliseconds(100);
  static constexpr Duration kTimeOutMax = std::chrono::seconds(1);
  /// But no gyro is missing before two samples have failed to come.
  static constexpr int kTimeOutIntervalsMin = 3;

  /// Aligner and guard, which hold the gyros' intervals, must live as long.
  Attendance(const Plan& plan, const fusion::Aligner& aligner, const fusion::StampGuard& guard);

  [[nodiscard]] bool in_use(std::size_t gyro) const { return in_use_[gyro]; }
  [[nodiscard]] bool any_in_use() const { return in_use_[0] || in_use_[1]; }
  /// Pairs flow: both are in use.
  [[nodiscard]] bool pairing() const { return pairing_; }

  [[nodiscard]] double step_dps(std::size_t gyro) const { return health_[gyro].step_dps(); }
  /// VB_Health, without the bit for disagreement.
  [[nodiscard]] std::uint8_t health_bits() const;

  /// A rate that the frame says is one. Nothing when it may be used, else the cause why not.
  /// `can_go_alone`: the other gyro, where it is in use, carries on without this one.
  std::optional<Reject> judge(std::size_t gyro, TimePoint t, double rate_dps, bool can_go_alone);
  /// A frame without a rate, for this cause, with an accepted stamp.
  void judge_refused(std::size_t gyro, TimePoint t, Reject cause) {
    health_[gyro].refuse(t, cause);
  }
  /// The corrector's result.
  void set_opinion(TimePoint t, const fusion::Condition& condition);

  /// No gyro is in use, and no pair has come yet: from now on a gyro waits for the other one.
  void begin_waiting(TimePoint t) { waiting_since_ = t; }
  /// A sample that may be used.
  void hear(std::size_t gyro, TimePoint t);
  /// A frame of `t` that may not be used. True when its gyro is set aside with it.
  bool hear_refused(std::size_t gyro, TimePoint t);
  /// A sample that another axis of the unit makes unusable in the vehicle's axes. True
  /// when this gyro goes out of use with it: at once, or after the third in a row.
  bool go_without(std::size_t gyro, bool at_once);
  /// Its own sensor's values, or what its frames say of it, are not to be used for now.
  [[nodiscard]] bool set_aside(std::size_t gyro) const { return health_[gyro].set_aside(); }
  /// A pair has come. True when none had since the start, or since one gyro went.
  bool hear_pair();
  /// A rate of this gyro alone goes out.
  void hear_alone(std::size_t gyro) { alone_ = gyro; }
  /// Shall this gyro be used alone? Only when the other one is really missing, not while pairs are
  /// about to start. `paired`: there have been pairs.
  [[nodiscard]] bool may_speak_alone(std::size_t gyro, TimePoint t, bool paired) const;

  /// Marks the gyros that are silent for too long at `t`.
  struct Silence {
    std::array<bool, 2> fell_silent{};
    TimePoint next = TimePoint::max();  ///< when a gyro will be, at the earliest
  };
  Silence look_for_silence(TimePoint t);

  /// Of the samples that made the aligner's choice. Precondition: it is made.
  [[nodiscard]] Duration usual_interval(std::size_t gyro) const;
  [[nodiscard]] Duration time_out(std::size_t gyro) const;
  /// Of the gyro at whose stamps the pairs stand; 0 where the choice is not made yet.
  [[nodiscard]] Duration pair_interval() const;

  void tell(Status& status) const;

 private:
  static constexpr std::size_t kNobody = 2;

  const fusion::Aligner& aligner_;
  const fusion::StampGuard& guard_;
  std::array<GyroHealth, 2> health_;
  std::array<bool, 2> in_use_{};
  std::array<std::uint32_t, 2> without_in_row_{};  ///< of go_without()
  std::array<TimePoint, 2> last_heard_{};  ///< newest frame, even of a gyro that is set aside
  TimePoint waiting_since_;
  bool pairing_ = false;
  std::size_t alone_ = kNobody;  ///< gyro that is used alone
};

}  // namespace vgyro::gateway
