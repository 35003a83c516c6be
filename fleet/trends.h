#pragma once

// How a quantity of each unit moves over the months: whether all units of a type move alike, and
// which unit moves otherwise. Scatter that drives do not explain (a bias that wanders over weeks
// looks like a trend) counts as a difference between units, and hides no more than it has to.

#include <cstddef>
#include <vector>

#include "fleet/statistics.h"

namespace vgyro::fleet {

/// A unit's change a year.
struct UnitSlope {
  std::size_t unit = 0;  ///< its place in the caller's list
  Estimate per_year;
  double freedom = 0.0;  ///< of its sigma's t
};

struct SlopeApart {
  UnitSlope unit;
  double type_per_year = 0.0;  ///< of all other units; 0 where they are too few to compare with
};

struct SlopesJudgement {
  RandomEffects type;
  bool is_named = false;  ///< the type moves
  bool varies = false;    ///< units move, each its own way
  std::vector<SlopeApart> apart;
};

/// `threshold`: of a p-value. Of fewer than kTrendUnitsMin units each is judged against no change.
SlopesJudgement judge_slopes(const std::vector<UnitSlope>& slopes, double threshold);

inline constexpr std::size_t kTrendUnitsMin = 5;
/// Fewer drives tell no trend of a unit.
inline constexpr double kTrendDrivesMin = 6.0;

}  // namespace vgyro::fleet
