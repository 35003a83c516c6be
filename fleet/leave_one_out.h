#pragma once

// What random_effects() says of all units but one, for each unit in turn, in a time that grows with
// the number of units and not with its square.

#include <vector>

#include "fleet/statistics.h"

namespace vgyro::fleet {

/// Entry i: random_effects() of all units but i. Up to kDirectMost units to the bit, beyond that up
/// to rounding. Precondition: every sigma is above 0.
std::vector<RandomEffects> random_effects_of_others(const std::vector<Estimate>& units);

/// So few units are summed anew for each: that is as fast.
inline constexpr std::size_t kDirectMost = 64;

}  // namespace vgyro::fleet
