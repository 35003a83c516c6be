#include "gap/score.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

// A sample that a model calls impossible costs no more than this: the gap stays readable.
constexpr double kNatsMax = 50.0;
constexpr int kSimulations = 400;
constexpr double kStampResolution_s = 3e-6;
// A model without lost frames says that one in a million is lost.
constexpr double kLostFloor = 1e-6;

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
      if (counts(block, part)) sum.samples += block.count;
    }
  }
  return sum;
}

double transport_nats(const Study& study, const std::vector<Effect>& effects, Part part) {
  double nats = 0.0;
  const double share = part == Part::kAll ? 1.0 : part == Part::kHeldOut ? 0.25 : 0.75;
  for (const Finding& finding : study.findings()) {
    const std::size_t gyro = finding.effect.gyro;
    if (knows(effects, gyro, finding.effect.kind)) continue;
    const Transport& transport = study.transport(gyro);
    const double frames = static_cast<double>(transport.t_s.size());
    double cost = 0.0;
    switch (finding.effect.kind) {
      case Kind::kDroppedFrames:
        cost = frames * transport.lost_share * std::log(1.0 / kLostFloor);
        break;
      case Kind::kTimestampJitter:
        for (const double late_s : transport.late_s) {
          const double z = late_s / kStampResolution_s;
          cost += std::min(kNatsMax, 0.5 * z * z);
        }
        break;
      case Kind::kQuantization:
        // White noise of step²/12 is in the samples already; what a lattice saves is its own.
        break;
      case Kind::kSpikes:
        cost = finding.effect.parameters[0] * study.recording().seconds * kNatsMax;
        break;
      case Kind::kStuck:
        cost = (finding.effect.parameters[1] - finding.effect.parameters[0]) /
               transport.interval_s * 0.2 * kNatsMax;
        break;
      default: {
        double masked = 0.0;
        for (const std::uint8_t mask : transport.masked)
          masked += mask;
        cost = masked * 0.5 * kNatsMax;
        break;
      }
    }
    nats += share * cost;
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
      if (counts(block, part)) samples += block.count;
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
