#pragma once

// Whole files from untrusted sources: only regular files, because a pipe or a device may keep its
// reader waiting for ever, and only up to a bound that the caller gives. Does not interpret the
// contents.

#include <cstddef>
#include <string>

#include "base/error.h"

namespace vgyro {

/// The file's bytes; an error names the file and the reason. Never waits for a pipe or a device.
Expected<std::string> read_regular_file(const std::string& path, std::size_t bytes_max);

}  // namespace vgyro
