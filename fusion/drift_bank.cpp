#include "fusion/drift_bank.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vgyro::fusion {

namespace {

// Prior of K/N: 2e-2 per second, within a factor of five, which spans good fibre-optic gyros and
// cheap MEMS.
constexpr double kUsualRatioLog10 = -1.7;
constexpr double kRatioSpreadLog10 = 0.7;

// σ of a sensor's drift between two runs, in units of N over √(1 s), and the time off after which
// it counts in full.
constexpr double kRunToRunWhite = 3.0;
constexpr double kRunToRunAge_s = 60.0;
// Slopes continue for at most this long across a restart.
constexpr double kSlopesGoOn_s = 600.0;

/// Slopes depend on a sensor's class, as N does: their σ are in units of N.
struct DriftKind {
  double prior;
  double begin_per_s;   ///< σ of the slope at the start over N
  double steady_per_s;  ///< in the long run
  double tau_s;
  double correlation;
  double relative;  ///< change of a slope in the long run, as a share of it
  bool alike;       ///< both gyros' slopes are of the quieter one's size
  /// Which of kWalkRatios_per_s are tried: every stride-th, without `margin` values at each end.
  std::size_t stride;
  std::size_t margin;
};
constexpr std::array<DriftKind, kDriftKinds> kKinds{{
    {0.87, 0.0, 0.0, 1.0, 0.0, 0.0, false, 2, 0},
    {0.05, 0.5, 0.02, 100.0, 0.0, 0.3, false, 2, 2},
    {0.05, 0.3, 0.02, 500.0, 0.0, 0.3, false, 2, 2},
    {0.02, 0.0, 0.1, 300.0, 0.0, 0.0, false, 2, 2},
    {0.01, 0.0, 0.1, 300.0, 0.98, 0.0, true, 2, 2},
}};

// Factor on the priors of all kinds but the first where the model file gives K.
constexpr double kMeasured = 0.2;

// Prior σ of a temperature coefficient, in units of N per kelvin.
constexpr double kCoefficientWhite_per_k = 1.5;
// This σ grows with this power of K over its usual value, within limits.
constexpr double kUsualRatio_per_s = 0.02;
constexpr double kCoefficientPower = 0.7;
constexpr double kCoefficientLeast = 0.2;
constexpr double kCoefficientMost = 5.0;
// Bends and hysteresis of a bias over temperature: a random walk over kelvins.
constexpr double kBendWhite_per_rtk = 0.05;

// Scale errors depend on a sensor's class, from 0.05 % of a fibre-optic gyro to 0.5 % of a cheap
// MEMS. Two scale factors plainly differ from this many standard deviations on.
constexpr double kUsualScale = 5e-4;
constexpr double kUsualScaleWhite = 1e-4;
constexpr double kUsualScaleMin = 3e-4;
constexpr double kUsualScaleMax = 5e-3;
constexpr double kPlainSigmas = 4.0;

// Parts with less weight are left out of the sums.
constexpr double kWeightMin = 1e-9;
constexpr double kHalfLogTwoPi = 0.918938533204672741780;

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

/// The values of K that are tried with a kind of drift.
struct WalkChoices {
  std::array<WalkChoice, kWalkRatios_per_s.size()> choice{};
  std::size_t count = 0;
};

WalkChoices walk_choices(const DriftKind& kind, const GyroParameters& gyro, double white) {
  WalkChoices all;
  if (gyro.walk_dps_rts) {
    all.choice[all.count++] = {*gyro.walk_dps_rts, 0.0, 0};
    return all;
  }
  double sum = 0.0;
  for (std::size_t i = kind.margin; i < kWalkRatios_per_s.size() - kind.margin; i += kind.stride) {
    all.choice[all.count++] = {kWalkRatios_per_s[i] * white, log_prior(kWalkRatios_per_s[i]), i};
    sum += std::exp(log_prior(kWalkRatios_per_s[i]));
  }
  for (std::size_t i = 0; i < all.count; ++i)
    all.choice[i].log_weight -= std::log(sum);
  return all;
}

SlopeModel slopes_of(const DriftKind& kind, const std::array<double, 2>& white_dps_rthz) {
  SlopeModel slopes{
      .tau_s = kind.tau_s, .correlation = kind.correlation, .relative = kind.relative};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double white =
        kind.alike ? std::min(white_dps_rthz[0], white_dps_rthz[1]) : white_dps_rthz[gyro];
    slopes.begin_dps_s[gyro] = kind.begin_per_s * white;
    slopes.steady_dps_s[gyro] = kind.steady_per_s * white;
  }
  return slopes;
}

