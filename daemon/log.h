#pragma once

// One line per event for people: to the journal with its priorities when systemd connected stderr
// to it, else to stderr as it is. Rare lines only; nothing here belongs on the frame path.

#include <fmt/core.h>

namespace vgyro::daemon {

/// Priorities of syslog.
enum class Severity : int { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6 };

class Log {
 public:
  Log();

  template <class... Args>
  void error(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kError, text, fmt::make_format_args(args...));
  }
  template <class... Args>
  void warning(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kWarning, text, fmt::make_format_args(args...));
  }
  template <class... Args>
  void notice(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kNotice, text, fmt::make_format_args(args...));
  }
  template <class... Args>
  void info(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kInfo, text, fmt::make_format_args(args...));
  }

 private:
  void write(Severity severity, fmt::string_view text, fmt::format_args args) const;

  bool to_journal_;
};

}  // namespace vgyro::daemon
