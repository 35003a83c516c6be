#pragma once

// Logs → both gyros' rates on even grids, each alone and in pairs, through the gateway's own
// decoding, stamp guard and alignment. Memory: 32 bytes a pair of samples.

#include <string>
#include <vector>

#include "analysis/pair_noise.h"
#include "base/error.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// Error when a log cannot be read, or a gyro is not in them.
Expected<analysis::PairRecording> read_pair_recording(const std::vector<std::string>& logs,
                                                      const gateway::Plan& plan);

}  // namespace vgyro::cli
