#pragma once

// The guard against overwriting an input: every command calls it once, before it opens anything for
// writing. Compares existing files by device and inode, so that another name, a link or "./" makes
// no difference; other files by folder and name. Devices and pipes hold nothing that could be lost.

#include <string>
#include <vector>

#include "base/error.h"

namespace vgyro::cli {

/// Error if an output is also an input, or if two outputs are one file. "-" is standard input among
/// the inputs and standard output among the outputs; an empty name is no file.
Expected<void> check_outputs(const std::vector<std::string>& inputs,
                             const std::vector<std::string>& outputs);

}  // namespace vgyro::cli
