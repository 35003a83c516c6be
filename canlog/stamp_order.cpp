#include "canlog/stamp_order.h"

#include <algorithm>
#include <utility>

namespace vgyro::canlog {

void StampOrder::Queue::push(Held held) {
  if (count_ == ring_.size()) {
    std::vector<Held> larger(std::max<std::size_t>(16, 2 * ring_.size()));
    for (std::size_t i = 0; i < count_; ++i)
      larger[i] = std::move(ring_[(first_ + i) % ring_.size()]);
    ring_ = std::move(larger);
    first_ = 0;
  }
  ring_[(first_ + count_) % ring_.size()] = std::move(held);
  ++count_;
}

StampOrder::Held StampOrder::Queue::pop() {
  Held held = std::move(ring_[first_]);
  first_ = (first_ + 1) % ring_.size();
  --count_;
  return held;
}

void StampOrder::push(const LogRecord& record, const XlFrame* xl, std::size_t stream) {
  const bool has_xl = record.is_xl && xl != nullptr;
  Held held{record, has_xl ? std::make_unique<XlFrame>(*xl) : nullptr, pushed_++};
  if (stream >= streams_.size()) streams_.resize(stream + 1);
  streams_[stream].push(std::move(held));
  ++held_;
  last_ns_ = to_ns(record.stamp);
}

// The stream whose first record has the lowest stamp.
std::size_t StampOrder::first() const {
  std::size_t best = streams_.size();
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    if (streams_[i].is_empty()) continue;
    const auto key = [&](std::size_t stream) {
      return std::pair(streams_[stream].front().record.stamp, streams_[stream].front().number);
    };
    if (best == streams_.size() || key(i) < key(best)) best = i;
  }
  return best;
}

bool StampOrder::is_ready() const {
  if (held_ == 0) return false;
  if (closed_ || held_ >= kHeldMax) return true;
  // A clock that was set back by more does not delay the earlier records.
  const std::int64_t lead_ns = last_ns_ - to_ns(streams_[first()].front().record.stamp);
  return lead_ns > late_max_ns_ || lead_ns < -late_max_ns_;
}

StampOrder::Held StampOrder::pop() {
  --held_;
  return streams_[first()].pop();
}

}  // namespace vgyro::canlog
