#include "daemon/outlets.h"

#include <algorithm>
#include <utility>

namespace vgyro::daemon {

namespace {

void add(can::TransmitCounts& to, const can::TransmitCounts& counts) {
  to.sent += counts.sent;
  to.dropped_stale += counts.dropped_stale;
  to.dropped_overflow += counts.dropped_overflow;
  to.dropped_failed += counts.dropped_failed;
  to.retries += counts.retries;
}

}  // namespace

bool Outlets::send_at_once(std::size_t bus, const can::Frame& frame,
                           can::Transmitter& transmitter) {
  if (transmit_) return outlets_[bus].queue.send_at_once(frame, transmitter);
  ++shadowed_;
  return true;
}

void Outlets::push(std::size_t bus, const can::Frame& frame, TimePoint send_by) {
  if (transmit_) {
    outlets_[bus].queue.push(frame, send_by);
  } else {
    ++shadowed_;
  }
}

void Outlets::take_over(Outlets&& before) {
  gone_ = before.gone_;
  shadowed_ = before.shadowed_;
  for (std::size_t i = 0; i < before.names_.size(); ++i) {
    Outlet& old = before.outlets_[i];
    const auto found = std::find(names_.begin(), names_.end(), before.names_[i]);
    if (transmit_ && found != names_.end()) {
      Outlet& own = outlets_[static_cast<std::size_t>(found - names_.begin())];
      own = std::move(old);
      own.begin_anew();
      continue;
    }
    add(gone_, old.queue.counts());
    gone_.dropped_stale += old.queue.size();
  }
}

can::TransmitCounts Outlets::counts() const {
  can::TransmitCounts sum = gone_;
  for (const Outlet& outlet : outlets_)
    add(sum, outlet.queue.counts());
  return sum;
}

std::optional<TimePoint> Outlets::next_deadline() const {
  std::optional<TimePoint> first;
  for (const Outlet& outlet : outlets_) {
    const std::optional<TimePoint> due = outlet.queue.next_deadline();
    if (due && (!first || *due < *first)) first = due;
  }
  return first;
}

}  // namespace vgyro::daemon
