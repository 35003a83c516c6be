#pragma once

// The host's clocks as the loop uses them, and what is derived of them. What is due on the bus goes
// by the clock of the frames' stamps, which may be set; what waits for the bus goes by one that may
// not.

#include <algorithm>

#include "base/time.h"

namespace vgyro::daemon {

/// The stamps' clock, without its backward steps: nobody would notice a silence until it had caught
/// up. Where samples come, the pipeline takes a step out of their stamps; then it is forgotten
/// here.
class ForwardTime {
 public:
  TimePoint update(TimePoint wall, TimePoint steady) {
    if (begun_) {
      const TimePoint expected = wall_ + (steady - steady_);
      if (wall < expected - kStepLeast) set_back_ += expected - wall;
    }
    begun_ = true;
    wall_ = wall;
    steady_ = steady;
    return wall + set_back_;
  }
  void sample_came() { set_back_ = {}; }

 private:
  // Slewing does not reach this between two turns of the loop.
  static constexpr Duration kStepLeast = std::chrono::milliseconds(100);

  bool begun_ = false;
  TimePoint wall_;
  TimePoint steady_;
  Duration set_back_{};
};

/// How long a frame may wait for the bus: two periods of VG_Rate. What it has not taken by then is
/// worth less than its successor.
class Patience {
 public:
  void rate_at(TimePoint stamp) {
    const Duration interval = stamp - last_;
    last_ = stamp;
    if (interval > Duration{} && interval < kIntervalMost) interval_ += (interval - interval_) / 16;
  }
  [[nodiscard]] Duration value() const { return std::clamp(2 * interval_, kLeast, kMost); }

 private:
  static constexpr Duration kIntervalMost = std::chrono::seconds(1);
  // The first retry comes after 1 ms.
  static constexpr Duration kLeast = std::chrono::milliseconds(2);
  static constexpr Duration kMost = std::chrono::milliseconds(200);

  TimePoint last_;
  Duration interval_ = std::chrono::milliseconds(10);
};

}  // namespace vgyro::daemon
