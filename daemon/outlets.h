#pragma once

// What waits to be sent, for each bus of a configuration: its queue, and whether poll is asked for
// room in its socket. Goes over to the next configuration by the names of the buses, so that
// nothing that was meant for one bus is sent to another. In shadow mode ([output] transmit = false)
// no frame gets as far as a queue: it is counted, and no transmitter is asked. Allocates only when
// constructed.

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

  /// As TransmitQueue's; in shadow mode the frame is counted, and true.
  bool send_at_once(std::size_t bus, const can::Frame& frame, can::Transmitter& transmitter);
  /// Likewise.
  void push(std::size_t bus, const can::Frame& frame, TimePoint send_by);

  /// The queues of the buses that both have go on, with new sockets; the books of all do. In shadow
  /// mode nothing waits any more.
  void take_over(Outlets&& before);

  /// Of all buses, since the program started.
  [[nodiscard]] can::TransmitCounts counts() const;
  /// Frames that shadow mode kept from the buses, since the program started.
  [[nodiscard]] std::uint64_t shadowed() const { return shadowed_; }
  /// When the first queue has to be drained again; nothing while all are empty.
  [[nodiscard]] std::optional<TimePoint> next_deadline() const;

 private:
  std::vector<std::string> names_;
  std::vector<Outlet> outlets_;
  can::TransmitCounts gone_;  ///< of buses that no configuration has any longer
  bool transmit_;
  std::uint64_t shadowed_ = 0;
};

}  // namespace vgyro::daemon
