#pragma once

// Gives a file or directory one owner by a lock on a file beside it, because the file itself is
// replaced with every write. The lock is advisory and ends with the process, however that ends; the
// lock file stays behind only after a kill. Independent of what is protected.

#include <string>

#include "base/error.h"

namespace vgyro::daemon {

class FileLock {
 public:
  /// Does not lock yet. The lock file is `path` + ".lock".
  explicit FileLock(const std::string& path) : lock_path_(path + ".lock") {}
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock();

  enum class Outcome { kTaken, kHeld, kImpossible };
  /// Never waits. kHeld: another process has the lock, see holder(); kImpossible: the lock file
  /// cannot be made.
  Outcome take();

  /// "process 1234", or "an unknown process".
  [[nodiscard]] std::string holder() const;

 private:
  Outcome try_once(bool& again);

  std::string lock_path_;
  int fd_ = -1;
};

}  // namespace vgyro::daemon
