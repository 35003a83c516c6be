#pragma once

// How long ago the corrector learned from a stop. The pipeline counts stops without their times, so
// the age is as exact as count_is() is called often: to the second. Clock-free.

#include <cstdint>
#include <limits>

#include "base/time.h"

namespace vgyro::daemon {

class StopAge {
 public:
  /// `stops`: the number learned from so far. It falls when a stop turns out to be a turn, and
  /// begins at 0 again with a new pipeline: neither is a stop.
  void count_is(std::uint64_t stops, TimePoint now) {
    if (stops > stops_) {
      last_ = now;
      has_one_ = true;
    }
    stops_ = stops;
  }

  /// Since the last one, s; NaN before the first one since the start of the process.
  [[nodiscard]] double age_s(TimePoint now) const {
    return has_one_ ? to_seconds(now - last_) : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  std::uint64_t stops_ = 0;
  TimePoint last_;
  bool has_one_ = false;
};

}  // namespace vgyro::daemon