/// The share of a weight at place `from` of DriftMemory::walk_weight that goes to a kind's place
/// `to`: weights between two places are divided, those beyond the ends go to the ends.
double share_of_place(const DriftKind& kind, std::size_t from, std::size_t to) {
  const auto last = static_cast<double>(kWalkRatios_per_s.size() - 1 - kind.margin);
  const double at = std::clamp(static_cast<double>(from), static_cast<double>(kind.margin), last);
  const double away = std::abs(at - static_cast<double>(to)) / static_cast<double>(kind.stride);
  return std::max(1.0 - away, 0.0);
}

// A gyro that drifts more reacts more to heat.
double usual_coefficient(double white_dps_rthz, double walk_dps_rts) {
  const double ratio = walk_dps_rts / (white_dps_rthz * kUsualRatio_per_s);
  return kCoefficientWhite_per_k * white_dps_rthz *
         std::clamp(std::pow(ratio, kCoefficientPower), kCoefficientLeast, kCoefficientMost);
}

using Moments = Eigen::Matrix<double, 6, 1>;
using MomentSquare = Eigen::Matrix<double, 6, 6>;

Moments moments_of(const DriftEstimate& estimate) {
  Moments all;
  all << estimate.mean, estimate.slope;
  return all;
}

MomentSquare square_of(const DriftEstimate& estimate) {
  MomentSquare all = MomentSquare::Zero();
  all.topLeftCorner<4, 4>() = estimate.covariance;
  all.bottomRightCorner<2, 2>() = estimate.slope_covariance;
  all.block<2, 2>(0, 4) = estimate.slope_with_bias;
  all.block<2, 2>(4, 0) = estimate.slope_with_bias.transpose();
  return all;
}

}  // namespace

void EstimateMixer::add(double weight, const DriftEstimate& part) {
  if (!any_) origin_ = part;
  any_ = true;
  const Moments away = moments_of(part) - moments_of(origin_);
  first_ += weight * away;
  second_ += weight * (square_of(part) + away * away.transpose());
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    sum_.growth[gyro] += weight * part.growth[gyro];
    sum_.scale[gyro] += weight * part.scale[gyro];
    sum_.blame[gyro] += weight * part.blame[gyro];
    sum_.drift_share[gyro] += weight * part.drift_share[gyro];
  }
  scale_square_[0] += weight * (part.scale_covariance[0] + part.scale[0] * part.scale[0]);
  scale_square_[1] += weight * (part.scale_covariance[1] + part.scale[0] * part.scale[1]);
  scale_square_[2] += weight * (part.scale_covariance[2] + part.scale[1] * part.scale[1]);
  for (std::size_t kind = 0; kind < kDriftKinds; ++kind)
    sum_.kind_weight[kind] += weight * part.kind_weight[kind];
}

DriftEstimate EstimateMixer::result() const {
  DriftEstimate all = sum_;
  const Moments mean = moments_of(origin_) + first_;
  const MomentSquare square = second_ - first_ * first_.transpose();
  all.mean = mean.head<4>();
  all.slope = mean.tail<2>();
  all.covariance = square.topLeftCorner<4, 4>();
  all.slope_covariance = square.bottomRightCorner<2, 2>();
  all.slope_with_bias = square.block<2, 2>(0, 4);
  all.scale_covariance = {scale_square_[0] - all.scale[0] * all.scale[0],
                          scale_square_[1] - all.scale[0] * all.scale[1],
                          scale_square_[2] - all.scale[1] * all.scale[1]};
  return all;
}

DriftBank::DriftBank(const std::array<GyroParameters, 2>& gyros) : gyros_(gyros) {
  constexpr std::size_t kFiltersMax = 25 + 4 * 9;
  filters_.reserve(kFiltersMax);
}

// A user who gives K has measured the drift, and would have seen other kinds.
double DriftBank::prior_of(std::size_t kind) const {
  const bool measured = gyros_[0].walk_dps_rts && gyros_[1].walk_dps_rts;
  if (!measured) return kKinds[kind].prior;
  const double others = kMeasured * (1.0 - kKinds[0].prior);
  return kind == 0 ? 1.0 - others : kMeasured * kKinds[kind].prior;
}

