#pragma once

// Which shapes a system needs: the likeliest first, each against all others in its place, and none
// that falls below what a name needs once the others are there.

#include <cstddef>
#include <vector>

#include "fleet/system.h"

namespace vgyro::fleet {

struct Choice {
  std::vector<std::size_t> columns;
  std::vector<double> z;  ///< of each, beside the others
  std::vector<std::vector<std::size_t>> ambiguous_with;
};

/// `tests`: names that are looked for in all, of which at most `false_names` are to be false.
/// `begun`: columns that are there already, and are no names.
Choice choose(const System& system, const std::vector<std::size_t>& begun, double tests,
              double false_names);

}  // namespace vgyro::fleet
