#pragma once

// Could the bits of a stretch of bytes be one quantity that moves like a rate of rotation: often,
// in small steps, to and fro? And do its bytes belong together: when the upper part increases by
// one, the lower part must restart. Bytes of two quantities are independent.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vgyro::analysis {

struct FieldFigures {
  double range = 0.0;      ///< from the lowest to the highest value
  double step = 0.0;       ///< rms of the steps from sample to sample
  double leap = 0.0;       ///< the largest step
  double one_way = 0.0;    ///< share of the steps in the usual direction: 1 for a counter
  std::size_t values = 0;  ///< different values, at most kValuesCounted
};
constexpr std::size_t kValuesCounted = 256;
FieldFigures field_figures(const std::vector<double>& values);

/// To and fro, in steps that are small against the range, and never across nearly all of it.
bool moves_as_a_rate(const FieldFigures& figures);

/// Do the lowest `bits` of these numbers restart where the rest changes? False also where the rest
/// never changes, which shows nothing.
bool carries_into(const std::vector<std::int64_t>& raw, unsigned bits);

}  // namespace vgyro::analysis
