#pragma once

// Turns a CAN controller's error reports, Linux's error frames, into a state and counters. Pure;
// can/socket.cpp checks that the numbers are the kernel's.

#include <array>
#include <cstdint>
#include <string_view>

#include "can/frame.h"

namespace vgyro::can {

/// Classes of error frames: bits of the identifier.
enum ErrorClass : std::uint32_t {
  kSendTimeout = 0x001,
  kLostArbitration = 0x002,
  kControllerProblem = 0x004,  ///< data byte 1: ControllerBit
  kProtocolViolation = 0x008,
  kTransceiver = 0x010,
  kNotAcknowledged = 0x020,
  kBusOff = 0x040,
  kBusError = 0x080,
  kRestarted = 0x100
};

enum ControllerBit : std::uint8_t {
  kReceiveOverflow = 0x01,
  kSendOverflow = 0x02,
  kReceiveWarning = 0x04,
  kSendWarning = 0x08,
  kReceivePassive = 0x10,
  kSendPassive = 0x20,
  kActiveAgain = 0x40
};

/// The classes requested from the kernel. Single bit errors are not: a loose cable causes thousands
/// a second of them, and the controller's state shows their effect.
inline constexpr std::uint32_t kErrorsWanted = kSendTimeout | kLostArbitration |
                                               kControllerProblem | kTransceiver |
                                               kNotAcknowledged | kBusOff | kRestarted;

enum class ControllerState : std::uint8_t { kActive, kWarning, kPassive, kBusOff };
std::string_view to_string(ControllerState state);

enum class ErrorCause : std::uint8_t {
  kBusOff,           ///< the controller left the bus
  kRestarted,        ///< the controller came back
  kErrorPassive,     ///< the controller may no longer disturb others: next to bus-off
  kErrorWarning,     ///< one of its error counters has reached 96
  kLostArbitration,  ///< reported only by controllers that send once
  kNotAcknowledged,  ///< no other node is on the bus
  kOverflow,         ///< the controller's own buffers overflowed
  kSendTimeout,      ///< the driver gave up a frame
  kTransceiver       ///< wires or transceiver
};
inline constexpr std::size_t kErrorCauseCount = 9;
std::string_view to_string(ErrorCause cause);

class ControllerWatch {
 public:
  /// Ignores frames that are not error frames.
  void note(const Frame& frame);
  /// Call when the link came up again: the earlier state no longer holds.
  void forget_state() { state_ = ControllerState::kActive; }

  [[nodiscard]] ControllerState state() const { return state_; }
  [[nodiscard]] std::uint64_t count(ErrorCause cause) const {
    return counts_[static_cast<std::size_t>(cause)];
  }
  [[nodiscard]] const std::array<std::uint64_t, kErrorCauseCount>& counts() const {
    return counts_;
  }

 private:
  void add(ErrorCause cause) { ++counts_[static_cast<std::size_t>(cause)]; }
  void note_controller(std::uint8_t bits);

  ControllerState state_ = ControllerState::kActive;
  std::array<std::uint64_t, kErrorCauseCount> counts_{};
};

}  // namespace vgyro::can
