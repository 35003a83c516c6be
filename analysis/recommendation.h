#pragma once

// Window and order for the corrector, from the noise of the pair's difference. The result of a
// window is used over the next one, one window later. Its error is white noise, which a longer
// window averages, and the drift in between, which grows with the window.

#include "analysis/noise_fit.h"

namespace vgyro::analysis {

struct Recommendation {
  double window_s = 10.0;
  int order = 0;
  double error_dps = 0.0;    ///< expected error of the difference of the drifts, 1 σ
  bool drift_known = false;  ///< a walk or a ramp was resolved; else the bound on the walk decides
  bool ramp_significant = false;
  bool record_limits = false;  ///< a longer record might allow a longer window
};

inline constexpr double kRampSigmas = 4.0;

/// `seconds`: of the record. No window longer than a quarter of that is recommended.
Recommendation recommend(const NoiseFit& difference, double seconds);

/// Variance of the drift predicted by windows of this length and order (0 or 1).
double prediction_variance(const NoiseFit& difference, double walk_dps_rts, double ramp_dps_s,
                           double window_s, int order);

}  // namespace vgyro::analysis
