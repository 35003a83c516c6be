#pragma once

// One line per event for people: to the journal, with fields to filter by, when systemd connected
// stderr to it, else to stderr as it is. Rare lines only; nothing here belongs on the frame path.

#include <string_view>
#include <sys/uio.h>

#include <fmt/core.h>

namespace vgyro::daemon {

/// Priorities of syslog.
enum class Severity : int { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6 };

/// What a line is about: VGYRO_GYRO=, VGYRO_CAUSE= and VGYRO_BUS= of the journal. Empty: nothing.
struct Subject {
  std::string_view gyro = {};
  std::string_view cause = {};
  std::string_view bus = {};
};

class Log {
 public:
  /// sd_journal_sendv(), or what a test has instead.
  using Journal = int (*)(const iovec* fields, int count);

  /// To the journal when stderr is connected to it.
  Log();
  /// To this journal.
  explicit Log(Journal journal) : journal_(journal) {}

  template <class... Args>
  void error(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kError, {}, text, fmt::make_format_args(args...));
  }
  template <class... Args>
  void warning(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kWarning, {}, text, fmt::make_format_args(args...));
  }
  template <class... Args>
  void notice(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kNotice, {}, text, fmt::make_format_args(args...));
  }
  template <class... Args>
  void info(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kInfo, {}, text, fmt::make_format_args(args...));
  }

  template <class... Args>
  void tell(Severity severity, const Subject& subject, fmt::format_string<Args...> text,
            Args&&... args) {
    write(severity, subject, text, fmt::make_format_args(args...));
  }

 private:
  void write(Severity severity, const Subject& subject, fmt::string_view text,
             fmt::format_args args) const;
  [[nodiscard]] bool write_journal(Severity severity, const Subject& subject,
                                   std::string_view message) const;

  Journal journal_ = nullptr;
};

}  // namespace vgyro::daemon
