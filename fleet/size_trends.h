#pragma once

// How the sizes of shapes change over the months, for a type and each of its units.

#include <map>
#include <string>
#include <vector>

#include "fleet/judge.h"

namespace vgyro::fleet {

/// Sizes in Shape::unit, as in a pool's sums.
struct KnownSizes {
  std::map<std::string, std::vector<double>> of_type;  ///< of each shape; 0 if not named
  /// For each unit and shape, the variance of a score over its information.
  std::vector<std::vector<double>> dispersion;
};

/// `units`: all units of the type, with their own effects. Sets the trends of `type` and its
/// effects.
void judge_size_trends(const Pool& pool, const KnownSizes& known, double threshold,
                       std::vector<UnitJudgement>& units, TypeJudgement& type);

}  // namespace vgyro::fleet
