#pragma once

// One line per event for people: to the journal, with fields to filter by, when systemd connected
// stderr to it, else to stderr as it is. Rare lines only; nothing here belongs on the frame path.
// One thread speaks: the loop. Nobody waits for the journal or for stderr: lines that are not taken
// are counted (line_queue.h).

#include <chrono>
#include <cstdint>
#include <string_view>
#include <sys/uio.h>

#include <fmt/core.h>

#include "daemon/line_queue.h"

namespace vgyro::daemon {

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
  /// To this journal; where it fails, or is null, to stderr.
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

  /// Less severe lines are not written. The queue's own, of lines that were lost, always are.
  void set_level(Severity least) { least_ = least; }
  /// Everything is written, whatever the level, until this is called again.
  void toggle_debug();

  /// Waits until all lines are written; false when that takes too long.
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
