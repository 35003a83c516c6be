#pragma once

// Raw stamps in, monotone time out. The clock behind the stamps may be set, and frames may be
// garbage: one stamp far from its neighbours is refused; three in a row that agree with each other
// are accepted, or four of a slow stream at its own pace. If the clock is set back by more than the
// reorder limit, or ahead by more than ten years, the common offset compensates it, so the
// estimation's time never runs backwards. One guard serves all streams of a host.

#include <array>
#include <cstdint>

#include "base/time.h"

namespace vgyro::fusion {

class StampGuard {
 public:
  static constexpr std::size_t kStreams = 5;
  /// Only the first streams, the gyros, may change the offset; any other stream that jumps back
  /// waits.
  static constexpr std::size_t kLeaders = 2;
  static constexpr Duration kReorderMax = std::chrono::milliseconds(250);
  static constexpr Duration kForwardMax = std::chrono::seconds(1);
  static constexpr Duration kConfirmWithin = std::chrono::seconds(1);
  static constexpr int kConfirmations = 3;
  /// For a stream whose stamps are further apart than kConfirmWithin, but evenly.
  static constexpr int kSlowConfirmations = 4;
  /// Longest interval of a stream whose pace is followed.
  static constexpr Duration kSlowest = std::chrono::seconds(5);
  /// The end of the monotone axis, in 2261: no stamp of a log is later than 2255, and the
  /// difference of two stamps does not overflow.
  static constexpr TimePoint kEndOfTime = time_from_ns(9'200'000'000'000'000'000);

  enum class StampVerdict : std::uint8_t { kAccepted, kRepeated, kUnconfirmed, kClockStep };

  /// Puts the stamp on the monotone axis into `time`, unless the verdict is kUnconfirmed.
  /// kClockStep: accepted, and all streams' earlier samples belong to the time before the step.
  StampVerdict check(std::size_t stream, TimePoint raw, TimePoint& time) {
    if (!can_be_time(raw)) return StampVerdict::kUnconfirmed;
    time = raw + offset_;
    return follows_closely(streams_[stream], time) ? StampVerdict::kAccepted
                                                   : consider_all(stream, time);
  }

  /// Neither before the epoch nor beyond what the monotone axis can hold.
  [[nodiscard]] bool can_be_time(TimePoint raw) const { return raw >= TimePoint{} && raw <= end_; }
  /// monotone = raw + offset
  [[nodiscard]] Duration offset() const { return offset_; }
  /// Recent interval between the stream's stamps; 0 before there were two.
  [[nodiscard]] Duration interval(std::size_t stream) const { return streams_[stream].interval; }

 private:
  /// A new interval counts 1/kIntervalShare in the running mean.
  static constexpr int kIntervalShare = 8;
  static_assert(kForwardMax <= kSlowest);

  struct Stream {
    bool seen = false;
    TimePoint last;        ///< newest accepted, monotone
    Duration interval{0};  ///< recent
    TimePoint candidate;   ///< newest stamp that waits for confirmation, monotone
    Duration spacing{0};   ///< between it and the one before
    int confirmations = 0;
    bool close_by = true;  ///< all confirmations within kConfirmWithin of each other
  };
  /// True, and recorded, for the usual stamp: a little later than the one before.
  static bool follows_closely(Stream& stream, TimePoint time) {
    const Duration step = span(stream.last, time);
    const bool usual = stream.seen && step > Duration::zero() && step <= kForwardMax &&
                       stream.interval > Duration::zero();
    if (!usual) return false;
    stream.interval += (step - stream.interval) / kIntervalShare;
    stream.last = time;
    stream.confirmations = 0;
    return true;
  }
  [[gnu::cold, gnu::noinline]] StampVerdict consider_all(std::size_t stream_index, TimePoint& time);
  [[nodiscard]] static Duration forward_most(const Stream& stream);
  static void follow(Stream& stream, TimePoint time);
  static bool confirm(Stream& stream, TimePoint time);
  StampVerdict consider(std::size_t stream_index, TimePoint& time);
  StampVerdict step_clock(std::size_t stream_index, TimePoint& time);
  [[nodiscard]] bool near_a_leader(TimePoint time) const;

  void set_offset(Duration offset);

  std::array<Stream, kStreams> streams_;
  Duration offset_{0};
  TimePoint end_ = kEndOfTime;  ///< no raw stamp is later
};

}  // namespace vgyro::fusion
