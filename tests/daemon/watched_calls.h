#pragma once

// Lets a test watch the system calls that bring a file to the disk, and make them fail: the
// program's own fsync, write and rename take the place of the library's.

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vgyro::daemon {

struct Calls {
  bool watching = false;
  std::vector<std::string> names;
  std::string failing;  ///< this call fails
  int failure = EIO;
  std::size_t write_most = SIZE_MAX;  ///< bytes that one write takes
};
extern Calls calls;

}  // namespace vgyro::daemon
