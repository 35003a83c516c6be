#include "analysis/recommendation.h"

#include <array>
#include <cmath>

namespace vgyro::analysis {

namespace {

constexpr std::array<double, 11> kWindows_s{1.0,  2.0,  5.0,   10.0,  15.0, 20.0,
                                            30.0, 60.0, 120.0, 300.0, 600.0};
constexpr double kShareOfRecord = 0.25;
// The shortest window is chosen whose error is within this factor of the least: a short window also
// follows changes that no noise figure covers, such as a temperature that changes.
constexpr double kGoodEnough = 1.1;

// Error of the mean over the next window from a walk, in units of K²·T: this window's mean is held
// (order 0), or its line is continued (order 1).
constexpr std::array<double, 2> kWalkGain{2.0 / 3.0, 13.0 / 15.0};
// Error from white noise, in units of the variance of a window's mean: √13 times the σ for the
// line, one window later.
constexpr std::array<double, 2> kWhiteGain{1.0, 13.0};

}  // namespace

double prediction_variance(const NoiseFit& difference, double walk_dps_rts, double ramp_dps_s,
                           double window_s, int order) {
  const auto i = static_cast<std::size_t>(order);
  const double white = difference.white_dps_rthz.value;
  const double angle = difference.quantisation_deg.value / window_s;
  const double missed_dps = order == 0 ? ramp_dps_s * window_s : 0.0;
  return kWhiteGain[i] * (white * white / window_s + 2.0 * angle * angle) +
         2.0 * difference.variance(NoiseKind::kFlicker, window_s) +
         kWalkGain[i] * walk_dps_rts * walk_dps_rts * window_s + missed_dps * missed_dps;
}

Recommendation recommend(const NoiseFit& difference, double seconds) {
  Recommendation best;
  best.ramp_significant = difference.ramp_significance() > kRampSigmas;
  const double ramp_dps_s = best.ramp_significant ? difference.ramp_dps_s : 0.0;
  best.drift_known = difference.walk_dps_rts.resolved || difference.markov || best.ramp_significant;
  // Drift whose correlation time is longer than a window is a walk within it.
  const double bound =
      difference.markov ? difference.markov->walk_dps_rts() : difference.walk_dps_rts.below;
  const double walk = difference.walk_dps_rts.resolved ? difference.walk_dps_rts.value : bound;
  std::array<double, 2> least{};
  std::array<double, 2> window_s{kWindows_s[0], kWindows_s[0]};
  const auto error = [&](double of_s, std::size_t order) {
    return std::sqrt(
        prediction_variance(difference, walk, ramp_dps_s, of_s, static_cast<int>(order)));
  };
  const auto allowed = [&](double of_s) {
    return of_s == kWindows_s[0] || of_s <= kShareOfRecord * seconds;
  };
  for (std::size_t order = 0; order < 2; ++order) {
    least[order] = error(kWindows_s[0], order);
    for (const double of_s : kWindows_s)
      if (allowed(of_s)) least[order] = std::min(least[order], error(of_s, order));
    for (const double of_s : kWindows_s) {
      window_s[order] = of_s;
      if (error(of_s, order) <= kGoodEnough * least[order]) break;
    }
  }
  // Order 1 only if the ramp is significant and the error smaller.
  const std::size_t order = best.ramp_significant && least[1] < least[0] ? 1 : 0;
  best.order = static_cast<int>(order);
  best.window_s = window_s[order];
  best.error_dps = error(best.window_s, order);
  for (const double of_s : kWindows_s) {
    if (!allowed(of_s) && error(of_s, order) < least[order] / kGoodEnough)
      best.record_limits = true;
  }
  return best;
}

}  // namespace vgyro::analysis
