#include "daemon/bus.h"

#include <utility>

namespace vgyro::daemon {

Bus::Bus(std::string name, std::vector<can::Filter> filters, IdentifierWatch own,
         can::SocketOptions options, TurnClock& clock, Log& log)
    : name_(std::move(name)),
      filters_(std::move(filters)),
      options_(options),
      turn_clock_(&clock),
      log_(&log),
      own_(std::move(own)) {}

Expected<void> Bus::open() {
  Expected<can::Socket> socket = can::Socket::open(name_, filters_, options_);
  if (!socket) {
    if (!can::may_appear(name_)) return tl::unexpected(socket.error());
    // After a removal there was a line already.
    if (!std::exchange(told_of_absence_, true) && !was_open_) {
      tell(Severity::kWarning, "interface_absent", "{}; waiting for it", socket.error().message());
    }
    return {};
  }
  socket_.emplace(std::move(*socket));
  clock_ = {};
  controller_.forget_state();
  own_.opened();
  down_ = !socket_->link_up();
  const char* form = socket_->fd_frames() ? ", CAN FD" : "";
  const bool again = std::exchange(was_open_, true);
  if (again) ++reopened_;
  const bool late = std::exchange(told_of_absence_, false);
  tell(again || late ? Severity::kNotice : Severity::kInfo, "interface_bound", "{}: {}{}", name_,
       again ? "open again" : "bound", form);
  if (down_) {
    tell(Severity::kWarning, "link_down", "{}: link is down; `ip link set {} up` starts it", name_,
         name_);
  }
  return {};
}

Arrival Bus::peek() {
  for (;;) {
    if (next_ == batch_.frames.size() && !refill()) return {};
    const can::Frame& frame = batch_.frames[next_].frame;
    const bool is_error = frame.has(can::kError);
    if (is_error) controller_.note(frame);
    if (!is_error && !own_.takes(frame, batch_.frames[next_].local)) break;
    stamped_ = ++next_;
  }
  const can::Received& received = batch_.frames[next_];
  if (stamped_ == next_) {  // each stamp goes through the clock once
    const TimePoint software = received.stamp == TimePoint{} ? turn_clock_->wall() : received.stamp;
    next_stamp_ = clock_.host_time(software, received.hardware);
    ++stamped_;
  }
  return {&received.frame, next_stamp_};
}

bool Bus::refill() {
  next_ = stamped_ = 0;
  batch_ = {};
  if (reads_left_ == 0 || !socket_) return false;
  --reads_left_;
  batch_ = socket_->receive();
  more_ = batch_.status == can::ReceiveStatus::kMore;
  if (!more_) reads_left_ = 0;
  switch (batch_.status) {
    case can::ReceiveStatus::kMore:
    case can::ReceiveStatus::kDrained:
      break;
    case can::ReceiveStatus::kLinkDown:
      link_went_down();
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

void Bus::link_went_down() {
  if (std::exchange(down_, true)) return;
  ++downs_;
  tell(Severity::kWarning, "link_down", "{}: link went down", name_);
}

void Bus::close_dead(const std::string& why) {
  tell(Severity::kWarning, "interface_lost", "{}: {}; waiting for it", name_, why);
  lost_before_ += socket_->drops();
  // The batch lives in the socket.
  batch_ = {};
  socket_.reset();
}

void Bus::second_passed() {
  own_.second_passed();
  if (down_ && socket_ && socket_->link_up()) {
    down_ = false;
    controller_.forget_state();
    tell(Severity::kNotice, "link_up", "{}: link is up again", name_);
  }
  if (const std::uint64_t held = lines_.second_passed(); held > 0) {
    log_->tell(Severity::kWarning, {.cause = "link_flickers", .bus = name_},
               "{}: {} more changes of the link in the last minute", name_, held);
  }
}

BusStatus Bus::status() const {
  return {.name = name_,
          .present = is_open(),
          .link_up = is_open() && !down_,
          .controller = controller_.state(),
          .errors = controller_.counts(),
          .received = received_,
          .lost = lost_before_ + (socket_ ? socket_->drops() : 0),
          .downs = downs_,
          .reopened = reopened_,
          .foreign = own_.count(),
          .contested = own_.is_contested()};
}

}  // namespace vgyro::daemon
