#pragma once

// Effect of the step between a gyro's values on its noise figures. Rounding to a step Δ adds the
// variance Δ²/12 to noise that spans the step (Sheppard's correction). Noise well below the step
// gives arbitrary figures: zero where the rate lies between two thresholds, many times too strong
// where it lies on one. Then only a bound is reported.

#include <optional>

#include "analysis/noise_fit.h"
#include "analysis/series.h"

namespace vgyro::analysis {

/// Finds the least change from one received sample to the next.
class StepFinder {
 public:
  void add(double rate_dps);
  /// 0 if the values never changed.
  [[nodiscard]] double step_dps() const { return least_dps_; }

 private:
  bool any_ = false;
  double before_dps_ = 0.0;
  double least_dps_ = 0.0;
};

/// Standard deviation of single samples around the mean of a second, without drift.
double sample_scatter_dps(const Series& series);

/// Below this share of the step a sample's own noise cannot be separated from its rounding.
inline constexpr double kHiddenShare = 0.5;

/// Does the step hide the noise of these samples at rest?
bool step_hides_noise(const Series& series, double step_dps);

/// The fit of a gyro at rest, less the noise that rounding added.
NoiseFit without_rounding(NoiseFit fit, double step_dps, double interval_s);

/// For noise that the step hides: white noise, if white up to the sampling rate, is below a bound;
/// drift that stays within a step is bounded by the step. `fit`: of the rounded values, if any.
NoiseFit bounded_by_step(std::optional<NoiseFit> fit, double step_dps, const Series& series);

}  // namespace vgyro::analysis
