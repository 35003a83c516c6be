#include "daemon/file_lock.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vgyro::daemon {
namespace {

// An owner that ends may unlink the lock file just after this process opened it, so taking the lock
// is tried again. That cannot plausibly happen this often in a row.
constexpr int kAttemptsMost = 10;

bool is_still_there(int fd, const std::string& path) {
  struct stat open_one {};
  struct stat named {};
  return ::fstat(fd, &open_one) == 0 && ::stat(path.c_str(), &named) == 0 &&
         open_one.st_ino == named.st_ino && open_one.st_dev == named.st_dev;
}

}  // namespace

FileLock::~FileLock() {
  if (fd_ < 0) return;
  ::unlink(lock_path_.c_str());  // while locked, so that it is not another's file
  ::close(fd_);
}

FileLock::Outcome FileLock::take() {
  Outcome outcome = Outcome::kImpossible;
  bool again = true;
  for (int attempt = 0; again && attempt < kAttemptsMost; ++attempt)
    outcome = try_once(again);
  return outcome;
}

FileLock::Outcome FileLock::try_once(bool& again) {
  again = false;
  constexpr int kFlags = O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK;
  int fd = ::open(lock_path_.c_str(), O_RDWR | O_CREAT | kFlags, 0644);
  // The file belongs to another user's process, killed or running: flock() needs only read access.
  if (fd < 0 && errno == EACCES) fd = ::open(lock_path_.c_str(), O_RDONLY | kFlags);
  if (fd < 0) return Outcome::kImpossible;
  const bool locked = ::flock(fd, LOCK_EX | LOCK_NB) == 0;
  if (locked && is_still_there(fd, lock_path_)) {
    const std::string own = std::to_string(::getpid()) + "\n";
    [[maybe_unused]] const bool noted =
        ::ftruncate(fd, 0) == 0 && ::pwrite(fd, own.data(), own.size(), 0) > 0;
    fd_ = fd;
    return Outcome::kTaken;
  }
  const bool held = !locked && errno == EWOULDBLOCK;
  ::close(fd);
  again = locked;
  return held ? Outcome::kHeld : Outcome::kImpossible;
}

std::string FileLock::holder() const {
  std::array<char, 16> text{};
  const int fd = ::open(lock_path_.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  const ssize_t count = fd < 0 ? -1 : ::read(fd, text.data(), text.size());
  if (fd >= 0) ::close(fd);
  std::string number;
  for (ssize_t i = 0; i < count && i < static_cast<ssize_t>(text.size()); ++i) {
    const char c = text[static_cast<std::size_t>(i)];
    if (c < '0' || c > '9') break;
    number += c;
  }
  return number.empty() ? "an unknown process" : "process " + number;
}

}  // namespace vgyro::daemon
