#pragma once

// What the step between a gyro's values does to its noise figures. Rounding to a step Δ adds the
// variance Δ²/12 to noise that spans the step (Sheppard's correction). Noise well below the step
// comes out as anything: as nothing where the rate lies between two thresholds, many times too
// strong where it lies on one. Then there is no figure, only a bound.

#include <optional>

#include "analysis/noise_fit.h"
#include "analysis/series.h"

namespace vgyro::analysis {

/// The least change from one sample to the next, in the samples as they came.
class StepFinder {
 public:
  void add(double rate_dps);
  /// 0 where the values never changed.
  [[nodiscard]] double step_dps() const { return least_dps_; }

 private:
  bool any_ = false;
  double before_dps_ = 0.0;
  double least_dps_ = 0.0;
};

/// Standard deviation of single samples around the mean of a second, drift left out.
double sample_scatter_dps(const Series& series);

/// Below this share of the step a sample's own noise cannot be separated from its rounding.
inline constexpr double kHiddenShare = 0.5;

/// Whether the step hides the noise of these samples at rest.
bool step_hides_noise(const Series& series, double step_dps);

/// The fit of a gyro at rest, without what rounding added.
NoiseFit without_rounding(NoiseFit fit, double step_dps, double interval_s);

/// Where the step hides the noise: white noise, were it white up to the samples' rate, is below a
/// bound; drift that stays within a step is bounded by it. `fit`: of the rounded values, if any.
NoiseFit bounded_by_step(std::optional<NoiseFit> fit, double step_dps, const Series& series);

}  // namespace vgyro::analysis
