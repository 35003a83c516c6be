#pragma once

// The daemon's log, one line per event for people: to the journal, with fields to filter by, if
// systemd connected stderr to it; otherwise to stderr. For rare lines only, not for the frame path.
// Called by the loop's thread alone, which never waits for the journal or stderr: lines that are
// not taken are counted (line_queue.h).

#include <chrono>
#include <cstdint>
#include <string_view>
#include <sys/uio.h>

#include <fmt/core.h>

#include "daemon/line_queue.h"

namespace vgyro::daemon {

/// What a line is about: the journal's fields VGYRO_GYRO=, VGYRO_CAUSE= and VGYRO_BUS=, unless
/// empty.
struct Subject {
  std::string_view gyro = {};
  std::string_view cause = {};
  std::string_view bus = {};
};

class Log {
 public:
  /// sd_journal_sendv(), or a test's replacement.
  using Journal = int (*)(const iovec* fields, int count);

  /// Writes to the journal if stderr is connected to it, otherwise to stderr.
  Log();
  /// Writes to this journal; to stderr if it fails or is null.
  explicit Log(Journal journal);

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
  void debug(fmt::format_string<Args...> text, Args&&... args) {
    write(Severity::kDebug, {}, text, fmt::make_format_args(args...));
  }

  template <class... Args>
  void tell(Severity severity, const Subject& subject, fmt::format_string<Args...> text,
            Args&&... args) {
    write(severity, subject, text, fmt::make_format_args(args...));
  }

  /// Less severe lines are not written. The queue's own reports of lost lines always are.
  void set_level(Severity least) { least_ = least; }
  /// Everything is written, whatever the level, until this is called again.
  void toggle_debug();

  /// Waits until all lines are written; false if that takes longer than `patience`.
  bool flush(std::chrono::milliseconds patience) { return lines_.flush(patience); }

  /// Lines lost since the start.
  [[nodiscard]] std::uint64_t lost() const { return lines_.lost(); }

 private:
  void write(Severity severity, const Subject& subject, fmt::string_view text,
             fmt::format_args args);

  [[nodiscard]] bool is_wanted(Severity severity) const { return debugging_ || severity <= least_; }

  Severity least_ = Severity::kInfo;
  bool debugging_ = false;
  LineQueue lines_;
};

}  // namespace vgyro::daemon
