#pragma once

// Files that are written under a temporary name beside their place; each gets its own name when it
// is complete. If the program ends before that (an error, a signal), the earlier file, or none,
// remains.

#include <csignal>
#include <cstddef>
#include <string>

#include "base/error.h"

namespace vgyro::cli {

/// Call first: SIGHUP, SIGINT, SIGPIPE and SIGTERM then remove unfinished files, report what was
/// not written, and end the program as by default. A signal that the caller ignores stays ignored.
void guard_unfinished();

/// During its lifetime the first SIGINT only prints that the data received so far is being
/// finished: the terminal sends the same signal to the writer of the pipe, and its end ends the
/// input.
class FinishOnInterrupt {
 public:
  explicit FinishOnInterrupt(bool wanted);
  ~FinishOnInterrupt();
  FinishOnInterrupt(const FinishOnInterrupt&) = delete;
  FinishOnInterrupt& operator=(const FinishOnInterrupt&) = delete;
};

/// Delays these signals during its lifetime, for a few steps that must happen together.
class HoldSignals {
 public:
  HoldSignals();
  ~HoldSignals();
  HoldSignals(const HoldSignals&) = delete;
  HoldSignals& operator=(const HoldSignals&) = delete;

 private:
  sigset_t before_{};
};

/// A file that is not complete yet.
class Unfinished {
 public:
  /// More than any command writes at once.
  static constexpr std::size_t kMost = 8;

  /// Creates it beside `path`, with the permissions of the file at `path`, or of a new one. Error
  /// with the system's reason, also if kMost are open. `shown` is its name in messages.
  static Expected<Unfinished> beside(const std::string& path, const std::string& shown);
  Unfinished(Unfinished&& other) noexcept;
  Unfinished& operator=(Unfinished&&) = delete;
  /// Removes the file unless it was kept.
  ~Unfinished();

  [[nodiscard]] int descriptor() const { return fd_; }
  /// Gives the file its own name, after everything is written and closed. Error with the system's
  /// reason.
  Expected<void> keep();

 private:
  Unfinished(int fd, std::size_t slot, std::string path, std::string shown);
  static constexpr std::size_t kNone = kMost;
  int fd_;
  std::size_t slot_;  ///< its entry for the signal handler; kNone: nothing to remove
  std::string path_;
  std::string shown_;
};

}  // namespace vgyro::cli
