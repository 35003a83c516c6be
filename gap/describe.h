#pragma once

// What gave an effect away, for people.

#include <vector>

#include "gap/result.h"
#include "gap/study.h"

namespace vgyro::gap {

/// Evidence, place and figure of every effect that the search has named.
void describe_effects(const Study& study, const std::vector<model::Effect>& before, Result& result);

}  // namespace vgyro::gap
