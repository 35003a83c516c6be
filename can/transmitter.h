#pragma once

// The result of sending a frame to the kernel, and the interface for it. The transmit policy uses
// only this interface; the socket implements it, tests fake it.

#include <cstdint>

#include "can/frame.h"

namespace vgyro::can {

enum class SendResult : std::uint8_t {
  kSent,
  kNoBuffer,     ///< the device's queue is full although poll says writable: try again later
  kWouldBlock,   ///< the socket's own buffer is full: poll() reports when it has room
  kLinkDown,     ///< interface down or gone: nothing can be sent for now
  kUnsupported,  ///< the link does not carry such a frame (CAN FD on a classic link)
  kFailed        ///< anything else; this frame is lost
};

class Transmitter {
 public:
  virtual ~Transmitter() = default;
  virtual SendResult send(const Frame& frame) = 0;
};

}  // namespace vgyro::can
