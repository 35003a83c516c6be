#pragma once

// Turns frames of one stream into accepted values with their time, or the cause why a frame cannot
// be used. Owns the order of the checks: is the frame complete and new (E2E), does it hold a value,
// is its stamp plausible. The live pipeline and the readers of recordings share it, so that both
// refuse the same frames. Counts nothing and knows no states of the pipeline; the guard belongs to
// the caller.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "base/time.h"
#include "can/frame.h"
#include "fusion/stamp_guard.h"
#include "gateway/e2e_check.h"
#include "gateway/gyro_input.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::gateway {

/// The streams of a fusion::StampGuard. The gyros, 0 and 1, come first, as they lead.
inline constexpr std::size_t kReferenceStream = 2;
inline constexpr std::size_t kAccelerometerStream = 3;
inline constexpr std::size_t kSpeedStream = 4;

/// The guard's verdict on one stamp.
struct StampResult {
  bool judged = false;           ///< false: the frame was refused before its stamp mattered
  std::optional<Reject> reject;  ///< kStampRepeated or kStampJump
  bool clock_step = false;       ///< accepted; earlier times belong to before the step
  TimePoint t;                   ///< monotone; set for accepted and for repeated stamps

  [[nodiscard]] bool believed() const { return judged && !reject; }
};
/// `result` must be freshly constructed. It is filled in place, as the results of frames are,
/// because a processor stalls when it copies data that it has just written in smaller parts.
inline void judge_stamp(std::size_t stream, TimePoint stamp, fusion::StampGuard& guard,
                        StampResult& result) {
  using Verdict = fusion::StampGuard::StampVerdict;
  result.judged = true;
  const Verdict verdict = guard.check(stream, stamp, result.t);
  if (verdict == Verdict::kAccepted) return;
  if (verdict == Verdict::kRepeated) result.reject = Reject::kStampRepeated;
  if (verdict == Verdict::kUnconfirmed) result.reject = Reject::kStampJump;
  result.clock_step = verdict == Verdict::kClockStep;
}

/// Which stamps are judged: those of values alone, or also those of authentic frames that report a
/// sensor fault (GyroHealth needs their time).
enum class Timed : std::uint8_t { kValues, kSickToo };
[[nodiscard]] bool is_timed(Reject reject, Timed timed);

/// N quantities of one message, all or none of them, with the message's E2E check.
template <std::size_t N>
class QuantityInput {
 public:
  /// The plan's parts must outlive this object.
  QuantityInput(const std::array<const Quantity*, N>& quantities, const E2ePlan& e2e)
      : quantities_(quantities), e2e_(e2e) {}

  struct Result {
    std::optional<Reject> reject;   ///< set: the frame is not used
    std::array<double, N> value{};  ///< in the product's units
  };
  /// `result` must be freshly constructed.
  void decode(const can::Frame& frame, Result& result) {
    const bool own = std::all_of(quantities_.begin(), quantities_.end(), [&](const Quantity* q) {
      return q->presence.always() || q->presence.holds(frame.payload());
    });
    result.reject = e2e_.judge(frame, own ? E2eCheck::Page::kOwn : E2eCheck::Page::kOther);
    for (std::size_t i = 0; i < N && !result.reject; ++i)
      result.reject = decode_quantity(*quantities_[i], frame, result.value[i]);
  }

 private:
  std::array<const Quantity*, N> quantities_;
  E2eCheck e2e_;
};

/// `Input` decodes a frame into its Result, which has a member `reject`.
template <class Input>
class Intake {
 public:
  Intake(std::size_t stream, Input input, Timed timed = Timed::kValues)
      : stream_(stream), input_(std::move(input)), timed_(timed) {}

  /// The value, valid if `reject` is empty. A cause found in the frame itself takes precedence over
  /// one of its stamp.
  struct Result : Input::Result {
    StampResult stamp;
  };
  Result take(const can::Frame& frame, TimePoint stamp, fusion::StampGuard& guard) {
    Result result;
    input_.decode(frame, result);
    if (result.reject && !is_timed(*result.reject, timed_)) return result;
    judge_stamp(stream_, stamp, guard, result.stamp);
    if (!result.reject && result.stamp.reject) result.reject = result.stamp.reject;
    return result;
  }

  [[nodiscard]] const Input& input() const { return input_; }
  /// Restarts the check of the alive counter.
  void fall_silent() { input_.fall_silent(); }

 private:
  std::size_t stream_;
  Input input_;
  Timed timed_;
};

using GyroIntake = Intake<GyroInput>;
using ScalarIntake = Intake<QuantityInput<1>>;
using AxesIntake = Intake<QuantityInput<3>>;

ScalarIntake reference_intake(const ReferencePlan& plan);
ScalarIntake speed_intake(const SpeedPlan& plan);
AxesIntake accelerometer_intake(const AccelerometerPlan& plan);

}  // namespace vgyro::gateway
