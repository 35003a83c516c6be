#pragma once

// The gap workflow: where do simulation and measurement disagree, what is missing in the model, and
// does the gap shrink when it is added? ARCHITECTURE.md shows the rounds.

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "gap/acceptance.h"
#include "gap/recording.h"
#include "gap/result.h"
#include "model/file.h"

namespace vgyro::gap {

struct Settings {
  std::uint64_t seed = 1;  ///< of the simulations
  /// Of what is ambiguous these readings are applied; nothing else that is ambiguous is.
  std::vector<Acceptance> accept = {};
  /// What is left of the time, 1 to 0; asked now and then. What is certain by then is the result,
  /// the rest is told as open. Nothing: there is no limit.
  std::function<double()> time_left = {};
  bool with_evidence = false;  ///< fills Result::evidence
  /// Called now and then with what is being done and how far the whole is, 0 to 1.
  std::function<void(std::string_view what, double share)> progress;
};

/// Error: the recording cannot be judged (too short, a gyro is missing, no rest and no reference
/// …).
/// `recordings`: one, or several of the same pair, which are explained by one model; each has its
/// own biases and its own start of the drifts. They outlive the call.
Expected<Result> find_gap(const std::vector<Recording>& recordings, const model::Model& model,
                          const Settings& settings);

Expected<Comparison> compare(const std::vector<Recording>& recordings, const model::Model& model,
                             const Settings& settings);

}  // namespace vgyro::gap
