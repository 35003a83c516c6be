#include "daemon/bus.h"

#include <utility>

namespace vgyro::daemon {

Bus::Bus(std::string name, std::vector<can::Filter> filters, Log& log)
    : name_(std::move(name)), filters_(std::move(filters)), log_(log) {}

Expected<void> Bus::open() {
  Expected<can::Socket> socket = can::Socket::open(name_, filters_);
  if (!socket) return tl::unexpected(socket.error());
  socket_.emplace(std::move(*socket));
  clock_ = {};
  down_ = !socket_->link_up();
  if (down_) log_.warning("{}: link is down; `ip link set {} up` starts it", name_, name_);
  return {};
}

Arrival Bus::peek() {
  if (next_ == batch_.frames.size() && !refill()) return {};
  const can::Received& received = batch_.frames[next_];
  if (stamped_ == next_) {  // each stamp goes through the clock once
    const TimePoint software = received.stamp == TimePoint{} ? now_ : received.stamp;
    next_stamp_ = clock_.host_time(software, received.hardware);
    ++stamped_;
  }
  return {&received.frame, next_stamp_};
}

bool Bus::refill() {
  if (reads_left_ == 0 || !socket_) return false;
  --reads_left_;
  batch_ = socket_->receive();
  next_ = stamped_ = 0;
  received_ += batch_.frames.size();
  more_ = batch_.status == can::ReceiveStatus::kMore;
  if (!more_) reads_left_ = 0;
  switch (batch_.status) {
    case can::ReceiveStatus::kMore:
    case can::ReceiveStatus::kDrained:
      break;
    case can::ReceiveStatus::kLinkDown:
      if (!std::exchange(down_, true)) log_.warning("{}: link went down", name_);
      break;
    case can::ReceiveStatus::kDeviceGone:
      close_dead("the interface was removed");
      break;
    case can::ReceiveStatus::kFailed:
      close_dead(system_reason(socket_->last_errno()));
      break;
  }
  return !batch_.frames.empty();
}

void Bus::close_dead(const std::string& why) {
  log_.error("{}: {}; trying to open it again every second", name_, why);
  lost_before_ += socket_->drops();
  batch_ = {};
  socket_.reset();
}

void Bus::check_link() {
  if (down_ && socket_ && socket_->link_up()) {
    down_ = false;
    log_.notice("{}: link is up again", name_);
  }
}

}  // namespace vgyro::daemon
