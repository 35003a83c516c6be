#include "can/stamp_clock.h"

#include <algorithm>

namespace vgyro::can {
namespace {

// At 100 ppm a clock drifts by 100 µs in this time, which is how far the result can be off.
constexpr Duration kInterval = std::chrono::seconds(1);
// A larger change than any lateness: one of the two clocks was set.
constexpr Duration kStep = std::chrono::milliseconds(100);

}  // namespace

TimePoint StampClock::host_time(TimePoint software, TimePoint hardware) {
  if (hardware == TimePoint{}) return software;
  const Duration difference = software.time_since_epoch() - hardware.time_since_epoch();
  const bool stepped =
      current_ && (difference > *current_ + kStep || difference < *current_ - kStep);
  if (!current_ || stepped) {
    previous_.reset();
    current_ = difference;
    since_ = hardware;
  } else if (hardware - since_ >= kInterval) {
    previous_ = current_;
    current_ = difference;
    since_ = hardware;
  } else {
    current_ = std::min(*current_, difference);
  }
  return hardware + (previous_ ? std::min(*previous_, *current_) : *current_);
}

}  // namespace vgyro::can
