#pragma once

// A queue of lines for a receiver that may not read: put() never waits, and a separate thread
// writes the lines in their order. Lines that do not fit, or cannot be written, are counted, and
// the count is written in their place as soon as lines are read again. Independent of the receiver.

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "daemon/loose_thread.h"

namespace vgyro::daemon {

/// Priorities of syslog.
enum class Severity : int { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6, kDebug = 7 };

struct Line {
  Severity severity = Severity::kInfo;
  std::string message = {};
  std::string gyro = {};
  std::string cause = {};
  std::string bus = {};
};

class LineQueue {
 public:
  /// May block; false if the line cannot be written.
  using Write = std::function<bool(const Line&)>;

  /// More than a daemon in trouble logs in a minute without a reader. A full queue takes some 100
  /// kB.
  static constexpr std::size_t kLinesMost = 256;

  /// Throws std::system_error if no thread can be started.
  explicit LineQueue(Write write);
  LineQueue(const LineQueue&) = delete;
  LineQueue& operator=(const LineQueue&) = delete;
  /// Waits at most a second for the remaining lines.
  ~LineQueue();

  void put(Line line);
  /// Counts a line that could not even be formatted.
  void count_lost();

  /// Waits until all lines are written; false if that takes longer than `patience`.
  bool flush(std::chrono::milliseconds patience);

  /// Lines that did not fit or could not be written, since the start.
  [[nodiscard]] std::uint64_t lost() const;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
  LooseThread thread_;
};

}  // namespace vgyro::daemon
