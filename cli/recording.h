#pragma once

// A log → the gap workflow's input: every usable frame of the gyros, raw rates with their
// own stamps, and what else the configuration names. Through the gateway's decoding; the model file
// is not applied. Stamps that are garbage are refused as the live path refuses them. Memory: 28
// bytes a gyro frame.

#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/recording.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// Of each of these pairs, in one reading of the log. Error when the log cannot be read, or a gyro
/// is not in it. `doing` is for the line of progress.
Expected<std::vector<gap::Recording>> read_recordings(const std::string& log,
                                                      std::span<const gateway::Plan> plans,
                                                      const std::string& doing);

}  // namespace vgyro::cli