void DriftBank::make_kind(std::size_t kind, const std::array<double, 2>& white_dps_rthz,
                          const DriftFilter::Observables& mean,
                          const DriftFilter::Covariance& covariance) {
  const DriftKind& which = kKinds[kind];
  const WalkChoices firsts = walk_choices(which, gyros_[0], white_dps_rthz[0]);
  const WalkChoices seconds = walk_choices(which, gyros_[1], white_dps_rthz[1]);
  DriftModel model;
  model.slopes = slopes_of(which, white_dps_rthz);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    model.gauss_markov[gyro] = gyros_[gyro].gauss_markov;
    model.gauss_markov_count[gyro] = gyros_[gyro].gauss_markov_count;
  }
  for (std::size_t i = 0; i < firsts.count; ++i) {
    for (std::size_t j = 0; j < seconds.count; ++j) {
      const WalkChoice& first = firsts.choice[i];
      const WalkChoice& second = seconds.choice[j];
      model.walk_dps_rts = {first.walk_dps_rts, second.walk_dps_rts};
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        if (!gyros_[gyro].learns_temperature) continue;
        model.temperature_dps_k[gyro] =
            usual_coefficient(white_dps_rthz[gyro], model.walk_dps_rts[gyro]);
      }
      const double log_weight = std::log(prior_of(kind)) + first.log_weight + second.log_weight;
      DriftFilter filter(model, mean, covariance);
      const auto growth = filter.growth_per_s();
      const double quality_1 = white_dps_rthz[0] * std::sqrt(growth[0]);
      const double quality_2 = white_dps_rthz[1] * std::sqrt(growth[1]);
      const double scale_share =
          quality_1 + quality_2 > 0.0 ? quality_1 / (quality_1 + quality_2) : 0.5;
      filters_.push_back({std::move(filter), scale_share, log_weight, log_weight,
                          first.place * kWalkRatios_per_s.size() + second.place, kind});
    }
  }
}

void DriftBank::make(const std::array<double, 2>& white_dps_rthz,
                     const DriftFilter::Observables& mean,
                     const DriftFilter::Covariance& covariance) {
  filters_.clear();
  white_dps_rthz_ = white_dps_rthz;
  for (std::size_t kind = 0; kind < kDriftKinds; ++kind)
    make_kind(kind, white_dps_rthz, mean, covariance);
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
  weigh_as(memory);
  take_slopes(memory);
  take_coefficients(memory);
  normalize();
  // Slopes come from heat that comes and goes, and do not add up for days.
  const double sloping_s = std::min(age_s, kSlopesGoOn_s);
  for (WeighedFilter& one : filters_) {
    one.filter.predict(one.filter.has_slopes() ? sloping_s : age_s);
    if (!one.filter.has_slopes()) continue;
    const auto growth = one.filter.growth_per_s();
    const double rest_s = age_s - sloping_s;
    one.filter.widen(growth[0] * rest_s, 0.0, growth[1] * rest_s);
  }
  const double share = std::min(age_s / kRunToRunAge_s, 1.0);
  const auto spread = [&](std::size_t gyro) {
    const double sigma = kRunToRunWhite * white[gyro];
    return share * sigma * sigma;
  };
  widen(spread(0), 0.0, spread(1));
}

void DriftBank::weigh_as(const DriftMemory& memory) {
  constexpr double kNever = 1e-12;
  const std::size_t ratios = kWalkRatios_per_s.size();
  double kinds = 0.0;
  for (const double weight : memory.kind_weight)
    kinds += weight;
  const bool walks_are_known = !gyros_[0].walk_dps_rts && !gyros_[1].walk_dps_rts;
  for (WeighedFilter& one : filters_) {
    const DriftKind& kind = kKinds[one.kind];
    double weight = kinds > 0.0 ? memory.kind_weight[one.kind] / kinds : prior_of(one.kind);
    if (walks_are_known) {
      double walk = 0.0;
      for (std::size_t place = 0; place < kWalkPairs; ++place) {
        walk += memory.walk_weight[place] *
                share_of_place(kind, place / ratios, one.place / ratios) *
                share_of_place(kind, place % ratios, one.place % ratios);
      }
      weight *= walk;
    } else {
      weight *= std::exp(one.log_prior) / prior_of(one.kind);
    }
    one.log_weight = std::log(std::max(weight, kNever));
  }
}

