#pragma once

// Keeps the pipeline's learned state in a file: restored at the start, written when
// something new was learned, at most once a minute, and at the end. A disk may be slow, so a
// thread of its own writes; only finish() waits. File errors are reported, and never fatal.

#include <optional>
#include <string>

#include "base/error.h"
#include "daemon/background_writer.h"
#include "daemon/file_lock.h"
#include "daemon/log.h"
#include "daemon/state_file.h"
#include "gateway/plan.h"
#include "gateway/saved_state.h"

namespace vgyro::daemon {

class StateKeeper {
 public:
  static constexpr int kPeriod_s = 60;

  StateKeeper(std::string path, Log& log);

  /// Call first: no other process writes this file from now on. Error when one does.
  Expected<void> lock();

  /// What an earlier run left, when it is whole and of these gyros. What is not is set aside.
  std::optional<gateway::SavedState> load(const gateway::Plan& plan);

  /// To start afresh: what an earlier run left is removed.
  void forget();

  /// To be called about once a second; true when it is time for keep().
  bool second_passed();
  void keep(const std::optional<gateway::SavedState>& state);

  /// The last word; returns when it is on the disk.
  void finish(const std::optional<gateway::SavedState>& state);

 private:
  void refuse(Error error);
  void tell(const Expected<void>& written);

  StateFile file_;
  FileLock lock_;
  Log& log_;
  int seconds_left_ = 0;
  std::string latest_;   ///< given to the thread, or written
  bool failed_ = false;  ///< and reported
  BackgroundWriter writer_;
};

}  // namespace vgyro::daemon
