#pragma once

// Gyros by their names in the configuration, where a command line expects their numbers.

#include <string>

#include "base/error.h"
#include "model/file.h"

namespace vgyro::cli {

/// A word of `vgyro gap --accept` with gyro numbers in place of names: "gyro=mems,kind=delay"
/// becomes "gyro=2,kind=delay". Numbers stay as they are. Error if neither gyro has the name.
Expected<std::string> with_gyro_numbers(const std::string& word, const model::GyroNames& gyros);

}  // namespace vgyro::cli
