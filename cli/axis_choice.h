#pragma once

// Offline commands evaluate pairs of gyros: the two of the configuration, or, for two whole units,
// the pair about each axis of the vehicle. Each unit's readings are those of the sensor axis that
// lies along it, so a unit's mount may exchange and flip axes, but not tilt them.

#include <string>
#include <vector>

#include "base/error.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// The pairs to evaluate: one for two single gyros. `axis`: "x", "y" or "z" of whole units; empty:
/// each of them. The gyros of a unit's pair have the other axes too, if one message carries them.
/// Error at `config` if there is no such axis, or a mount tilts.
Expected<std::vector<gateway::Plan>> chosen_pairs(const std::string& config,
                                                  const gateway::Plan& plan,
                                                  const std::string& axis);

/// "z" for a pair about that axis; empty for two single gyros.
std::string axis_name(const gateway::Plan& pair);
/// " about z", or nothing.
std::string about_axis(const gateway::Plan& pair);

/// "out/drift.svg" → "out/drift-z.svg"; the path itself without an axis.
std::string path_of_axis(const std::string& path, const std::string& axis);

}  // namespace vgyro::cli
