#pragma once

// State and counters of one interface, for the log, D-Bus and the metrics.

#include <array>
#include <cstdint>
#include <string>

#include "can/error_frame.h"

namespace vgyro::daemon {

struct BusStatus {
  std::string name;
  bool present = false;  ///< the interface is there, and a socket is bound to it
  bool link_up = false;
  can::ControllerState controller = can::ControllerState::kActive;
  std::array<std::uint64_t, can::kErrorCauseCount> errors{};  ///< by can::ErrorCause
  std::uint64_t received = 0;                                 ///< frames that passed the filters
  std::uint64_t lost = 0;       ///< of these, dropped because the receive buffer was full
  std::uint64_t downs = 0;      ///< times that the link went down or the interface was removed
  std::uint64_t reopened = 0;   ///< times that the interface was bound again
  std::uint64_t restamped = 0;  ///< frames whose stamp was no time of arrival
  std::uint64_t foreign = 0;    ///< frames with our identifiers from another sender
  bool contested = false;       ///< a foreign frame came within kContestedSeconds
};

}  // namespace vgyro::daemon
