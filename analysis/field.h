#pragma once

// Could the bits of a stretch of bytes be one quantity that moves as a rate of rotation does:
// often, in small steps, to and fro? And do its bytes belong together: where a higher part goes up
// by one, the lower part must restart. Bytes of two quantities are independent.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vgyro::analysis {

struct FieldFigures {
  double range = 0.0;      ///< from the lowest to the highest value
  double step = 0.0;       ///< rms of the steps from sample to sample
  double leap = 0.0;       ///< the largest step
  double one_way = 0.0;    ///< share of the steps that go the usual way: 1 for what only counts
  std::size_t values = 0;  ///< different ones, at most kValuesCounted
};
constexpr std::size_t kValuesCounted = 256;
FieldFigures field_figures(const std::vector<double>& values);

/// To and fro, in steps that are small against the range, and never across nearly all of it.
bool moves_as_a_rate(const FieldFigures& figures);

/// Do the lowest `bits` of these numbers restart where the rest changes? Nothing follows
/// (false) where the rest never changes.
bool carries_into(const std::vector<std::int64_t>& raw, unsigned bits);

}  // namespace vgyro::analysis
