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

  /// `aligner` and `guard`, which hold the gyros' intervals, must outlive this object.
  Attendance(const Plan& plan, const fusion::Aligner& aligner, const fusion::StampGuard& guard);

  [[nodiscard]] bool in_use(std::size_t gyro) const { return in_use_[gyro]; }
  [[nodiscard]] bool any_in_use() const { return in_use_[0] || in_use_[1]; }
  /// Both gyros are in use, so pairs arrive.
  [[nodiscard]] bool pairing() const { return pairing_; }

  [[nodiscard]] double step_dps(std::size_t gyro) const { return health_[gyro].step_dps(); }
  /// VB_Health, except for the bit that reports disagreement.
  [[nodiscard]] std::uint8_t health_bits() const;

  /// Judges a decoded rate. Returns nothing when it may be used, otherwise the cause of refusal.
  /// `can_go_alone`: the other gyro, if it is in use, continues without this one.
  std::optional<Reject> judge(std::size_t gyro, TimePoint t, double rate_dps, bool can_go_alone);
  /// A frame that holds no usable rate, for this cause, and whose stamp was accepted.
  void judge_refused(std::size_t gyro, TimePoint t, Reject cause) {
    health_[gyro].refuse(t, cause);
  }
  /// Passes the corrector's result on to the health of both gyros.
  void set_opinion(TimePoint t, const fusion::Condition& condition);

  /// From now on, with no gyro in use and no pair so far, a gyro waits for the other one.
  void begin_waiting(TimePoint t) { waiting_since_ = t; }
  /// Records a usable sample.
  void hear(std::size_t gyro, TimePoint t);
  /// Records an unusable frame of time `t`. True when it takes its gyro out of use.
  bool hear_refused(std::size_t gyro, TimePoint t);
  /// Records a sample that cannot be turned into the vehicle's axes because another axis of the
  /// unit is missing. True when it takes this gyro out of use: at once, or with the third in a row.
  bool go_without(std::size_t gyro, bool at_once);
  /// The gyro is not used for now, because of its own sensor's values or of what its frames report.
  [[nodiscard]] bool set_aside(std::size_t gyro) const { return health_[gyro].set_aside(); }
  /// Records a pair. True for the first one since the start or since a gyro dropped out.
  bool hear_pair();
  /// Records that a rate of this gyro alone goes out.
  void hear_alone(std::size_t gyro) { alone_ = gyro; }
  /// May this gyro be used alone? Only when the other one is really missing, not while pairs are
  /// about to start. `paired`: there have been pairs.
  [[nodiscard]] bool may_speak_alone(std::size_t gyro, TimePoint t, bool paired) const;

  /// Marks the gyros that are silent for too long at `t`.
  struct Silence {
    std::array<bool, 2> fell_silent{};
    TimePoint next = TimePoint::max();  ///< earliest time at which another gyro falls silent
  };
  Silence look_for_silence(TimePoint t);

  /// From the samples that the aligner's choice was made of. Precondition: the choice is made.
  [[nodiscard]] Duration usual_interval(std::size_t gyro) const;
  [[nodiscard]] Duration time_out(std::size_t gyro) const;
  /// Interval of the gyro whose stamps the pairs have; 0 before the aligner has chosen.
  [[nodiscard]] Duration pair_interval() const;

  void tell(Status& status) const;

 private:
  static constexpr std::size_t kNobody = 2;

  const fusion::Aligner& aligner_;
  const fusion::StampGuard& guard_;
  std::array<GyroHealth, 2> health_;
  std::array<bool, 2> in_use_{};
  std::array<std::uint32_t, 2> without_in_row_{};  ///< consecutive calls of go_without()
  std::array<TimePoint, 2> last_heard_{};  ///< newest frame, even of a gyro that is set aside
  TimePoint waiting_since_;
  bool pairing_ = false;
  std::size_t alone_ = kNobody;  ///< gyro that is used alone
};

}  // namespace vgyro::gateway
