#pragma once

// Chooses the shapes that a system needs: adds the likeliest first, tries all others in the place
// of each, and drops those that fall below the threshold of a name once the others are fitted.

#include <cstddef>
#include <vector>

#include "fleet/system.h"

namespace vgyro::fleet {

struct Choice {
  std::vector<std::size_t> columns;
  std::vector<double> z;  ///< of each, with the others fitted
  std::vector<std::vector<std::size_t>> ambiguous_with;
};

/// `tests`: number of names that could be found in all; `false_names`: greatest share of false ones
/// among those found. `begun`: columns that are fitted already and are no names.
Choice choose(const System& system, const std::vector<std::size_t>& begun, double tests,
              double false_names);

}  // namespace vgyro::fleet
