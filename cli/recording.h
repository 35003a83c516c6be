#pragma once

// A log → what the gap workflow knows of it: every usable frame of the gyros, raw rates with their
// own stamps, and what else the configuration names. Through the gateway's decoding; the model file
// is not applied. Stamps that are garbage are refused as the live path refuses them. Memory: 28
// bytes a gyro frame.

#include <string>

#include "base/error.h"
#include "gap/recording.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// Error when the log cannot be read, or a gyro is not in it. `doing` is for the line of progress.
Expected<gap::Recording> read_recording(const std::string& log, const gateway::Plan& plan,
                                        const std::string& doing);

}  // namespace vgyro::cli