void DriftBank::take_slopes(const DriftMemory& memory) {
  if (!(memory.slope_sigma_dps_s[0] > 0.0 && memory.slope_sigma_dps_s[1] > 0.0)) return;
  const Eigen::Vector2d mean(memory.slope_dps_s[0], memory.slope_dps_s[1]);
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  covariance(0, 0) = squared(memory.slope_sigma_dps_s[0]);
  covariance(1, 1) = squared(memory.slope_sigma_dps_s[1]);
  for (WeighedFilter& one : filters_) {
    if (one.filter.has_slopes()) one.filter.set_slopes(mean, covariance);
  }
}

// The saved biases hold at the saved temperature, where the coefficient therefore counts from.
void DriftBank::take_coefficients(const DriftMemory& memory) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!gyros_[gyro].learns_temperature || !memory.has_temperature[gyro]) continue;
    reference_c_[gyro] = memory.temperature_c[gyro];
    has_reference_[gyro] = true;
    const double sigma = memory.coefficient_sigma_dps_k[gyro];
    if (!(sigma > 0.0)) continue;
    for (WeighedFilter& one : filters_)
      one.filter.set_coefficient(gyro, memory.coefficient_dps_k[gyro], squared(sigma));
  }
}

// Variance of a common scale error, which the difference does not show. As long as the difference
// is unknown, and where it is plainly not 0, gyros are assumed to have the scale errors of their
// class.
double DriftBank::usual_scale_doubt(double difference, double variance) const {
  std::array<double, 2> usual{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    usual[gyro] = std::clamp(kUsualScale * white_dps_rthz_[gyro] / kUsualScaleWhite, kUsualScaleMin,
                             kUsualScaleMax);
  }
  const double square = difference * difference;
  const double sum = squared(usual[0]) + squared(usual[1]);
  const double together = squared(usual[0] * usual[1]) / sum;
  const double unknown = std::min(variance / sum, 1.0);
  const double plain =
      square > 0.0 ? std::clamp(1.0 - squared(kPlainSigmas) * variance / square, 0.0, 1.0) : 0.0;
  return std::max(unknown * together, plain * std::min(together, 4.0 * square));
}

void DriftBank::predict(double length_s) {
  for (WeighedFilter& one : filters_)
    one.filter.predict(length_s);
}

double DriftBank::learn(double length_s, const DriftMeasurement& measurement) {
  const double kept = std::exp(-length_s / kMemory_s);
  for (WeighedFilter& one : filters_)
    one.log_weight = one.log_prior + kept * (one.log_weight - one.log_prior);
  normalize();
  for (WeighedFilter& one : filters_)
    one.log_weight += one.filter.update(length_s, measurement);
  return normalize() - kHalfLogTwoPi * static_cast<double>(measurement.values.size());
}

void DriftBank::widen(double variance_1, double covariance_12, double variance_2) {
  for (WeighedFilter& one : filters_)
    one.filter.widen(variance_1, covariance_12, variance_2);
}

void DriftBank::shift(std::size_t gyro, double by_dps, double variance) {
  for (WeighedFilter& one : filters_)
    one.filter.shift(gyro, by_dps, variance);
}

void DriftBank::set_temperature(const std::array<double, 2>& temperature_c) {
  bool changed = false;
  std::array<double, 2> bend{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!gyros_[gyro].learns_temperature || !std::isfinite(temperature_c[gyro])) continue;
    if (!has_reference_[gyro]) {
      reference_c_[gyro] = temperature_c[gyro];
      has_reference_[gyro] = true;
    }
    const double away_k = temperature_c[gyro] - reference_c_[gyro];
    changed = changed || away_k != away_k_[gyro];
    bend[gyro] =
        squared(kBendWhite_per_rtk * white_dps_rthz_[gyro]) * std::abs(away_k - away_k_[gyro]);
    away_k_[gyro] = away_k;
  }
  if (!changed) return;
  for (WeighedFilter& one : filters_) {
    one.filter.set_temperature(away_k_);
    one.filter.widen(bend[0], 0.0, bend[1]);
  }
}

void DriftBank::observe_at(const std::array<double, 2>& temperature_c) {
  std::array<double, 2> away_k = away_k_;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (has_reference_[gyro] && std::isfinite(temperature_c[gyro]))
      away_k[gyro] = temperature_c[gyro] - reference_c_[gyro];
  }
  for (WeighedFilter& one : filters_)
    one.filter.set_temperature(away_k);
}

