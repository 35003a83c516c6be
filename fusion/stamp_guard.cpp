#include "fusion/stamp_guard.h"

#include <algorithm>

namespace vgyro::fusion {

namespace {

// A slow stream may lose a frame or two without waiting for confirmations.
constexpr int kForwardIntervals = 3;
// Spacing is even within a quarter.
constexpr int kSpacingShare = 4;
// No recording is longer, but computers without a battery start in 1970 and are set later.
constexpr Duration kClockWasSet = std::chrono::hours(24) * 365 * 10;

}  // namespace

StampGuard::StampVerdict StampGuard::consider_all(std::size_t stream_index, TimePoint& time) {
  Stream& stream = streams_[stream_index];
  const Duration step = span(stream.last, time);
  if (stream.seen && step == Duration::zero()) return StampVerdict::kRepeated;
  const bool usual =
      stream.seen ? step > -kReorderMax && step <= forward_most(stream) : time >= TimePoint{};
  if (!usual) return consider(stream_index, time);
  follow(stream, time);
  return StampVerdict::kAccepted;
}

void StampGuard::set_offset(Duration offset) {
  offset_ = offset;
  end_ = kEndOfTime - std::max(offset_, Duration::zero());
}

Duration StampGuard::forward_most(const Stream& stream) {
  return std::max<Duration>(kForwardMax, kForwardIntervals * stream.interval);
}

void StampGuard::follow(Stream& stream, TimePoint time) {
  const Duration step = span(stream.last, time);
  if (stream.seen && step > Duration::zero()) {
    stream.interval =
        stream.interval == Duration::zero()
            ? std::min(step, kSlowest)
            : stream.interval + (std::min(step, kSlowest) - stream.interval) / kIntervalShare;
  }
  stream.last = stream.seen ? std::max(stream.last, time) : time;
  stream.seen = true;
  stream.confirmations = 0;
}

// Counts one more stamp that is far from the last accepted one: are there enough that agree?
bool StampGuard::confirm(Stream& stream, TimePoint time) {
  const Duration since = span(stream.candidate, time);
  const bool close_by = since > Duration::zero() && since <= kConfirmWithin;
  const bool first_spacing = stream.confirmations == 1;
  const bool even =
      since > Duration::zero() && since <= kSlowest &&
      (first_spacing || std::chrono::abs(since - stream.spacing) <= stream.spacing / kSpacingShare);
  if (stream.confirmations > 0 && (close_by || even)) {
    ++stream.confirmations;
    stream.close_by = stream.close_by && close_by;
  } else {
    stream.confirmations = 1;
    stream.close_by = true;
  }
  stream.candidate = time;
  // A spacing at these limits is even with no other one.
  stream.spacing = std::clamp<Duration>(since, -kSlowest, 2 * kSlowest);
  return stream.confirmations >= (stream.close_by ? kConfirmations : kSlowConfirmations);
}

StampGuard::StampVerdict StampGuard::consider(std::size_t stream_index, TimePoint& time) {
  Stream& stream = streams_[stream_index];
  if (stream.confirmations > 0) {
    // The same frame again, or one that was overtaken, neither confirms nor contradicts.
    if (time == stream.candidate) return StampVerdict::kRepeated;
    const bool overtaken = time < stream.candidate && span(time, stream.candidate) < kReorderMax;
    if (overtaken) return StampVerdict::kUnconfirmed;
  }
  if (!confirm(stream, time)) return StampVerdict::kUnconfirmed;
  if (!stream.close_by) stream.interval = stream.spacing;
  stream.confirmations = 0;
  if (time > stream.last && span(stream.last, time) < kClockWasSet) {
    stream.last = time;
    return StampVerdict::kAccepted;
  }
  if (stream_index < kLeaders) return step_clock(stream_index, time);
  // The stream was away from the gyros' time; is it back?
  if (!near_a_leader(time)) return StampVerdict::kUnconfirmed;
  stream.last = time;
  return StampVerdict::kAccepted;
}

bool StampGuard::near_a_leader(TimePoint time) const {
  return std::any_of(streams_.begin(), streams_.begin() + kLeaders, [&](const Stream& leader) {
    return leader.seen && std::chrono::abs(span(leader.last, time)) <= forward_most(leader);
  });
}

StampGuard::StampVerdict StampGuard::step_clock(std::size_t stream_index, TimePoint& time) {
  Stream& stream = streams_[stream_index];
  TimePoint newest = stream.last;
  for (std::size_t leader = 0; leader < kLeaders; ++leader) {
    if (streams_[leader].seen) newest = std::max(newest, streams_[leader].last);
  }
  // How long the step took is not known; one microsecond keeps the order.
  const TimePoint next = newest + std::chrono::microseconds(1);
  const TimePoint raw = time - offset_;
  set_offset(next - raw);
  time = next;
  for (Stream& other : streams_) {
    other.confirmations = 0;
    if (other.seen) other.last = newest;
  }
  stream.last = time;
  return StampVerdict::kClockStep;
}

}  // namespace vgyro::fusion
