#include "fusion/drift_filter.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace vgyro::fusion {

namespace {

// Below this share of its correlation time a Gauss–Markov term is a random walk to 1e-6.
constexpr double kShort = 1e-3;

struct Term {
  double carry = 1.0;
  double carry_mean = 1.0;
  double end_variance = 0.0;
  double lead = 0.5;
  double mean_variance = 0.0;
};

Term walk(double walk_rts, double length_s) {
  const double variance = walk_rts * walk_rts * length_s;
  return {1.0, 1.0, variance, 0.5, variance / 12.0};
}

Term gauss_markov(const GaussMarkov& term, double length_s) {
  const double a = length_s / term.tau_s;
  const double gone = -std::expm1(-a);  // 1 − e^(−a)
  if (a < kShort) {
    Term short_term = walk(term.sigma_dps * std::sqrt(2.0 / term.tau_s), length_s);
    short_term.carry = 1.0 - gone;
    short_term.carry_mean = gone / a;
    return short_term;
  }
  const double variance = term.sigma_dps * term.sigma_dps;
  const double end = variance * -std::expm1(-2.0 * a);
  const double both = variance / a * gone * gone;
  const double mean = variance / (a * a) * (2.0 * (a - gone) - gone * gone);
  return {1.0 - gone, gone / a, end, both / end, std::max(mean - both * both / end, 0.0)};
}

}  // namespace

DriftFilter::DriftFilter(const DriftModel& model, const Observables& mean,
                         const Covariance& covariance)
    : model_(model) {
  const auto terms = static_cast<int>(model.gauss_markov_count[0] + model.gauss_markov_count[1]);
  const int states = kObservables + terms;
  observe_ = Observe::Zero(kObservables, states);
  observe_.leftCols<kObservables>().setIdentity();
  state_ = State::Zero(states);
  state_.head<kObservables>() = mean;
  covariance_ = Square::Zero(states, states);
  covariance_.topLeftCorner<kObservables, kObservables>() = covariance;
  int place = kObservables;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const auto bias = static_cast<int>(gyro);
    for (std::size_t i = 0; i < model.gauss_markov_count[gyro]; ++i, ++place) {
      observe_(bias, place) = 1.0;
      // The bias was seen as a whole: what the term holds the walk does not.
      const double sigma = model.gauss_markov[gyro][i].sigma_dps;
      const double variance = sigma * sigma;
      covariance_(place, place) += variance;
      covariance_(bias, place) -= variance;
      covariance_(place, bias) -= variance;
      covariance_(bias, bias) += variance;
    }
  }
}

DriftFilter::Motion DriftFilter::motion(double length_s) const {
  const auto states = state_.size();
  Motion all{State(states), State(states), State(states), State(states), State(states)};
  const auto put = [&all](int place, const Term& term) {
    all.carry(place) = term.carry;
    all.carry_mean(place) = term.carry_mean;
    all.end_variance(place) = term.end_variance;
    all.lead(place) = term.lead;
    all.mean_variance(place) = term.mean_variance;
  };
  put(kBias1, walk(model_.walk_dps_rts[0], length_s));
  put(kBias2, walk(model_.walk_dps_rts[1], length_s));
  put(kScale, walk(kScaleWalk_rts, length_s));
  put(kSkew, walk(kSkewWalk_s_rts, length_s));
  int place = kObservables;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    for (std::size_t i = 0; i < model_.gauss_markov_count[gyro]; ++i)
      put(place++, gauss_markov(model_.gauss_markov[gyro][i], length_s));
  }
  return all;
}

void DriftFilter::predict(double length_s) {
  const Motion m = motion(length_s);
  state_ = m.carry.cwiseProduct(state_);
  covariance_ = m.carry.asDiagonal() * covariance_ * m.carry.asDiagonal();
  covariance_.diagonal() += m.end_variance;
}

double DriftFilter::update(double length_s, const DriftMeasurement& measurement) {
  using Map = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, DriftMeasurement::kRowsMax,
                            kStatesMax>;
  using Gain = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kStatesMax,
                             DriftMeasurement::kRowsMax>;
  const Motion m = motion(length_s);
  const Map h = measurement.rows * observe_;
  const Map h_mean = h * m.carry_mean.asDiagonal();
  const Map h_lead = h * m.lead.asDiagonal();

  const Gain cross = m.carry.asDiagonal() * covariance_ * h_mean.transpose() +
                     m.end_variance.asDiagonal() * h_lead.transpose();
  DriftMeasurement::Square noise = measurement.noise;
  noise += h * m.mean_variance.asDiagonal() * h.transpose();
  DriftMeasurement::Square innovation_covariance = noise;
  innovation_covariance += h_mean * covariance_ * h_mean.transpose();
  innovation_covariance += h_lead * m.end_variance.asDiagonal() * h_lead.transpose();

  const Eigen::LLT<DriftMeasurement::Square> factor(innovation_covariance);
  const Gain gain = factor.solve(cross.transpose()).transpose();
  const DriftMeasurement::Values innovation = measurement.values - h_mean * state_;

  state_ = m.carry.cwiseProduct(state_) + gain * innovation;

  // x₁ − x̂₁ = (F − G·H_mean)(x₀ − x̂₀) + (I − G·H_lead)·w − G·(H·r + n): independent parts.
  Square start = -gain * h_mean;
  start.diagonal() += m.carry;
  Square walked = -gain * h_lead;
  walked.diagonal().array() += 1.0;
  Square next = start * covariance_ * start.transpose();
  next += walked * m.end_variance.asDiagonal() * walked.transpose();
  next += gain * noise * gain.transpose();
  covariance_ = 0.5 * (next + next.transpose());

  const DriftMeasurement::Values white = factor.matrixL().solve(innovation);
  return -0.5 * white.squaredNorm() - factor.matrixLLT().diagonal().array().log().sum();
}

void DriftFilter::widen(double variance_1, double covariance_12, double variance_2) {
  covariance_(kBias1, kBias1) += variance_1;
  covariance_(kBias2, kBias2) += variance_2;
  covariance_(kBias1, kBias2) += covariance_12;
  covariance_(kBias2, kBias1) += covariance_12;
}

std::array<double, 2> DriftFilter::growth_per_s() const {
  std::array<double, 2> growth{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    growth[gyro] = model_.walk_dps_rts[gyro] * model_.walk_dps_rts[gyro];
    for (std::size_t i = 0; i < model_.gauss_markov_count[gyro]; ++i) {
      const GaussMarkov& term = model_.gauss_markov[gyro][i];
      growth[gyro] += 2.0 * term.sigma_dps * term.sigma_dps / term.tau_s;
    }
  }
  return growth;
}

}  // namespace vgyro::fusion
