#pragma once

// random_effects() of all units but one, for each unit in turn, in time that grows with the number
// of units, not its square.

#include <vector>

#include "fleet/statistics.h"

namespace vgyro::fleet {

/// Entry i: random_effects() of all units but i; bit for bit up to kDirectMost units, beyond that
/// up to rounding. Precondition: every sigma is above 0.
std::vector<RandomEffects> random_effects_of_others(const std::vector<Estimate>& units);

/// Up to this many units, the others are summed anew for each unit, which is as fast.
inline constexpr std::size_t kDirectMost = 64;

}  // namespace vgyro::fleet
