#pragma once

// A log → both gyros' rates on even grids, each alone and in pairs, through the gateway's own
// decoding, stamp guard and alignment. Memory: 32 bytes a pair of samples.

#include <string>

#include "analysis/pair_noise.h"
#include "base/error.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// Error when the log cannot be read, or a gyro is not in it.
Expected<analysis::PairRecording> read_pair_recording(const std::string& log,
                                                      const gateway::Plan& plan);

}  // namespace vgyro::cli
