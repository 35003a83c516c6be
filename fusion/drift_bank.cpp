#include "fusion/drift_bank.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vgyro::fusion {

namespace {

// Where nothing says otherwise K is N times 2e-2 per second, give or take a factor of five: the
// span from good fibre-optic gyros to cheap MEMS.
constexpr double kUsualRatioLog10 = -1.7;
constexpr double kRatioSpreadLog10 = 0.7;

// Drift that a sensor takes on between two runs, in units of N over √(1 s), and how long it must
// have been off for that.
constexpr double kRunToRunWhite = 3.0;
constexpr double kRunToRunAge_s = 60.0;

double log_prior(double ratio_per_s) {
  const double away = (std::log10(ratio_per_s) - kUsualRatioLog10) / kRatioSpreadLog10;
  return -0.5 * away * away;
}

DriftFilter::Covariance doubt_of(const Symmetric& biases, double scale_sigma, double skew_sigma_s) {
  DriftFilter::Covariance covariance = DriftFilter::Covariance::Zero();
  covariance(kBias1, kBias1) = biases[0];
  covariance(kBias1, kBias2) = covariance(kBias2, kBias1) = biases[1];
  covariance(kBias2, kBias2) = biases[2];
  covariance(kScale, kScale) = squared(scale_sigma);
  covariance(kSkew, kSkew) = squared(skew_sigma_s);
  return covariance;
}

struct WalkChoice {
  double walk_dps_rts = 0.0;
  double log_weight = 0.0;
  std::size_t place = 0;
};

}  // namespace

DriftBank::DriftBank(const std::array<GyroParameters, 2>& gyros) : gyros_(gyros) {
  hypotheses_.reserve(kWalkPairs);
}

void DriftBank::make(const std::array<double, 2>& white_dps_rthz,
                     const DriftFilter::Observables& mean,
                     const DriftFilter::Covariance& covariance) {
  hypotheses_.clear();
  const std::size_t ratios = kWalkRatios_per_s.size();
  const auto choice = [&](std::size_t gyro, std::size_t i) -> WalkChoice {
    if (gyros_[gyro].walk_dps_rts) return {*gyros_[gyro].walk_dps_rts, 0.0, 0};
    return {kWalkRatios_per_s[i] * white_dps_rthz[gyro], log_prior(kWalkRatios_per_s[i]), i};
  };
  const std::size_t first_choices = gyros_[0].walk_dps_rts ? 1 : ratios;
  const std::size_t second_choices = gyros_[1].walk_dps_rts ? 1 : ratios;
  DriftModel model;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    model.gauss_markov[gyro] = gyros_[gyro].gauss_markov;
    model.gauss_markov_count[gyro] = gyros_[gyro].gauss_markov_count;
  }
  for (std::size_t i = 0; i < first_choices; ++i) {
    for (std::size_t j = 0; j < second_choices; ++j) {
      const WalkChoice first = choice(0, i);
      const WalkChoice second = choice(1, j);
      model.walk_dps_rts = {first.walk_dps_rts, second.walk_dps_rts};
      const double log_weight = first.log_weight + second.log_weight;
      DriftFilter filter(model, mean, covariance);
      const auto growth = filter.growth_per_s();
      const double quality_1 = white_dps_rthz[0] * std::sqrt(growth[0]);
      const double quality_2 = white_dps_rthz[1] * std::sqrt(growth[1]);
      const double scale_share =
          quality_1 + quality_2 > 0.0 ? quality_1 / (quality_1 + quality_2) : 0.5;
      hypotheses_.push_back({std::move(filter), scale_share, log_weight, log_weight,
                             first.place * ratios + second.place});
    }
  }
  normalize();
}

void DriftBank::begin(const std::array<double, 2>& white_dps_rthz,
                      const std::array<double, 2>& bias_dps, const Symmetric& covariance) {
  DriftFilter::Observables mean = DriftFilter::Observables::Zero();
  mean(kBias1) = bias_dps[0];
  mean(kBias2) = bias_dps[1];
  make(white_dps_rthz, mean, doubt_of(covariance, kScaleSigma, kSkewSigma_s));
}

void DriftBank::resume(const DriftMemory& memory, double age_s) {
  const std::array<double, 2> white{std::sqrt(memory.white_density[0]),
                                    std::sqrt(memory.white_density[2])};
  DriftFilter::Observables mean = DriftFilter::Observables::Zero();
  mean << memory.bias_dps[0], memory.bias_dps[1], memory.scale_difference, memory.skew_s;
  make(white, mean,
       doubt_of(memory.bias_covariance, memory.scale_difference_sigma, memory.skew_sigma_s));
  for (Hypothesis& one : hypotheses_) {
    if (hypotheses_.size() == kWalkPairs)
      one.log_weight = std::log(std::max(memory.walk_weight[one.place], 1e-12));
  }
  normalize();
  predict(age_s);
  const double share = std::min(age_s / kRunToRunAge_s, 1.0);
  const auto spread = [&](std::size_t gyro) {
    const double sigma = kRunToRunWhite * white[gyro];
    return share * sigma * sigma;
  };
  widen(spread(0), 0.0, spread(1));
}

