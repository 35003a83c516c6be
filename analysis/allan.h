#pragma once

// Overlapping Allan deviation of a rate at averaging times one octave apart, with bounds from the
// χ² distribution. Gaps: every term lies inside one part of the record. The equivalent degrees of
// freedom depend on the kind of noise that dominates at that averaging time (NIST SP 1065, table
// 5).

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "analysis/series.h"

namespace vgyro::analysis {

enum class NoiseKind : std::uint8_t { kQuantisation, kWhite, kFlicker, kWalk };

struct AllanPoint {
  double tau_s = 0.0;
  double deviation_dps = 0.0;
  double low_dps = 0.0;   ///< the true deviation lies between these
  double high_dps = 0.0;  ///< with probability kConfidence
  double freedom = 0.0;   ///< equivalent degrees of freedom
};

inline constexpr double kConfidence = 0.95;

/// `kind_at(tau_s)`: the kind of noise that dominates there. Averaging times reach a third of the
/// longest part.
std::vector<AllanPoint> allan_deviation(const Series& series,
                                        const std::function<NoiseKind(double)>& kind_at);

/// Equivalent degrees of freedom of n samples averaged m at a time.
double degrees_of_freedom(NoiseKind kind, std::size_t n, std::size_t m);

/// x with P(χ² ≤ x) = probability.
double chi_square_quantile(double probability, double freedom);

}  // namespace vgyro::analysis
