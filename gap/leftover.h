#pragma once

// What is still not white when the search has ended: said, not named. Also takes names back that
// the leftovers show to be wrong.

#include <vector>

#include "gap/result.h"
#include "gap/search.h"
#include "gap/study.h"

namespace vgyro::gap {

/// `found` may lose effects.
std::vector<Unexplained> leftovers(const Search& search, std::vector<Found>& found);

/// Takes back, one after the other, the names without which the samples that were set aside are as
/// likely. `others`: all effects that stay.
std::vector<Unexplained> unproven(const Study& study, const Effects& others,
                                  std::vector<Found>& found);

}  // namespace vgyro::gap
