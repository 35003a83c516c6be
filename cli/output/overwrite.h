#pragma once

// The one guard against writing over what is read: every command asks it once, before anything is
// opened for writing. Files are compared by device and inode, so another name, a link or "./" does
// not help; a file that is not there yet by its folder and name. Devices and pipes hold nothing
// that could be lost.

#include <string>
#include <vector>

#include "base/error.h"

namespace vgyro::cli {

/// Error when an output is also an input, or two outputs are one file. "-" is standard input among
/// the inputs, standard output among the outputs; an empty name is no file.
Expected<void> check_outputs(const std::vector<std::string>& inputs,
                             const std::vector<std::string>& outputs);

}  // namespace vgyro::cli
