#pragma once

// How the sizes of shapes change over the months, of a type and of each unit of it.

#include <map>
#include <string>
#include <vector>

#include "fleet/judge.h"

namespace vgyro::fleet {

/// In 1/Shape::unit, as a pool's sums are.
struct KnownSizes {
  std::map<std::string, std::vector<double>> of_type;  ///< of each shape; 0 where it has no name
  /// Of each unit and shape: variance of a score over its information.
  std::vector<std::vector<double>> dispersion;
};

/// `units`: all of a type, with their own effects. Sets the trends of `type` and of its effects.
void judge_size_trends(const Pool& pool, const KnownSizes& known, double threshold,
                       std::vector<UnitJudgement>& units, TypeJudgement& type);

}  // namespace vgyro::fleet
