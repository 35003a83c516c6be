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
    if (!can::may_appear(name_)) {
      if (was_open_ && !std::exchange(told_of_absence_, true))
        tell(Severity::kError, "interface_unusable", "{}", socket.error().message());
      return tl::unexpected(socket.error());
    }
    // close_dead() has already logged a removal.
    if (!std::exchange(told_of_absence_, true) && !was_open_) {
      tell(Severity::kWarning, "interface_absent", "{}; waiting for it", socket.error().message());
    }
    return {};
  }
  socket_.emplace(std::move(*socket));
  clock_ = {};
  arrivals_.opened(clocks());
  controller_.forget_state();
  own_.opened();
  const can::LinkState link = socket_->look();
  down_ = !link.is_up;
  carries_fd_ = link.fd_frames;
  const bool again = std::exchange(was_open_, true);
  if (again) ++reopened_;
  const bool late = std::exchange(told_of_absence_, false);
  tell(again || late ? Severity::kNotice : Severity::kInfo, "interface_bound", "{}: {}{}", name_,
       again ? "open again" : "bound", carries_fd_ ? ", CAN FD" : "");
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
    next_stamp_ = clock_.host_time(software_stamp(received.stamp), received.hardware);
    ++stamped_;
  }
  return {&received.frame, next_stamp_};
}

// The kernel's stamp, or the time of reading if that stamp is not the time of arrival.
TimePoint Bus::software_stamp(TimePoint kernels) {
  if (kernels != TimePoint{} && arrivals_.is_near(kernels)) return kernels;
  if (!std::exchange(clocks_are_fresh_, true)) turn_clock_->begin_turn();
  if (kernels == TimePoint{}) return turn_clock_->wall();
  if (arrivals_.may_be_arrival(kernels, clocks())) return kernels;
  ++restamped_;
  return turn_clock_->wall();
}

bool Bus::refill() {
  next_ = stamped_ = 0;
  batch_ = {};
  if (reads_left_ == 0 || !socket_) return false;
  --reads_left_;
  batch_ = socket_->receive();
  clocks_are_fresh_ = false;
  more_ = batch_.status == can::ReceiveStatus::kMore;
  if (!more_) reads_left_ = 0;
  switch (batch_.status) {
    case can::ReceiveStatus::kMore:
    case can::ReceiveStatus::kDrained:
      // While its link was down, the interface may have been renamed: these frames may be of
      // another bus.
      if (down_ && !batch_.frames.empty() && !look_after_link()) lose_interface();
      break;
    case can::ReceiveStatus::kLinkDown:
      link_went_down();
      break;
    case can::ReceiveStatus::kDeviceGone:
      lose_interface();
      break;
    case can::ReceiveStatus::kFailed:
      close_dead(system_reason(socket_->last_errno()) + "; waiting for it");
      break;
  }
  return !batch_.frames.empty();
}

can::SendResult Bus::send(const can::Frame& frame) {
  if (!socket_) return can::SendResult::kLinkDown;
  // The socket is not closed here: its batch may hold the frame that `frame` answers.
  if (down_) look_after_link();
  if (down_) return can::SendResult::kLinkDown;
  const can::SendResult result = socket_->send(frame);
  // The socket reports that the link went down only once, to the first send() or receive().
  if (result == can::SendResult::kLinkDown) link_went_down();
  return result;
}

bool Bus::look_after_link() {
  const can::LinkState link = socket_->look();
  if (link.is_ours) carries_fd_ = link.fd_frames;
  if (down_ && link.is_up) link_came_up();
  return link.is_ours;
}

void Bus::link_came_up() {
  down_ = false;
  controller_.forget_state();
  tell(Severity::kNotice, "link_up", "{}: link is up again{}", name_,
       carries_fd_ ? ", CAN FD" : "");
}

// Counts every report, even if the link was up again only between two looks.
void Bus::link_went_down() {
  ++downs_;
  if (std::exchange(down_, true)) return;
  tell(Severity::kWarning, "link_down", "{}: link went down", name_);
}

// The interface was removed, moved to another network namespace, or renamed.
void Bus::lose_interface() {
  if (!std::exchange(down_, true)) ++downs_;
  const std::string name_now = socket_->name_now();
  close_dead(name_now.empty() ? "the interface was removed; waiting for it"
                              : fmt::format("the interface is now called {}; looking for {} again",
                                            name_now, name_));
}

void Bus::close_dead(const std::string& what_now) {
  tell(Severity::kWarning, "interface_lost", "{}: {}", name_, what_now);
  lost_before_ += socket_->drops();
  // The batch refers to memory of the socket.
  batch_ = {};
  more_ = false;
  socket_.reset();
}

void Bus::second_passed() {
  own_.second_passed();
  if (socket_ && !look_after_link()) lose_interface();
  if (!more_) arrivals_.seen_empty(clocks());
  if (const std::uint64_t held = lines_.second_passed(); held > 0) {
    log_->tell(Severity::kWarning, {.cause = "link_flickers", .bus = name_},
               "{}: {} more changes of the link in the last minute", name_, held);
  }
}

BusStatus Bus::status() const {
  return {.name = name_,
          .present = is_open(),
          .link_up = is_up(),
          .controller = controller_.state(),
          .errors = controller_.counts(),
          .received = received_,
          .lost = lost_before_ + (socket_ ? socket_->drops() : 0),
          .downs = downs_,
          .reopened = reopened_,
          .restamped = restamped_,
          .foreign = own_.count(),
          .contested = own_.is_contested()};
}

}  // namespace vgyro::daemon
