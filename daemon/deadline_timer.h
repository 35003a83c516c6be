#pragma once

// A timer that is set as seldom as possible: nearly every frame moves the next deadline, and mostly
// to a later time. It may go off too early, never too late.

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "base/time.h"

namespace vgyro::daemon {

/// When the timer goes off, from the deadlines of both clocks. Pure.
class Alarm {
 public:
  // Not at once: a deadline that somehow stays in the past must not turn into a busy loop.
  static constexpr Duration kLeast = std::chrono::milliseconds(1);
  /// A clock that is set may bring a deadline nearer without anybody noticing.
  static constexpr Duration kMost = std::chrono::seconds(1);

  /// While it has not gone off, the present is before this, on the clock of the frames' stamps.
  [[nodiscard]] TimePoint latest_now() const { return stamped_; }

  /// It would go off too late for one of these deadlines.
  [[nodiscard]] bool is_late_for(TimePoint stamped, TimePoint steady) const {
    return stamped < stamped_ || steady < steady_;
  }

  /// Sets it for the earlier of two deadlines; returns how long that is from now.
  Duration set(TimePoint stamped_due, TimePoint stamped_now, TimePoint steady_due,
               TimePoint steady_now) {
    const Duration wait = std::min(until(stamped_due, stamped_now), until(steady_due, steady_now));
    stamped_ = stamped_now + wait;
    steady_ = steady_now + wait;
    return wait;
  }

 private:
  static Duration until(TimePoint due, TimePoint now) {
    if (due <= now + kLeast) return kLeast;
    return due >= now + kMost ? kMost : due - now;
  }

  TimePoint stamped_ = TimePoint::max();  ///< on the clock of the frames' stamps
  TimePoint steady_ = TimePoint::max();
};

/// A timerfd: readable when it has gone off, until it is set again.
class DeadlineTimer {
 public:
  DeadlineTimer() = default;
  DeadlineTimer(const DeadlineTimer&) = delete;
  DeadlineTimer& operator=(const DeadlineTimer&) = delete;
  ~DeadlineTimer();

  Expected<void> open();
  [[nodiscard]] int fd() const { return fd_; }
  /// Once, after this time.
  void set(Duration wait) const;

 private:
  int fd_ = -1;
};

}  // namespace vgyro::daemon
