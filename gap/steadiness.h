#pragma once

// What is in the catalogue keeps its size throughout a recording; what only resembles it does not.

#include <array>
#include <cstddef>
#include <vector>

#include "gap/found.h"
#include "gap/regression.h"

namespace vgyro::gap {

/// How much better a term fits with a size of its own in each part of the recording.
struct Change {
  double statistic = 0.0;
  double freedom = 0.0;  ///< degrees of freedom of the statistic
  /// Beyond what chance brings, and more than the arithmetic of great effects leaves.
  [[nodiscard]] bool is_beyond_chance(double statistic_of_term) const;
};
Change change_over_time(const Regression& regression, const Effects& terms, std::size_t index,
                        const PairNoise& noise);

/// A handful of steps or lines on one gyro, or two steps that cancel, is a shape that comes and
/// goes. True for each of `found` that is a part of such.
std::vector<bool> pieces_of_something_else(const std::vector<Found>& found);

}  // namespace vgyro::gap
