#pragma once

// A timer that is set as rarely as possible, because nearly every frame moves the next deadline,
// mostly to a later time. It may go off early, but never late.

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "base/time.h"

namespace vgyro::daemon {

/// Computes when the timer must go off, from the deadlines on both clocks. Pure.
class Alarm {
 public:
  // Above 0: a deadline that stays in the past must not cause a busy loop.
  static constexpr Duration kLeast = std::chrono::milliseconds(1);
  /// Setting the clock may bring a deadline nearer, and no event reports that.
  static constexpr Duration kMost = std::chrono::seconds(1);

  /// Until the alarm goes off, the present is before this, on the clock of the frames' stamps.
  [[nodiscard]] TimePoint latest_now() const { return stamped_; }

  /// Whether the alarm would go off too late for one of these deadlines.
  [[nodiscard]] bool is_late_for(TimePoint stamped, TimePoint steady) const {
    return stamped < stamped_ || steady < steady_;
  }

  /// Sets the alarm for the earlier of two deadlines; returns the time until then.
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
  /// Goes off once, after `wait`.
  void set(Duration wait) const;

 private:
  int fd_ = -1;
};

}  // namespace vgyro::daemon
