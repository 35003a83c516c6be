#pragma once

// The gap workflow: where do simulation and measurement disagree, what is missing in the model, and
// does the gap shrink when it is added? ARCHITECTURE.md shows the rounds.

#include <cstdint>
#include <functional>
#include <string_view>

#include "base/error.h"
#include "gap/recording.h"
#include "gap/result.h"
#include "model/file.h"

namespace vgyro::gap {

struct Settings {
  std::uint64_t seed = 1;  ///< of the simulations
  /// Called now and then with what is being done and how far the whole is, 0 to 1.
  std::function<void(std::string_view what, double share)> progress;
};

/// Error: the recording cannot be judged (too short, a gyro is missing, no rest and no reference
/// …).
Expected<Result> find_gap(const Recording& recording, const model::Model& model,
                          const Settings& settings);

Expected<Comparison> compare(const Recording& recording, const model::Model& model,
                             const Settings& settings);

}  // namespace vgyro::gap
