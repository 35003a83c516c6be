#pragma once

// What a recording cannot show, and what would.

#include <string>
#include <vector>

#include "gap/result.h"
#include "gap/study.h"

namespace vgyro::gap {

/// Kinds that this recording cannot show, with the reason.
std::vector<NotIdentifiable> not_identifiable(const Study& study);

/// What would tell two readings apart.
std::string experiment_for(const Reading& first, const Reading& second, bool with_reference);

}  // namespace vgyro::gap
