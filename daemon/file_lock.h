#pragma once

// One owner for something that is kept in a file: a lock on a file beside it, for the file itself
// is replaced with every write. It is advisory, ends with the process however that ends, and leaves
// nothing behind but after a kill. Knows nothing of what is protected.

#include <string>

#include "base/error.h"

namespace vgyro::daemon {

class FileLock {
 public:
  /// Takes nothing yet. The lock is on `path` + ".lock".
  explicit FileLock(const std::string& path) : lock_path_(path + ".lock") {}
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock();

  enum class Outcome { kTaken, kHeld, kImpossible };
  /// Never waits. kHeld: by another process, holder() says which; kImpossible: no lock can be made
  /// there.
  Outcome take();

  /// "process 1234"; as far as that is known.
  [[nodiscard]] std::string holder() const;

 private:
  Outcome try_once(bool& again);

  std::string lock_path_;
  int fd_ = -1;
};

}  // namespace vgyro::daemon
