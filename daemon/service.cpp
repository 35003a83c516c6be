#include "daemon/service.h"

#include <ctime>
#include <systemd/sd-daemon.h>

#include <fmt/format.h>

namespace vgyro::daemon {

void notify_ready(const std::string& status) {
  sd_notify(0, fmt::format("READY=1\nSTATUS={}", status).c_str());
}

// With the time, systemd knows a reload that it has asked for from one that came of itself.
void notify_reloading() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}\nSTATUS=reading the configuration again",
                           std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000)
                   .c_str());
}

void notify_stopping() {
  sd_notify(0, "STOPPING=1\nSTATUS=stopping");
}

void notify_status(const std::string& status) {
  sd_notify(0, ("STATUS=" + status).c_str());
}

void notify_alive() {
  sd_notify(0, "WATCHDOG=1");
}

std::uint64_t watchdog_usec() {
  std::uint64_t usec = 0;
  return sd_watchdog_enabled(0, &usec) > 0 ? usec : 0;
}

}  // namespace vgyro::daemon
