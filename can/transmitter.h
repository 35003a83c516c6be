#pragma once

// What becomes of a frame that is handed to the kernel, and who does the handing over. The transmit
// policy uses only this; the socket implements it, tests fake it.

#include <cstdint>

#include "can/frame.h"

namespace vgyro::can {

enum class SendResult : std::uint8_t {
  kSent,
  kNoBuffer,     ///< the device's queue is full although poll says writable: try again later
  kWouldBlock,   ///< the socket's own buffer is full: poll will say when it is not
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
