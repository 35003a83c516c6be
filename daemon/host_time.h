#pragma once

// The host's clocks as the loop uses them, and what is derived from them. The pipeline's deadlines
// are on the clock of the frames' stamps, which may be set; those of frames waiting for the bus are
// on a clock that cannot be set.

#include <algorithm>
#include <optional>

#include "base/time.h"

namespace vgyro::daemon {

/// The host's clocks in one turn of the loop: each is read at its first use and then stands still.
/// Most turns read none, because where the kernel has no quick way, as under User Mode Linux, that
/// costs as much as reading a frame. A bus restarts the clocks within a turn to check whether a
/// stamp is in the future.
class TurnClock {
 public:
  using Read = TimePoint (*)();
  TurnClock(Read read_wall, Read read_steady) : read_wall_(read_wall), read_steady_(read_steady) {}

  void begin_turn() {
    wall_.reset();
    steady_.reset();
  }
  /// The clock of the frames' stamps, which may be set.
  TimePoint wall() {
    if (!wall_) wall_ = read_wall_();
    return *wall_;
  }
  /// A clock that cannot be set.
  TimePoint steady() {
    if (!steady_) steady_ = read_steady_();
    return *steady_;
  }

 private:
  Read read_wall_;
  Read read_steady_;
  std::optional<TimePoint> wall_;
  std::optional<TimePoint> steady_;
};

/// The clock of the stamps, without its backward steps: after one, a silence would go unnoticed
/// until the clock had caught up. While samples come, the pipeline takes a step out of their
/// stamps, so each sample makes this forget the step.
class ForwardTime {
 public:
  TimePoint update(TimePoint wall, TimePoint steady) {
    if (begun_) {
      // After a sample, the steady time that belongs to `wall_` is not known.
      const TimePoint expected = sampled_ ? wall_ : wall_ + (steady - steady_);
      if (wall < expected - kStepLeast) set_back_ += expected - wall;
    }
    begun_ = true;
    sampled_ = false;
    wall_ = wall;
    steady_ = steady;
    return wall + set_back_;
  }
  void sample_came(TimePoint wall) {
    begun_ = sampled_ = true;
    wall_ = wall;
    set_back_ = {};
  }

 private:
  // Slewing does not reach this between two updates.
  static constexpr Duration kStepLeast = std::chrono::milliseconds(100);

  bool begun_ = false;
  bool sampled_ = false;  ///< wall_ is the newest sample's, steady_ is older
  TimePoint wall_;
  TimePoint steady_;
  Duration set_back_{};
};

/// How long a frame may wait for the bus: two periods of VG_Rate, within limits. After that it is
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
