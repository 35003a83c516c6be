#pragma once

// Lines for a receiver that may not read: put() never waits. A thread of its own
// writes them in their order. Lines that do not fit, or cannot be written, are counted, and the
// count is written in their place as soon as lines are read again. Independent of the receiver.

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
  /// May wait as long as it likes; false when the line cannot be written.
  using Write = std::function<bool(const Line&)>;

  /// What a reader who looks away for a minute misses of a daemon in trouble, and more; with it the
  /// queue takes some 100 kB.
  static constexpr std::size_t kLinesMost = 256;

  /// Throws std::system_error where there are no more threads.
  explicit LineQueue(Write write);
  LineQueue(const LineQueue&) = delete;
  LineQueue& operator=(const LineQueue&) = delete;
  /// Waits a second at most for what is not written yet.
  ~LineQueue();

  void put(Line line);
  /// One that never became a line.
  void count_lost();

  /// Waits until all is written, or `patience` has passed; true when it is.
  bool flush(std::chrono::milliseconds patience);

  /// Lines that did not fit or could not be written, since the start.
  [[nodiscard]] std::uint64_t lost() const;

 private:
  struct Shared;
  std::shared_ptr<Shared> shared_;
  LooseThread thread_;
};

}  // namespace vgyro::daemon
