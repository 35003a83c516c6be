#include "simulation/readings.h"

#include <fmt/core.h>

#include "simulation/curve.h"
#include "simulation/gyro_chain.h"
#include "simulation/low_pass.h"

namespace vgyro::simulation {

Expected<Lags> lags_of(std::span<const model::Effect> effects) {
  Lags lags;
  for (const model::Effect& effect : effects) {
    if (effect.kind == model::Kind::kDelay) lags.delay_s += effect.parameters[0];
    if (effect.kind == model::Kind::kBandwidth) lags.cutoffs_hz.push_back(effect.parameters[0]);
  }
  if (lags.cutoffs_hz.size() > LowPass::kStagesMax) {
    return fail("the model",
                fmt::format("a gyro has {} effects of kind bandwidth", lags.cutoffs_hz.size()),
                fmt::format("at most {}", LowPass::kStagesMax));
  }
  return lags;
}

Expected<std::vector<double>> readings(std::span<const model::Effect> effects,
                                       std::span<const Instant> instants, double interval_s,
                                       std::uint64_t seed) {
  const auto lags = lags_of(effects);
  if (!lags) return tl::unexpected(lags.error());
  std::vector<double> result;
  if (instants.empty()) return result;
  const bool lagging = lags->delay_s != 0.0 || !lags->cutoffs_hz.empty();
  std::vector<double> times_s;
  std::vector<double> rates_dps;
  for (const Instant& instant : instants) {
    if (!lagging) break;
    times_s.push_back(instant.surroundings.t_s);
    rates_dps.push_back(instant.rate_dps);
  }
  const Curve curve = lagging ? Curve(times_s, rates_dps) : Curve();
  LowPass low_pass(curve, lags->cutoffs_hz);
  GyroChain chain(effects, interval_s, seed);
  result.reserve(instants.size());
  for (const Instant& instant : instants) {
    const double sensed_dps =
        lagging ? low_pass.at(instant.surroundings.t_s - lags->delay_s) : instant.rate_dps;
    result.push_back(chain.next(sensed_dps, instant.surroundings));
  }
  return result;
}

}  // namespace vgyro::simulation
