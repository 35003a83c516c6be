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

// Without Gauss–Markov terms, as always where the parameters are estimated, all sizes are known to
// the compiler: several times faster.
double DriftFilter::update(double length_s, const DriftMeasurement& measurement) {
  const bool small = state_.size() == kObservables;
  switch (measurement.values.size()) {
    case 1:
      return small ? update_sized<kObservables, 1>(length_s, measurement)
                   : update_sized<Eigen::Dynamic, 1>(length_s, measurement);
    case 2:
      return small ? update_sized<kObservables, 2>(length_s, measurement)
                   : update_sized<Eigen::Dynamic, 2>(length_s, measurement);
    default:
      return small ? update_sized<kObservables, 3>(length_s, measurement)
                   : update_sized<Eigen::Dynamic, 3>(length_s, measurement);
  }
}

template <int States, int Rows>
double DriftFilter::update_sized(double length_s, const DriftMeasurement& measurement) {
  constexpr int kMax = States == Eigen::Dynamic ? kStatesMax : States;
  using StateVector = Eigen::Matrix<double, States, 1, 0, kMax, 1>;
  using StateSquare = Eigen::Matrix<double, States, States, 0, kMax, kMax>;
  using Map = Eigen::Matrix<double, Rows, States, (Rows == 1 ? Eigen::RowMajor : 0), Rows, kMax>;
  using Gain = Eigen::Matrix<double, States, Rows, 0, kMax, Rows>;
  using RowSquare = Eigen::Matrix<double, Rows, Rows>;
  using RowVector = Eigen::Matrix<double, Rows, 1>;

  const Motion motion_of_all = motion(length_s);
  const StateVector carry = motion_of_all.carry;
  const StateVector carry_mean = motion_of_all.carry_mean;
  const StateVector end_variance = motion_of_all.end_variance;
  const StateVector lead = motion_of_all.lead;
  const StateVector mean_variance = motion_of_all.mean_variance;
  const StateSquare before = covariance_;
  const StateVector state = state_;

  Map h;
  if constexpr (States == kObservables) {
    h = measurement.rows;
  } else {
    h = measurement.rows * observe_;
  }
  const Map h_mean = h * carry_mean.asDiagonal();
  const Map h_lead = h * lead.asDiagonal();

  const Gain spread = before * h_mean.transpose();
  const Gain led = end_variance.asDiagonal() * h_lead.transpose();
  const Gain cross = carry.asDiagonal() * spread + led;
  const Gain wandered = mean_variance.asDiagonal() * h.transpose();
  RowSquare noise = measurement.noise;
  noise.noalias() += h * wandered;
  RowSquare innovation_covariance = noise;
  innovation_covariance.noalias() += h_mean * spread;
  innovation_covariance.noalias() += h_lead * led;

  const Eigen::LLT<RowSquare> factor(innovation_covariance);
  const Gain gain = factor.solve(cross.transpose()).transpose();
  const RowVector innovation = measurement.values - h_mean * state;
  state_ = carry.cwiseProduct(state) + gain * innovation;

  // x₁ − x̂₁ = (F − G·H_mean)(x₀ − x̂₀) + (I − G·H_lead)·w − G·(H·r + n): independent parts.
  StateSquare start = -gain * h_mean;
  start.diagonal() += carry;
  StateSquare walked = -gain * h_lead;
  walked.diagonal().array() += 1.0;
  const StateSquare started = start * before;
  StateSquare next = started * start.transpose();
  const StateSquare scaled = walked * end_variance.asDiagonal();
  next.noalias() += scaled * walked.transpose();
  const Gain noisy = gain * noise;
  next.noalias() += noisy * gain.transpose();
  covariance_ = 0.5 * (next + next.transpose());

  const RowVector white = factor.matrixL().solve(innovation);
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
