#pragma once

// Reads a log into the gap workflow's input: every usable frame of the gyros, raw rates with their
// own stamps, and the other quantities of the configuration. Uses the gateway's decoding; the model
// file is not applied. Garbage stamps are refused as in the live path. Memory: 28 bytes a gyro
// frame.

#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/recording.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// One recording for each of these pairs, from one pass over the log. Error if the log cannot be
/// read, or a gyro is not in it. `doing` is the text of the progress line.
Expected<std::vector<gap::Recording>> read_recordings(const std::string& log,
                                                      std::span<const gateway::Plan> plans,
                                                      const std::string& doing);

}  // namespace vgyro::cli
