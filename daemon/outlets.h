#pragma once

// The frames that wait to be sent, for each bus of a configuration: its queue, and whether poll
// watches for room in its socket. A reload matches buses by name, so that a frame meant for one bus
// is never sent to another. In shadow mode ([output] transmit = false) frames are counted instead
// of queued, and no transmitter is called. Allocates only when constructed.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/time.h"
#include "can/transmit.h"

namespace vgyro::daemon {

struct Outlet {
  can::TransmitQueue queue;
  bool polls_writable = false;

  /// A new socket, not yet registered with poll.
  void begin_anew() {
    polls_writable = false;
    queue.on_writable();
  }
};

class Outlets {
 public:
  explicit Outlets(const std::vector<std::string>& buses, bool transmit = true)
      : names_(buses), outlets_(buses.size()), transmit_(transmit) {}

  [[nodiscard]] std::size_t size() const { return outlets_.size(); }
  Outlet& operator[](std::size_t bus) { return outlets_[bus]; }

  /// TransmitQueue::send_at_once() of this bus. In shadow mode it only counts the frame and returns
  /// true.
  bool send_at_once(std::size_t bus, const can::Frame& frame, can::Transmitter& transmitter);
  /// TransmitQueue::push() of this bus. In shadow mode it only counts the frame.
  void push(std::size_t bus, const can::Frame& frame, TimePoint send_by);

  /// Keeps the waiting frames of buses that the new configuration still has, for their new sockets,
  /// and the counts of all buses. In shadow mode the waiting frames are dropped.
  void take_over(Outlets&& before);

  /// Counts of all buses, since the program started.
  [[nodiscard]] can::TransmitCounts counts() const;
  /// Frames that shadow mode kept from the buses, since the program started.
  [[nodiscard]] std::uint64_t shadowed() const { return shadowed_; }
  /// When the first queue has to be drained again; nothing while all are empty.
  [[nodiscard]] std::optional<TimePoint> next_deadline() const;

 private:
  std::vector<std::string> names_;
  std::vector<Outlet> outlets_;
  can::TransmitCounts gone_;  ///< counts of buses that are no longer configured
  bool transmit_;
  std::uint64_t shadowed_ = 0;
};

}  // namespace vgyro::daemon
