#pragma once

// Where the gateway's frames go: a socket's queue, a log, a test. The sink takes what it is given;
// what becomes of a frame on a bus that is full or down is the sink's to count.

#include "base/time.h"
#include "can/frame.h"

namespace vgyro::gateway {

class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// The stamp is that of the input frame (or of the time-out) that caused the output.
  virtual void put(const can::Frame& frame, TimePoint stamp) = 0;
  /// For another bus than the output's own. A sink with only one puts all there.
  virtual void put_on(can::BusIndex /*bus*/, const can::Frame& frame, TimePoint stamp) {
    put(frame, stamp);
  }
};

}  // namespace vgyro::gateway