double DriftBank::normalize() {
  double greatest = filters_.front().log_weight;
  for (const WeighedFilter& one : filters_)
    greatest = std::max(greatest, one.log_weight);
  double sum = 0.0;
  for (const WeighedFilter& one : filters_)
    sum += std::exp(one.log_weight - greatest);
  const double log_sum = greatest + std::log(sum);
  for (WeighedFilter& one : filters_)
    one.log_weight -= log_sum;
  return log_sum;
}

DriftEstimate DriftBank::estimate() const {
  EstimateMixer mixer;
  for (const WeighedFilter& one : filters_) {
    const double weight = std::exp(one.log_weight);
    if (weight < kWeightMin) continue;
    DriftEstimate part;
    part.mean = one.filter.mean();
    part.covariance = one.filter.covariance();
    const DriftFilter::Slopes slopes = one.filter.slopes();
    part.slope = slopes.mean;
    part.slope_covariance = slopes.covariance;
    part.slope_with_bias = slopes.with_drift;
    part.growth = one.filter.growth_per_s();
    const double drift = part.growth[0] + part.growth[1];
    part.drift_share[0] = drift > 0.0 ? part.growth[0] / drift : 0.5;
    part.drift_share[1] = 1.0 - part.drift_share[0];
    // s₁ = share·s, s₂ = −(1 − share)·s. The common part stays open: if one gyro had all of s, the
    // other one's share would be wrong.
    const double share = one.scale_share;
    const double rest = 1.0 - share;
    const double s = part.mean(kScale);
    const double variance = part.covariance(kScale, kScale);
    const double blamed = share * share / (share * share + rest * rest);
    const double common = std::max(
        (blamed * rest * rest + (1.0 - blamed) * share * share) * std::max(s * s - variance, 0.0),
        usual_scale_doubt(s, variance));
    part.blame = {blamed, 1.0 - blamed};
    part.scale = {share * s, -rest * s};
    part.scale_covariance = {share * share * variance + common, -share * rest * variance + common,
                             rest * rest * variance + common};
    part.kind_weight[one.kind] = 1.0;
    mixer.add(weight, part);
  }
  return mixer.result();
}

void DriftBank::save(DriftMemory& memory) const {
  memory.walk_weight.fill(1.0 / static_cast<double>(kWalkPairs));
  const bool walks_are_known = gyros_[0].walk_dps_rts || gyros_[1].walk_dps_rts;
  if (!walks_are_known) memory.walk_weight.fill(0.0);
  memory.kind_weight.fill(0.0);
  std::array<double, 2> coefficient_square{};
  std::array<double, 2> slope_square{};
  double sloping = 0.0;
  for (const WeighedFilter& one : filters_) {
    const double weight = std::exp(one.log_weight);
    memory.kind_weight[one.kind] += weight;
    if (!walks_are_known) memory.walk_weight[one.place] += weight;
    // Mean of the slopes given that there are any; kind_weight holds the probability of that.
    if (one.filter.has_slopes()) {
      const DriftFilter::Slopes slopes = one.filter.slopes();
      sloping += weight;
      for (int gyro = 0; gyro < 2; ++gyro) {
        const auto k = static_cast<std::size_t>(gyro);
        memory.slope_dps_s[k] += weight * slopes.mean(gyro);
        slope_square[k] += weight * (slopes.covariance(gyro, gyro) + squared(slopes.mean(gyro)));
      }
    }
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!has_reference_[gyro]) continue;
      const auto [mean, variance] = one.filter.coefficient(gyro);
      memory.coefficient_dps_k[gyro] += weight * mean;
      coefficient_square[gyro] += weight * (variance + mean * mean);
    }
  }
  for (std::size_t gyro = 0; gyro < 2 && sloping > kWeightMin; ++gyro) {
    memory.slope_dps_s[gyro] /= sloping;
    memory.slope_sigma_dps_s[gyro] =
        std::sqrt(std::max(slope_square[gyro] / sloping - squared(memory.slope_dps_s[gyro]), 0.0));
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!has_reference_[gyro]) continue;
    memory.has_temperature[gyro] = true;
    memory.temperature_c[gyro] = reference_c_[gyro] + away_k_[gyro];
    memory.coefficient_sigma_dps_k[gyro] = std::sqrt(
        std::max(coefficient_square[gyro] - squared(memory.coefficient_dps_k[gyro]), 0.0));
  }
}

}  // namespace vgyro::fusion
