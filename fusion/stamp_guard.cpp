#include "fusion/stamp_guard.h"

#include <algorithm>

namespace vgyro::fusion {

StampGuard::Verdict StampGuard::check(std::size_t stream_index, TimePoint raw, TimePoint& time) {
  Stream& stream = streams_[stream_index];
  time = raw + offset_;
  const Duration step = time - stream.last;
  if (stream.seen && step == Duration::zero()) return Verdict::kRepeated;
  const bool usual = !stream.seen || (step > -kReorderMax && step <= kForwardMax);
  if (!usual) return consider(stream_index, time);
  stream.seen = true;
  stream.confirmations = 0;
  stream.last = std::max(stream.last, time);
  return Verdict::kAccepted;
}

StampGuard::Verdict StampGuard::consider(std::size_t stream_index, TimePoint& time) {
  Stream& stream = streams_[stream_index];
  const Duration since = time - stream.candidate;
  const bool agrees =
      stream.confirmations > 0 && since > Duration::zero() && since <= kConfirmWithin;
  stream.confirmations = agrees ? stream.confirmations + 1 : 1;
  stream.candidate = time;
  if (stream.confirmations < kConfirmations) return Verdict::kUnconfirmed;
  stream.confirmations = 0;
  if (time > stream.last) {
    stream.last = time;
    return Verdict::kAccepted;
  }
  if (stream_index >= kLeaders) return Verdict::kUnconfirmed;
  TimePoint newest = stream.last;
  for (std::size_t leader = 0; leader < kLeaders; ++leader) {
    if (streams_[leader].seen) newest = std::max(newest, streams_[leader].last);
  }
  // Nobody knows how long the step took; one microsecond keeps the order.
  const Duration shift = newest + std::chrono::microseconds(1) - time;
  offset_ += shift;
  time += shift;
  for (Stream& other : streams_) {
    other.confirmations = 0;
    if (other.seen) other.last = newest;
  }
  stream.last = time;
  return Verdict::kClockStep;
}

}  // namespace vgyro::fusion
