#pragma once

// Offline commands look at pairs of gyros: the two of the configuration, or, of two whole units,
// the pair about each axis of the vehicle. Each unit's readings are those of the sensor axis that
// lies along it, so a unit's mount may exchange and flip axes, and no more.

#include <string>
#include <vector>

#include "base/error.h"
#include "gateway/plan.h"

namespace vgyro::cli {

/// The pairs that are to be looked at: one of two single gyros. `axis`: "x", "y" or "z" of whole
/// units; empty: each of them. Of a unit's pair the gyros' other axes are named where one message
/// carries them. Error at `config` where it has no such axis, or a mount that tilts.
Expected<std::vector<gateway::Plan>> chosen_pairs(const std::string& config,
                                                  const gateway::Plan& plan,
                                                  const std::string& axis);

/// "z" of a pair about that axis; empty of two single gyros.
std::string axis_name(const gateway::Plan& pair);
/// " about z", or nothing.
std::string about_axis(const gateway::Plan& pair);

/// "out/drift.svg" → "out/drift-z.svg"; the path itself where there is no axis.
std::string path_of_axis(const std::string& path, const std::string& axis);

}  // namespace vgyro::cli
