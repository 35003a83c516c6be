#pragma once

// Files that are being written under a temporary name beside their place: each takes its own name
// when it is whole. Whatever ends before (an error, a signal) leaves the earlier file as it was, or
// none.

#include <csignal>
#include <cstddef>
#include <string>

#include "base/error.h"

namespace vgyro::cli {

/// First of all: SIGHUP, SIGINT, SIGPIPE and SIGTERM remove what is unfinished, say what was not
/// written, and end the program as they would without this. A signal that the caller ignores stays
/// ignored.
void guard_unfinished();

/// Until its end the first SIGINT only says that what has arrived is being finished: the writer of
/// a pipe gets the same signal from the terminal, and its end is the end of the input.
class FinishOnInterrupt {
 public:
  explicit FinishOnInterrupt(bool wanted);
  ~FinishOnInterrupt();
  FinishOnInterrupt(const FinishOnInterrupt&) = delete;
  FinishOnInterrupt& operator=(const FinishOnInterrupt&) = delete;
};

/// While it lives these signals wait: for a few steps that must be done together.
class HoldSignals {
 public:
  HoldSignals();
  ~HoldSignals();
  HoldSignals(const HoldSignals&) = delete;
  HoldSignals& operator=(const HoldSignals&) = delete;

 private:
  sigset_t before_{};
};

/// A file that is not whole yet.
class Unfinished {
 public:
  /// More at once than any command writes.
  static constexpr std::size_t kMost = 8;

  /// Creates it beside `path`, with the permissions that the file at `path` has, or those of a new
  /// one. Error with the system's reason, also where kMost are open. `shown` is its name for
  /// people.
  static Expected<Unfinished> beside(const std::string& path, const std::string& shown);
  Unfinished(Unfinished&& other) noexcept;
  Unfinished& operator=(Unfinished&&) = delete;
  /// Removes what was not kept.
  ~Unfinished();

  [[nodiscard]] int descriptor() const { return fd_; }
  /// Gives it its own name, after all is written and closed. Error with the system's reason.
  Expected<void> keep();

 private:
  Unfinished(int fd, std::size_t slot, std::string path, std::string shown);
  static constexpr std::size_t kNone = kMost;
  int fd_;
  std::size_t slot_;  ///< what the signal handler knows of it; kNone: nothing to remove
  std::string path_;
  std::string shown_;
};

}  // namespace vgyro::cli
