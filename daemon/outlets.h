#pragma once

// What waits to be sent, for each bus of a configuration: its queue, and whether poll is asked for
// room in its socket. Goes over to the next configuration by the names of the buses, so that
// nothing that was meant for one bus is sent to another. Allocates only when constructed.

#include <cstddef>
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
  explicit Outlets(const std::vector<std::string>& buses) : names_(buses), outlets_(buses.size()) {}

  [[nodiscard]] std::size_t size() const { return outlets_.size(); }
  Outlet& operator[](std::size_t bus) { return outlets_[bus]; }

  /// The queues of the buses that both have go on, with new sockets; the books of all do.
  void take_over(Outlets&& before);

  /// Of all buses, since the program started.
  [[nodiscard]] can::TransmitCounts counts() const;
  /// When the first queue has to be drained again; nothing while all are empty.
  [[nodiscard]] std::optional<TimePoint> next_deadline() const;

 private:
  std::vector<std::string> names_;
  std::vector<Outlet> outlets_;
  can::TransmitCounts gone_;  ///< of buses that no configuration has any longer
};

}  // namespace vgyro::daemon
