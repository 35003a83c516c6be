#include "analysis/resolution.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace vgyro::analysis {

namespace {

// A difference from rounding in the decoder is not a step.
constexpr double kDecodedRounding = 1e-9;
constexpr double kRoundingShare = 1.0 / 12.0;
constexpr double kBlock_s = 1.0;
constexpr std::size_t kBlockSamplesMin = 16;
// Scatter of half a step is wrong by a hundredth at most, wherever the rate lies between
// thresholds; the rest allows for chance.
constexpr double kBoundShare = 0.55;

// A term is below `least`, at which a drift would have crossed a step in the record.
Estimate bounded(const Estimate& found, double least) {
  if (found.resolved && found.value >= least) return found;
  return {.below = std::max({least, found.below, found.value + 2.0 * found.sigma})};
}

}  // namespace

void StepFinder::add(double rate_dps) {
  const double change_dps = std::abs(rate_dps - before_dps_);
  const bool changed = any_ && change_dps > kDecodedRounding * (1.0 + std::abs(rate_dps));
  if (changed && (least_dps_ == 0.0 || change_dps < least_dps_)) least_dps_ = change_dps;
  before_dps_ = rate_dps;
  any_ = true;
}

double sample_scatter_dps(const Series& series) {
  const std::size_t block =
      std::max(kBlockSamplesMin, static_cast<std::size_t>(kBlock_s / series.interval_s));
  double squares = 0.0;
  double freedom = 0.0;
  for (const Part& part : series.parts) {
    const std::span<const double> rate_dps = part.rate_dps;
    for (std::size_t begin = 0; begin + block <= rate_dps.size(); begin += block) {
      const auto here = rate_dps.subspan(begin, block);
      double mean = 0.0;
      for (const double rate : here)
        mean += rate / static_cast<double>(block);
      for (const double rate : here)
        squares += (rate - mean) * (rate - mean);
      freedom += static_cast<double>(block - 1);
    }
  }
  return freedom > 0.0 ? std::sqrt(squares / freedom) : 0.0;
}

bool step_hides_noise(const Series& series, double step_dps) {
  if (step_dps <= 0.0) return false;
  const double scatter = sample_scatter_dps(series) / step_dps;
  return scatter * scatter - kRoundingShare < kHiddenShare * kHiddenShare;
}

NoiseFit without_rounding(NoiseFit fit, double step_dps, double interval_s) {
  Estimate& white = fit.white_dps_rthz;
  const double own = white.value * white.value - kRoundingShare * step_dps * step_dps * interval_s;
  if (!white.resolved || own <= 0.0) return fit;
  const double value = std::sqrt(own);
  white.sigma *= white.value / value;
  white.value = value;
  return fit;
}

NoiseFit bounded_by_step(std::optional<NoiseFit> fit, double step_dps, const Series& series) {
  NoiseFit result = fit.value_or(NoiseFit{});
  const double seconds = series.seconds();
  result.white_dps_rthz = {.below = kBoundShare * step_dps * std::sqrt(series.interval_s)};
  result.walk_dps_rts = bounded(result.walk_dps_rts, step_dps / std::sqrt(seconds));
  result.flicker_dps = bounded(result.flicker_dps, step_dps);
  result.quantisation_deg = {};
  result.markov.reset();
  const double slope = step_dps / seconds;
  if (std::abs(result.ramp_dps_s) < slope) result.ramp_dps_s = 0.0;
  result.ramp_sigma_dps_s = std::max(result.ramp_sigma_dps_s, slope);
  return result;
}

}  // namespace vgyro::analysis
