#include "can/transmit.h"

#include <algorithm>

namespace vgyro::can {

TransmitQueue::TransmitQueue(const TransmitLimits& limits)
    : limits_(limits), ring_(std::max<std::size_t>(limits.capacity, 1)) {}

// A frame that the kernel refuses here is tried again by drain(), which counts refusals.
bool TransmitQueue::send_at_once(const Frame& frame, Transmitter& transmitter) {
  if (size_ > 0 || awaits_writable_ || wait_ != Duration{}) return false;
  if (transmitter.send(frame) != SendResult::kSent) return false;
  link_down_ = false;
  ++counts_.sent;
  return true;
}

void TransmitQueue::push(const Frame& frame, TimePoint send_by) {
  if (size_ == ring_.size()) {
    pop();
    ++counts_.dropped_overflow;
  }
  ring_[(head_ + size_) % ring_.size()] = {frame, send_by};
  ++size_;
}

void TransmitQueue::pop() {
  head_ = (head_ + 1) % ring_.size();
  --size_;
}

void TransmitQueue::drain(TimePoint now, Transmitter& transmitter) {
  drop_stale(now);
  if (!may_try(now)) return;
  while (size_ > 0 && send_oldest(now, transmitter))
    drop_stale(now);
}

void TransmitQueue::drop_stale(TimePoint now) {
  while (size_ > 0 && ring_[head_].send_by < now) {
    pop();
    ++counts_.dropped_stale;
  }
}

bool TransmitQueue::may_try(TimePoint now) const {
  if (awaits_writable_) return false;
  // A clock that was set back must not stretch the wait.
  return wait_ == Duration{} || now >= retry_at_ || now < retry_at_ - wait_;
}

bool TransmitQueue::send_oldest(TimePoint now, Transmitter& transmitter) {
  if (wait_ != Duration{}) ++counts_.retries;
  const SendResult result = transmitter.send(ring_[head_].frame);
  link_down_ = result == SendResult::kLinkDown;
  switch (result) {
    case SendResult::kWouldBlock:
      awaits_writable_ = true;
      return false;
    case SendResult::kNoBuffer:
    case SendResult::kLinkDown:
      back_off(now);
      return false;
    case SendResult::kSent:
      ++counts_.sent;
      break;
    case SendResult::kUnsupported:
    case SendResult::kFailed:
      ++counts_.dropped_failed;
      break;
  }
  wait_ = Duration{};
  pop();
  return true;
}

void TransmitQueue::back_off(TimePoint now) {
  wait_ = wait_ == Duration{} ? limits_.first_retry : std::min(wait_ * 2, limits_.last_retry);
  retry_at_ = now + wait_;
}

std::optional<TimePoint> TransmitQueue::next_deadline() const {
  if (size_ == 0) return std::nullopt;
  const TimePoint oldest_ends = ring_[head_].send_by + Duration{1};
  if (awaits_writable_) return oldest_ends;
  if (wait_ == Duration{}) return TimePoint::min();
  return std::min(retry_at_, oldest_ends);
}

}  // namespace vgyro::can
