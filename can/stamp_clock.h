#pragma once

// Hardware stamps come from a controller's own clock: precise, but with any epoch and drifting by
// tens of ppm. Software stamps are on the host's clock, but late by a varying time. This class
// combines the precision of one with the clock of the other: it adds the smallest recent difference
// between them, so that frames of several controllers, and time-outs, are all on one clock. Pure.
// them, so that frames of several controllers, and time-outs, are all on one clock. Pure.

#include <optional>

#include "base/time.h"

namespace vgyro::can {

class StampClock {
 public:
  /// The stamp to use, on the host's clock. `hardware` is 0 if the controller has no clock.
  TimePoint host_time(TimePoint software, TimePoint hardware);

 private:
  /// The lateness of software stamps is never negative, so the smallest difference is the most
  /// accurate.
  std::optional<Duration> current_;   ///< smallest difference since `since_`
  std::optional<Duration> previous_;  ///< smallest of the interval before
  TimePoint since_;                   ///< on the controller's clock
};

}  // namespace vgyro::can
