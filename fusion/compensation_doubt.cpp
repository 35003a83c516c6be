#include "fusion/compensation_doubt.h"

#include <algorithm>
#include <cmath>

#include "model/catalogue.h"

namespace vgyro::fusion {

namespace {

// A response that is flatter than this has no inverse, and Compensation does not correct it.
constexpr double kSlopeMin = 0.05;

bool is_taken_back(model::Kind kind) {
  const model::Nature nature = model::info(kind).nature;
  return nature == model::Nature::kOffset || nature == model::Nature::kResponse;
}

// The effect with this parameter changed by `by`, within its limits.
model::Effect moved(model::Effect effect, std::size_t parameter, double by) {
  effect.parameters[parameter] = model::within_limits(
      model::info(effect.kind).parameters[parameter], effect.parameters[parameter] + by);
  return effect;
}

}  // namespace

CompensationDoubt::CompensationDoubt(std::span<const model::Effect> effects) : equation_(effects) {
  for (const model::Effect& effect : effects) {
    if (!is_taken_back(effect.kind)) continue;
    const bool is_held = effect.kind != model::Kind::kLine;
    if (effect.ambiguous) {
      terms_.push_back({.high = effect, .low = effect, .is_common = true, .is_held = is_held});
    }
    for (std::size_t i = 0; i < effect.sigma.size(); ++i) {
      const double sigma = effect.sigma[i];
      if (sigma == 0.0) continue;
      terms_.push_back(
          {.high = moved(effect, i, sigma), .low = moved(effect, i, -sigma), .is_held = is_held});
    }
  }
}

double CompensationDoubt::value_dps(const Term& term, double rate_dps,
                                    const model::Surroundings& surroundings) {
  const double high_dps = model::added_dps(term.high, rate_dps, surroundings);
  if (term.is_common) return high_dps;
  return 0.5 * (high_dps - model::added_dps(term.low, rate_dps, surroundings));
}

void CompensationDoubt::settle(const model::Surroundings& surroundings) {
  for (Term& term : terms_) {
    if (term.is_held) term.settled_dps = value_dps(term, 0.0, surroundings);
  }
}

CompensationDoubt::Sigma CompensationDoubt::at(double rate_dps,
                                               const model::Surroundings& surroundings) const {
  double own = 0.0;
  double common = 0.0;
  for (const Term& term : terms_) {
    const double since_dps = value_dps(term, rate_dps, surroundings) - term.settled_dps;
    (term.is_common ? common : own) += since_dps * since_dps;
  }
  const double slope = std::max(equation_.slope(rate_dps, surroundings), kSlopeMin);
  return {std::sqrt(own) / slope, std::sqrt(common) / slope};
}

}  // namespace vgyro::fusion
