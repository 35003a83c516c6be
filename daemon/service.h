#pragma once

// What systemd is told (sd_notify), and whether it may be told that the gateway is alive. Without a
// service manager all of this does nothing.

#include <cstdint>
#include <string>

#include "base/time.h"

namespace vgyro::daemon {

void notify_ready(const std::string& status);
void notify_reloading();
void notify_stopping();
void notify_status(const std::string& status);
void notify_alive();

/// WATCHDOG_USEC of this process; 0 where nobody watches.
std::uint64_t watchdog_usec();

/// Decides whether the watchdog is fed. A loop that turns is not enough: the gateway sends VG_Bias
/// ten times a second whatever its state, so one that has sent nothing for a second hangs.
/// Clock-free.
class LifeSign {
 public:
  static constexpr Duration kSilenceMost = std::chrono::seconds(1);

  /// `put_out`: frames that the pipeline has put out so far. True when it has moved.
  bool has_moved(TimePoint now, std::uint64_t put_out) {
    if (put_out != put_out_) last_moved_ = now;
    put_out_ = put_out;
    return now - last_moved_ < kSilenceMost;
  }

 private:
  std::uint64_t put_out_ = 0;
  TimePoint last_moved_ = time_from_ns(-2'000'000'000);
};

}  // namespace vgyro::daemon
