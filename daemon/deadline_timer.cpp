#include "daemon/deadline_timer.h"

#include <cerrno>
#include <sys/timerfd.h>
#include <unistd.h>

namespace vgyro::daemon {

DeadlineTimer::~DeadlineTimer() {
  if (fd_ >= 0) ::close(fd_);
}

Expected<void> DeadlineTimer::open() {
  fd_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  if (fd_ < 0) return fail("timerfd", system_reason(errno));
  return {};
}

void DeadlineTimer::set(Duration wait) const {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  const std::int64_t ns = std::chrono::nanoseconds(wait).count();
  itimerspec when{};
  when.it_value = {.tv_sec = ns / kSecond_ns, .tv_nsec = ns % kSecond_ns};
  ::timerfd_settime(fd_, 0, &when, nullptr);
}

}  // namespace vgyro::daemon
