#include "gap/score.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

constexpr int kSimulations = 400;

bool knows(const std::vector<Effect>& effects, std::size_t gyro, Kind kind) {
  return std::any_of(effects.begin(), effects.end(), [&](const Effect& effect) {
    return effect.gyro == gyro && effect.kind == kind;
  });
}

}  // namespace

Likelihood observed(const Study& study, const std::vector<Effect>& effects, Part part) {
  Likelihood sum;
  const PairNoise noise = noise_of(effects);
  for (const auto& data : study.observations()) {
    const Eigen::VectorXd residual = data->residual(effects);
    sum.nats -= log_likelihood(residual, data->layout, noise, part);
    for (const Block& block : data->layout.blocks) {
      if (counts(block, part)) sum.samples += dimensions(block);
    }
  }
  return sum;
}

double transport_nats(const Study& study, const std::vector<Effect>& effects, Part part) {
  double nats = 0.0;
  const double share = part == Part::kAll ? 1.0 : part == Part::kHeldOut ? 0.25 : 0.75;
  for (const Finding& finding : study.findings()) {
    if (knows(effects, finding.effect.gyro, finding.effect.kind)) continue;
    nats += share * finding.cost_nats;
  }
  return nats;
}

Floor simulate_floor(const Study& study, const std::vector<Effect>& effects, Part part,
                     std::uint64_t seed) {
  const PairNoise noise = noise_of(effects);
  double nats = 0.0;
  double samples = 0.0;
  for (const auto& data : study.observations()) {
    // Of a residual of zeros only the determinants are left.
    const Eigen::VectorXd nothing = Eigen::VectorXd::Zero(data->size());
    nats -= log_likelihood(nothing, data->layout, noise, part);
    for (const Block& block : data->layout.blocks) {
      if (counts(block, part)) samples += dimensions(block);
    }
  }
  std::mt19937_64 random(seed);
  std::gamma_distribution<double> half_chi_square(0.5 * samples, 1.0);
  std::vector<double> scores(kSimulations);
  double mean = 0.0;
  for (double& score : scores) {
    score = half_chi_square(random) / samples;
    mean += score / kSimulations;
  }
  std::sort(scores.begin(), scores.end());
  Floor floor;
  floor.nats_per_sample = nats / samples + 0.5;
  const auto at = [&](double share) {
    return scores[static_cast<std::size_t>(share * (kSimulations - 1))] - mean;
  };
  floor.band95 = {at(0.025), at(0.975)};
  return floor;
}

double gap_of(const Study& study, const std::vector<Effect>& effects, const Floor& floor,
              Part part) {
  const Likelihood likelihood = observed(study, effects, part);
  return (likelihood.nats + transport_nats(study, effects, part)) / likelihood.samples -
         floor.nats_per_sample;
}

}  // namespace vgyro::gap
