#pragma once

// Keeps the pipeline's learned state in a file: restored at the start, written when something new
// was learned, at most once a minute, and at the end. A disk may be slow, so a separate thread
// writes; only finish() waits. File errors are reported, and never fatal.

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

  /// Call first: reserves the file for this process. Error if another process has it.
  Expected<void> lock();

  /// The state of an earlier run, if it is whole and of these gyros. Otherwise its file is renamed.
  std::optional<gateway::SavedState> load(const gateway::Plan& plan);

  /// Removes the state of an earlier run, to start afresh.
  void forget();

  /// To be called about once a second; true when it is time for keep().
  bool second_passed();
  void keep(const std::optional<gateway::SavedState>& state);

  /// Writes the last state; returns when it is on the disk.
  void finish(const std::optional<gateway::SavedState>& state);

 private:
  void refuse(Error error);
  void tell(const Expected<void>& written);

  StateFile file_;
  FileLock lock_;
  Log& log_;
  int seconds_left_ = 0;
  std::string latest_;   ///< given to the thread, or written
  bool failed_ = false;  ///< the last write failed, and that was reported
  BackgroundWriter writer_;
};

}  // namespace vgyro::daemon
