#pragma once

// The system calls by which a file gets onto the disk are watched, and made to fail, from a test:
// the program's own fsync, write and rename stand in front of the library's.

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
