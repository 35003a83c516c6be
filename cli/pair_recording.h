#pragma once

// Reads logs into both gyros' rates on even grids, each alone and in pairs, through the gateway's
// own decoding, stamp guard and alignment. Memory: 32 bytes a pair of samples.

#include <span>
#include <string>
#include <vector>

#include "analysis/pair_noise.h"
#include "base/error.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// One recording for each of these pairs, from one pass over the logs. Error if a log cannot be
/// read, or a gyro is not in them.
Expected<std::vector<analysis::PairRecording>> read_pair_recordings(
    const std::vector<std::string>& logs, std::span<const gateway::Plan> plans);

}  // namespace vgyro::cli
