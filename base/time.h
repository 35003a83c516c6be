#pragma once

// Types for time. A stamp is the time at which a frame was on the bus, from the kernel or a log.
// BusClock has no now(): time enters the product only through the drivers (daemon, replay, tests).

#include <chrono>
#include <cstdint>

namespace vgyro {

using Duration = std::chrono::nanoseconds;

struct BusClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<BusClock, duration>;
  static constexpr bool is_steady = false;  // a host's clock may be set while the product runs
};

/// Nanoseconds since the epoch of the host (live) or of the log (which may start at 0).
using TimePoint = BusClock::time_point;

constexpr TimePoint time_from_ns(std::int64_t ns) {
  return TimePoint{Duration{ns}};
}
constexpr std::int64_t to_ns(TimePoint t) {
  return t.time_since_epoch().count();
}
/// `later` less `earlier`, saturated to 64 bits: after a clock was set, or with a damaged stamp,
/// the difference may be centuries.
constexpr Duration span(TimePoint earlier, TimePoint later) {
  std::int64_t ns = 0;
  if (!__builtin_sub_overflow(to_ns(later), to_ns(earlier), &ns)) return Duration{ns};
  return later < earlier ? -Duration::max() : Duration::max();
}
constexpr double to_seconds(Duration d) {
  return static_cast<double>(d.count()) * 1e-9;
}
/// Rounds to the nanosecond; the caller keeps |s| below 9e9 s.
constexpr Duration from_seconds(double s) {
  return Duration{static_cast<std::int64_t>(s * 1e9 + (s < 0 ? -0.5 : 0.5))};
}

}  // namespace vgyro
