#pragma once

// One CAN interface of the gateway: its socket while there is one, the frames read but not yet
// taken, and the state of the link. A link that is down or gone is never fatal. A renamed interface
// counts as removed: an interface that later takes its name is another bus.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "can/arrival_watch.h"
#include "can/error_frame.h"
#include "can/socket.h"
#include "can/stamp_clock.h"
#include "can/transmitter.h"
#include "daemon/bus_status.h"
#include "daemon/host_time.h"
#include "daemon/identifier_watch.h"
#include "daemon/line_budget.h"
#include "daemon/log.h"

namespace vgyro::daemon {

struct Arrival {
  const can::Frame* frame = nullptr;
  TimePoint stamp;  ///< on the host's clock
};

class Bus final : public can::Transmitter {
 public:
  /// Without filters the bus is only written to. `own` holds the identifiers that the gateway sends
  /// here; the filters must include them too. `clock` gives the time where the kernel has no stamp.
  Bus(std::string name, std::vector<can::Filter> filters, IdentifierWatch own,
      can::SocketOptions options, TurnClock& clock, Log& log);

  /// Binds a new socket, filters included. An interface that is not there yet is no error: it is
  /// reported once, and is_open() stays false. An unusable device of that name is an error.
  Expected<void> open();

  /// Call when poll reports data: peek() then reads further batches, at most kReadsPerCycle.
  void begin_reading() { reads_left_ = kReadsPerCycle; }

  /// The oldest frame not yet taken; `frame` is null if there is none for now. Skips error frames
  /// and frames with our identifiers, which are only counted.
  Arrival peek();
  void take() {
    ++next_;
    ++received_;
  }

  /// Many frames came in one batch: the socket was not read for a while.
  [[nodiscard]] bool is_behind() const { return batch_.frames.size() > kFewFrames; }

  /// The last read left no frame in the kernel.
  [[nodiscard]] bool drained() const { return !more_; }

  /// While the link is down, sends nothing until the kernel reports that the link is up and that
  /// the name still refers to this interface.
  can::SendResult send(const can::Frame& frame) override;

  /// Drops the frames that wait in the kernel.
  void discard() {
    for (begin_reading(); peek().frame != nullptr;)
      take();
  }

  /// To be called about once a second, when no frame is left to take: checks the link.
  void second_passed();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool is_open() const { return socket_.has_value(); }
  /// Only while open.
  [[nodiscard]] const can::Socket& socket() const { return *socket_; }
  /// As of the last look at the link; one that is down may still be given another MTU.
  [[nodiscard]] bool is_up() const { return is_open() && !down_; }
  [[nodiscard]] bool carries_fd() const { return is_open() && carries_fd_; }
  [[nodiscard]] BusStatus status() const;

 private:
  // 1024 frames, a quarter of a second of a full bus at 500 kbit/s: enough to catch up after a
  // delay, and few enough that the other buses do not starve.
  static constexpr int kReadsPerCycle = 16;
  static constexpr std::size_t kFewFrames = 4;

  bool refill();
  [[nodiscard]] TimePoint software_stamp(TimePoint kernels);
  can::ArrivalWatch::Clocks clocks() { return {turn_clock_->wall(), turn_clock_->steady()}; }
  /// Whether the socket is still bound to the interface of that name; notes if the link is up
  /// again.
  bool look_after_link();
  void link_went_down();
  void link_came_up();
  void lose_interface();
  void close_dead(const std::string& what_now);
  template <class... Args>
  void tell(Severity severity, std::string_view cause, fmt::format_string<Args...> text,
            Args&&... args) {
    if (!lines_.take()) return;
    log_->tell(severity, {.cause = cause, .bus = name_}, text, std::forward<Args>(args)...);
  }

  std::string name_;
  std::vector<can::Filter> filters_;
  can::SocketOptions options_;
  TurnClock* turn_clock_;
  Log* log_;
  LineBudget lines_;
  std::optional<can::Socket> socket_;
  can::StampClock clock_;
  can::ArrivalWatch arrivals_;
  bool clocks_are_fresh_ = false;  ///< restarted since the batch was read
  can::ControllerWatch controller_;
  IdentifierWatch own_;
  can::Batch batch_;
  std::size_t next_ = 0;
  TimePoint next_stamp_;
  std::size_t stamped_ = 0;  ///< frames of the batch whose stamp is computed
  int reads_left_ = 0;
  bool more_ = false;
  bool down_ = false;
  bool carries_fd_ = false;
  bool was_open_ = false;
  bool told_of_absence_ = false;
  std::uint64_t received_ = 0;
  std::uint64_t lost_before_ = 0;  ///< frames lost by closed sockets
  std::uint64_t downs_ = 0;
  std::uint64_t reopened_ = 0;
  std::uint64_t restamped_ = 0;
};

}  // namespace vgyro::daemon
