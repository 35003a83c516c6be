#include "watched_calls.h"

#include <algorithm>
#include <cstdio>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace vgyro::daemon {

Calls calls;

namespace {

bool fails(const std::string& name) {
  if (!calls.watching) return false;
  calls.names.push_back(name);
  if (calls.failing != name) return false;
  errno = calls.failure;
  return true;
}

}  // namespace
}  // namespace vgyro::daemon

extern "C" {

int fsync(int fd) {
  struct stat about {};
  ::fstat(fd, &about);
  if (vgyro::daemon::fails(S_ISDIR(about.st_mode) ? "fsync directory" : "fsync file")) return -1;
  return static_cast<int>(::syscall(SYS_fsync, fd));
}

ssize_t write(int fd, const void* bytes, size_t count) {
  using vgyro::daemon::calls;
  if (vgyro::daemon::fails("write")) return -1;
  return ::syscall(SYS_write, fd, bytes,
                   calls.watching ? std::min(count, calls.write_most) : count);
}

int rename(const char* from, const char* to) noexcept {
  if (vgyro::daemon::fails("rename")) return -1;
  return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

}  // extern "C"
