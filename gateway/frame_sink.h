#pragma once

// Where the gateway's frames go: a socket's queue, a log, a test. The sink accepts every frame and
// counts those that a full or failed bus does not take.

#include "base/time.h"
#include "can/frame.h"

namespace vgyro::gateway {

class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// The stamp is that of the input frame (or of the time-out) that caused the output.
  virtual void put(const can::Frame& frame, TimePoint stamp) = 0;
  /// For a bus other than the output's own. A sink with a single bus puts all frames there.
  virtual void put_on(can::BusIndex /*bus*/, const can::Frame& frame, TimePoint stamp) {
    put(frame, stamp);
  }
};

}  // namespace vgyro::gateway
