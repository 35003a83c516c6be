#pragma once

// How a quantity of each unit moves over the months: whether all units of a type move alike, and
// which unit moves differently. Scatter that the drives do not explain counts as a spread between
// units: a bias that wanders over weeks looks like a trend. It hides no more trends than it has to.

#include <cstddef>
#include <vector>

#include "fleet/statistics.h"

namespace vgyro::fleet {

/// A unit's change per year.
struct UnitSlope {
  std::size_t unit = 0;  ///< index in the caller's list
  Estimate per_year;
  double freedom = 0.0;  ///< degrees of freedom of its t
};

struct SlopeApart {
  UnitSlope unit;
  double type_per_year = 0.0;  ///< of all other units; 0 if they are too few
};

struct SlopesJudgement {
  RandomEffects type;
  bool is_named = false;  ///< the type moves
  bool varies = false;    ///< each unit moves its own way
  std::vector<SlopeApart> apart;
};

/// `threshold`: greatest p-value of a name. Fewer than kTrendUnitsMin units are each judged against
/// no change.
SlopesJudgement judge_slopes(const std::vector<UnitSlope>& slopes, double threshold);

inline constexpr std::size_t kTrendUnitsMin = 5;
/// A unit with fewer drives has no trend.
inline constexpr double kTrendDrivesMin = 6.0;

}  // namespace vgyro::fleet
