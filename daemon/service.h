#pragma once

// Messages to systemd, and the decision whether to feed the watchdog. Without a service manager all
// of this does nothing. Unlike sd_notify(), Notifier never waits: a manager that does not read must
// not stop the rates. Messages not accepted are counted; required ones are repeated.

#include <cstdint>
#include <deque>
#include <string>

#include "base/time.h"

namespace vgyro::daemon {

class Notifier {
 public:
  /// Sends to the socket that $NOTIFY_SOCKET names.
  Notifier();
  /// Sends to this socket: a path, or a name that begins with '@'. Empty: no receiver.
  explicit Notifier(const std::string& address);
  Notifier(const Notifier&) = delete;
  Notifier& operator=(const Notifier&) = delete;
  ~Notifier();

  void ready(const std::string& status);
  void reloading();
  void stopping();
  void status(const std::string& status);
  void alive();

  /// Messages that the manager's socket did not take at once.
  [[nodiscard]] std::uint64_t failures() const { return failures_; }

 private:
  // Room for READY, RELOADING and READY again; older messages are obsolete.
  static constexpr std::size_t kOwedMost = 4;

  void tell(const std::string& text);
  void tell_surely(std::string text);
  bool pay_debts();
  bool send(const std::string& text);

  int fd_ = -1;
  std::string address_;
  std::deque<std::string> owed_;  ///< required, not accepted so far
  std::uint64_t failures_ = 0;
};

/// WATCHDOG_USEC of this process; 0 without a watchdog.
std::uint64_t watchdog_usec();

/// Decides whether the watchdog is fed. A loop that turns is not enough: whatever its state, the
/// gateway sends VG_Bias ten times a second, or with every rate of slower gyros. If has_moved() is
/// called a second or more after the last progress, and nothing was sent since, the gateway hangs.
/// Clock-free.
class LifeSign {
 public:
  static constexpr Duration kSilenceMost = std::chrono::seconds(1);

  /// `put_out`: Pipeline::spoken(). True if it has changed within the last second.
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
