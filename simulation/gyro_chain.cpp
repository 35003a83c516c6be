#include "simulation/gyro_chain.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "model/catalogue.h"

namespace vgyro::simulation {

namespace {

using model::Effect;
using model::Kind;
using model::Nature;

bool is_random(const Effect& effect) {
  return model::info(effect.kind).nature == Nature::kNoise || effect.kind == Kind::kSpikes;
}

}  // namespace

GyroChain::GyroChain(std::span<const Effect> effects, double interval_s, std::uint64_t seed)
    : interval_s_(interval_s) {
  assert(interval_s > 0.0);
  for (const Effect& effect : effects) {
    const Nature nature = model::info(effect.kind).nature;
    if (nature == Nature::kOffset || nature == Nature::kResponse) added_.push_back(effect);
    if (nature == Nature::kClip) clips_.push_back(effect);
    if (effect.kind == Kind::kStuck) stuck_.push_back(effect);
    if (!is_random(effect)) continue;
    const auto ordinal = std::count_if(randoms_.begin(), randoms_.end(), [&](const Random& other) {
      return other.effect.kind == effect.kind;
    });
    randoms_.push_back(
        {effect,
         NoiseSource(seed, static_cast<std::uint32_t>(effect.gyro),
                     static_cast<std::uint32_t>(effect.kind), static_cast<std::uint32_t>(ordinal)),
         0.0});
  }
  // Saturation, dead band, quantisation: the order of Kind.
  std::stable_sort(clips_.begin(), clips_.end(),
                   [](const Effect& a, const Effect& b) { return a.kind < b.kind; });
}

// Exact between samples, however far apart. A stationary process begins as it goes on; a walk
// begins at 0, because where it begins is a bias.
double GyroChain::noise_dps(Random& random, double sensed_dps, double since_s) {
  const model::Parameters& p = random.effect.parameters;
  switch (random.effect.kind) {
    case Kind::kWhiteNoise:
      return p[0] / std::sqrt(interval_s_) * random.source.normal();
    case Kind::kRateNoise:
      return p[0] * std::abs(sensed_dps) / std::sqrt(interval_s_) * random.source.normal();
    case Kind::kRateRandomWalk:
      random.state_dps += p[0] * std::sqrt(since_s) * random.source.normal();
      return random.state_dps;
    case Kind::kGaussMarkov: {
      const double keep = begun_ ? std::exp(-since_s / p[1]) : 0.0;
      random.state_dps =
          keep * random.state_dps + p[0] * std::sqrt(1.0 - keep * keep) * random.source.normal();
      return random.state_dps;
    }
    case Kind::kSpikes: {
      const bool hit = random.source.uniform() < -std::expm1(-p[0] * interval_s_);
      const double sign = random.source.uniform() < 0.5 ? -1.0 : 1.0;
      return hit ? sign * p[1] : 0.0;
    }
    default:
      assert(!is_random(random.effect));
      return 0.0;
  }
}

double GyroChain::clip(double reading_dps) const {
  for (const Effect& effect : clips_)
    reading_dps = model::clipped_dps(effect, reading_dps);
  return reading_dps;
}

double GyroChain::next(double sensed_dps, const model::Surroundings& surroundings) {
  const double since_s = begun_ ? surroundings.t_s - last_s_ : 0.0;
  double reading_dps = sensed_dps;
  for (const Effect& effect : added_)
    reading_dps += model::added_dps(effect, sensed_dps, surroundings);
  for (Random& random : randoms_)
    reading_dps += noise_dps(random, sensed_dps, since_s);
  reading_dps = clip(reading_dps);
  const bool frozen =
      begun_ && std::any_of(stuck_.begin(), stuck_.end(), [&](const Effect& stuck) {
        return surroundings.t_s >= stuck.parameters[0] && surroundings.t_s < stuck.parameters[1];
      });
  if (!frozen) last_reading_dps_ = reading_dps;
  last_s_ = surroundings.t_s;
  begun_ = true;
  return last_reading_dps_;
}

}  // namespace vgyro::simulation
