#pragma once

// Reads whole small files (configurations, DBC) at the start and at a reload.

#include <string>

#include "base/error.h"

namespace vgyro {

/// The file's bytes; an error names the file and the reason. Files above 64 MiB are refused.
Expected<std::string> read_file(const std::string& path);

}  // namespace vgyro
