#pragma once

// Where a model and a recording differ.

#include <vector>

#include "gap/result.h"
#include "gap/study.h"

namespace vgyro::gap {

/// Largest first.
std::vector<Difference> differences(const Study& study, const std::vector<model::Effect>& effects);

}  // namespace vgyro::gap
