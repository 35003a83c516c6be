#include "simulation/gyro_chain.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "model/catalogue.h"
#include "model/flicker.h"

namespace vgyro::simulation {

namespace {

using model::Effect;
using model::Kind;
using model::Nature;

// The terms of flicker noise: their times are a factor of four apart, from less than a sample to
// days. Faster ones would only alias into white noise, which a sensor's filter prevents. The range
// is the same for every length of a recording, so that a longer one begins like a shorter one.
constexpr std::size_t kFlickerTerms = 15;
constexpr double kFlickerFrom = 0.4;  // in samples
constexpr double kFlickerSpan = 1e9;

bool is_random(const Effect& effect) {
  return model::info(effect.kind).nature == Nature::kNoise || effect.kind == Kind::kSpikes;
}

}  // namespace

GyroChain::GyroChain(std::span<const Effect> effects, double interval_s, std::uint64_t seed)
    : equation_(effects), interval_s_(interval_s) {
  assert(interval_s > 0.0);
  for (const Effect& effect : effects) {
    if (effect.kind == Kind::kStuck) stuck_.push_back(effect);
    if (!is_random(effect)) continue;
    const auto ordinal = std::count_if(randoms_.begin(), randoms_.end(), [&](const Random& other) {
      return other.effect.kind == effect.kind;
    });
    randoms_.push_back({effect,
                        NoiseSource(seed, kGyroSenders[effect.gyro], model::info(effect.kind).name,
                                    static_cast<std::uint32_t>(ordinal)),
                        0.0});
  }
}

// Exact from sample to sample, however far apart. A stationary process begins in its steady state;
// a walk begins at 0, because its initial value is a bias.
double GyroChain::noise_dps(Random& random, double late_dps, double since_s) {
  const model::Parameters& p = random.effect.parameters;
  switch (random.effect.kind) {
    case Kind::kWhiteNoise:
      return p[0] / std::sqrt(interval_s_) * random.source.normal();
    case Kind::kRateNoise:
      return p[0] * std::abs(late_dps) / std::sqrt(interval_s_) * random.source.normal();
    case Kind::kRateRandomWalk:
      random.state_dps += p[0] * std::sqrt(since_s) * random.source.normal();
      return random.state_dps;
    case Kind::kGaussMarkov:
      random.state_dps = correlated_dps(random.source, random.state_dps, p[0], p[1], since_s);
      return random.state_dps;
    case Kind::kBiasInstability:
      return flicker_dps(random, since_s);
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

double GyroChain::correlated_dps(NoiseSource& source, double before_dps, double sigma_dps,
                                 double tau_s, double since_s) const {
  const double keep = begun_ ? std::exp(-since_s / tau_s) : 0.0;
  return keep * before_dps + sigma_dps * std::sqrt(1.0 - keep * keep) * source.normal();
}

double GyroChain::flicker_dps(Random& random, double since_s) const {
  random.flicker_dps.resize(kFlickerTerms);
  const double from_s = kFlickerFrom * interval_s_;
  double sum_dps = 0.0;
  for (std::size_t i = 0; i < kFlickerTerms; ++i) {
    const model::FlickerTerm term = model::flicker_term(
        random.effect.parameters[0], i, kFlickerTerms, from_s, kFlickerSpan * from_s);
    double& state_dps = random.flicker_dps[i];
    state_dps = correlated_dps(random.source, state_dps, term.sigma_dps, term.tau_s, since_s);
    sum_dps += state_dps;
  }
  return sum_dps;
}

double GyroChain::next(double late_dps, const model::Surroundings& surroundings) {
  const double since_s = begun_ ? surroundings.t_s - last_s_ : 0.0;
  double reading_dps = equation_.reading_dps(late_dps, surroundings);
  for (Random& random : randoms_)
    reading_dps += noise_dps(random, late_dps, since_s);
  reading_dps = equation_.clipped_dps(reading_dps);
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