void DriftBank::predict(double length_s) {
  for (Hypothesis& one : hypotheses_)
    one.filter.predict(length_s);
}

void DriftBank::learn(double length_s, const DriftMeasurement& measurement) {
  const double kept = std::exp(-length_s / kMemory_s);
  for (Hypothesis& one : hypotheses_) {
    one.log_weight = one.log_prior + kept * (one.log_weight - one.log_prior) +
                     one.filter.update(length_s, measurement);
  }
  normalize();
}

void DriftBank::widen(double variance_1, double covariance_12, double variance_2) {
  for (Hypothesis& one : hypotheses_)
    one.filter.widen(variance_1, covariance_12, variance_2);
}

void DriftBank::normalize() {
  double greatest = hypotheses_.front().log_weight;
  for (const Hypothesis& one : hypotheses_)
    greatest = std::max(greatest, one.log_weight);
  double sum = 0.0;
  for (const Hypothesis& one : hypotheses_)
    sum += std::exp(one.log_weight - greatest);
  const double log_sum = greatest + std::log(sum);
  for (Hypothesis& one : hypotheses_)
    one.log_weight -= log_sum;
}

DriftEstimate DriftBank::estimate() const {
  DriftEstimate all;
  // Second moments about the first filter's values: all filters are close together.
  const DriftFilter::Observables origin = hypotheses_.front().filter.mean();
  DriftFilter::Observables first = DriftFilter::Observables::Zero();
  DriftFilter::Covariance second = DriftFilter::Covariance::Zero();
  std::array<double, 2> scale{};
  Symmetric scale_square{};
  for (const Hypothesis& one : hypotheses_) {
    const double weight = std::exp(one.log_weight);
    if (weight < 1e-9) continue;
    const DriftFilter::Observables away = one.filter.mean() - origin;
    const DriftFilter::Covariance covariance = one.filter.covariance();
    first += weight * away;
    second += weight * (covariance + away * away.transpose());
    const auto growth = one.filter.growth_per_s();
    const double drift = growth[0] + growth[1];
    all.drift_share[0] += weight * (drift > 0.0 ? growth[0] / drift : 0.5);
    const double share = one.scale_share;
    all.growth[0] += weight * growth[0];
    all.growth[1] += weight * growth[1];
    // s₁ = share·s, s₂ = −(1 − share)·s. What both have in common stays open: had one gyro been off
    // by all of s, the other's share of it would be wrong.
    const double s = origin(kScale) + away(kScale);
    const double variance = covariance(kScale, kScale);
    const double rest = 1.0 - share;
    const double blamed = share * share / (share * share + rest * rest);
    all.blame[0] += weight * blamed;
    const double common =
        (blamed * rest * rest + (1.0 - blamed) * share * share) * std::max(s * s - variance, 0.0);
    scale[0] += weight * share * s;
    scale[1] -= weight * rest * s;
    scale_square[0] += weight * (share * share * (s * s + variance) + common);
    scale_square[1] += weight * (-share * rest * (s * s + variance) + common);
    scale_square[2] += weight * (rest * rest * (s * s + variance) + common);
  }
  all.drift_share[1] = 1.0 - all.drift_share[0];
  all.blame[1] = 1.0 - all.blame[0];
  all.mean = origin + first;
  all.covariance = second - first * first.transpose();
  all.scale = scale;
  all.scale_covariance = {scale_square[0] - scale[0] * scale[0],
                          scale_square[1] - scale[0] * scale[1],
                          scale_square[2] - scale[1] * scale[1]};
  return all;
}

void DriftBank::save(DriftMemory& memory) const {
  const DriftEstimate now = estimate();
  memory.bias_dps = {now.mean(kBias1), now.mean(kBias2)};
  memory.bias_covariance = {now.covariance(kBias1, kBias1), now.covariance(kBias1, kBias2),
                            now.covariance(kBias2, kBias2)};
  memory.scale_difference = now.mean(kScale);
  memory.scale_difference_sigma = std::sqrt(now.covariance(kScale, kScale));
  memory.skew_s = now.mean(kSkew);
  memory.skew_sigma_s = std::sqrt(now.covariance(kSkew, kSkew));
  memory.walk_weight.fill(1.0 / static_cast<double>(kWalkPairs));
  if (hypotheses_.size() != kWalkPairs) return;
  for (const Hypothesis& one : hypotheses_)
    memory.walk_weight[one.place] = std::exp(one.log_weight);
}

}  // namespace vgyro::fusion
