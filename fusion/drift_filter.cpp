#include "fusion/drift_filter.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "fusion/quadratic.h"

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
  int states = kObservables;
  if (model.slopes.any()) {
    slopes_at_ = states;
    states += 2;
  }
  if (model.temperature_dps_k[0] + model.temperature_dps_k[1] > 0.0) {
    temperature_at_ = states;
    states += 2;
  }
  int place = states;
  states += static_cast<int>(model.gauss_markov_count[0] + model.gauss_markov_count[1]);
  observe_ = Observe::Zero(kObservables, states);
  observe_.leftCols<kObservables>().setIdentity();
  state_ = State::Zero(states);
  state_.head<kObservables>() = mean;
  covariance_ = Square::Zero(states, states);
  covariance_.topLeftCorner<kObservables, kObservables>() = covariance;
  for (int gyro = 0; gyro < 2; ++gyro) {
    const auto k = static_cast<std::size_t>(gyro);
    if (slopes_at_ >= 0) {
      covariance_(slopes_at_ + gyro, slopes_at_ + gyro) = squared(model.slopes.begin_dps_s[k]);
    }
    if (temperature_at_ >= 0) {
      const int at = temperature_at_ + gyro;
      covariance_(at, at) = squared(model.temperature_dps_k[k]);
    }
    for (std::size_t i = 0; i < model.gauss_markov_count[k]; ++i, ++place) {
      observe_(gyro, place) = 1.0;
      // Only the sum of walk and term was measured: their errors are opposite.
      const double variance = squared(model.gauss_markov[k][i].sigma_dps);
      covariance_(place, place) += variance;
      covariance_(gyro, place) -= variance;
      covariance_(place, gyro) -= variance;
      covariance_(gyro, gyro) += variance;
    }
  }
}

DriftFilter::Transition DriftFilter::transition(double length_s) const {
  const auto states = state_.size();
  Transition all{State::Ones(states), State::Ones(states), State::Zero(states), State::Zero(states),
                 State::Zero(states)};
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
  if (slopes_at_ >= 0) {
    const double tau_s = model_.slopes.tau_s;
    const double gone = -std::expm1(-length_s / tau_s);
    all.slope_end_s = tau_s * gone;
    all.slope_mean_s = tau_s * (1.0 - gone * tau_s / length_s);
    all.carry.segment<2>(slopes_at_).setConstant(1.0 - gone);
    place += 2;
  }
  if (temperature_at_ >= 0) place += 2;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    for (std::size_t i = 0; i < model_.gauss_markov_count[gyro]; ++i)
      put(place++, gauss_markov(model_.gauss_markov[gyro][i], length_s));
  }
  return all;
}

// Noise of the slopes: what a slope gains by itself in a window, and what that adds to the drift.
void DriftFilter::add_slope_noise(double length_s, Square& walked) const {
  const SlopeModel& slopes = model_.slopes;
  const double tau_s = slopes.tau_s;
  const double a = length_s / tau_s;
  const double gone = -std::expm1(-a);
  const double slope_gain = -std::expm1(-2.0 * a);
  const double cross_s = tau_s * gone * gone;
  // ½·variance of the integral, as a series where rounding would cancel all of it.
  const double integral_s2 =
      tau_s * tau_s *
      (a < kShort ? 2.0 / 3.0 * a * a * a : std::max(2.0 * (a - gone) - gone * gone, 0.0));
  std::array<double, 2> steady{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double slope = state_(slopes_at_ + static_cast<int>(gyro));
    steady[gyro] = std::hypot(slopes.steady_dps_s[gyro], slopes.relative * slope);
  }
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const double both = steady[static_cast<std::size_t>(i)] *
                          steady[static_cast<std::size_t>(j)] * (i == j ? 1.0 : slopes.correlation);
      walked(slopes_at_ + i, slopes_at_ + j) += both * slope_gain;
      walked(kBias1 + i, slopes_at_ + j) += both * cross_s;
      walked(slopes_at_ + j, kBias1 + i) += both * cross_s;
      walked(kBias1 + i, kBias1 + j) += both * integral_s2;
    }
  }
}

void DriftFilter::predict(double length_s) {
  if (!(length_s > 0.0)) return;
  const Transition m = transition(length_s);
  Square flow = m.carry.asDiagonal();
  Square walked = m.end_variance.asDiagonal();
  if (slopes_at_ >= 0) {
    for (int gyro = 0; gyro < 2; ++gyro)
      flow(kBias1 + gyro, slopes_at_ + gyro) = m.slope_end_s;
    add_slope_noise(length_s, walked);
  }
  state_ = (flow * state_).eval();
  covariance_ = (flow * covariance_ * flow.transpose() + walked).eval();
}

// One window with its measurement, with States and Rows known at compile time.
template <int States, int Rows>
class DriftFilter::SizedUpdate {
 public:
  SizedUpdate(const DriftFilter& filter, double length_s, const DriftMeasurement& measurement)
      : slopes_at_(filter.slopes_at_),
        window_(filter.transition(length_s)),
        carry_(window_.carry),
        end_variance_(window_.end_variance),
        before_(filter.covariance_),
        state_(filter.state_),
        noise_(measurement.noise) {
    see(filter, measurement);
    if (slopes_at_ < 0) return;
    Square walked = window_.end_variance.asDiagonal();
    filter.add_slope_noise(length_s, walked);
    walk_covariance_ = walked;
  }

  /// Puts the states at the window's end into `state`; returns the log likelihood of `values`.
  double correct(const DriftMeasurement::Values& values, State& state);
  /// After correct(): puts the covariance of these states into `covariance`.
  void spread(Square& covariance) const;

 private:
  static constexpr int kMax = States == Eigen::Dynamic ? kStatesMax : States;
  using StateVector = Eigen::Matrix<double, States, 1, 0, kMax, 1>;
  using StateSquare = Eigen::Matrix<double, States, States, 0, kMax, kMax>;
  using Map = Eigen::Matrix<double, Rows, States, (Rows == 1 ? Eigen::RowMajor : 0), Rows, kMax>;
  using Gain = Eigen::Matrix<double, States, Rows, 0, kMax, Rows>;
  using RowSquare = Eigen::Matrix<double, Rows, Rows>;
  using RowVector = Eigen::Matrix<double, Rows, 1>;

  void see(const DriftFilter& filter, const DriftMeasurement& measurement);
  [[nodiscard]] StateSquare wandered_covariance(const StateSquare& walked) const;

  int slopes_at_;
  Transition window_;
  StateVector carry_;
  StateVector end_variance_;
  StateSquare walk_covariance_;  ///< only with slopes, whose part is not diagonal
  StateSquare before_;
  StateVector state_;
  StateVector end_;  ///< predicted states at the window's end
  Map h_;            ///< maps r to the measurement; h_mean_: the start; h_lead_: w
  Map h_mean_;
  Map h_lead_;
  RowSquare noise_;  ///< of the measurement, including r
  Gain gain_;
};

template <int States, int Rows>
void DriftFilter::SizedUpdate<States, Rows>::see(const DriftFilter& filter,
                                                 const DriftMeasurement& measurement) {
  if constexpr (States == kObservables) {
    h_ = measurement.rows;
  } else {
    h_ = measurement.rows * filter.observe_;
  }
  const StateVector lead = window_.lead;
  h_mean_ = h_ * window_.carry_mean.asDiagonal();
  h_lead_ = h_ * lead.asDiagonal();
  end_ = carry_.cwiseProduct(state_);
  if (slopes_at_ < 0) return;
  for (int gyro = 0; gyro < 2; ++gyro) {
    h_mean_.col(slopes_at_ + gyro) += window_.slope_mean_s * h_.col(kBias1 + gyro);
    end_(kBias1 + gyro) += window_.slope_end_s * state_(slopes_at_ + gyro);
  }
}

template <int States, int Rows>
double DriftFilter::SizedUpdate<States, Rows>::correct(const DriftMeasurement::Values& values,
                                                       State& state) {
  const Gain spread = before_ * h_mean_.transpose();
  Gain led = end_variance_.asDiagonal() * h_lead_.transpose();
  if (slopes_at_ >= 0) led = walk_covariance_ * h_lead_.transpose();
  Gain cross = carry_.asDiagonal() * spread + led;
  if (slopes_at_ >= 0) {
    for (int gyro = 0; gyro < 2; ++gyro)
      cross.row(kBias1 + gyro) += window_.slope_end_s * spread.row(slopes_at_ + gyro);
  }
  const StateVector mean_variance = window_.mean_variance;
  const Gain wandered = mean_variance.asDiagonal() * h_.transpose();
  noise_.noalias() += h_ * wandered;
  RowSquare innovation_covariance = noise_;
  innovation_covariance.noalias() += h_mean_ * spread;
  innovation_covariance.noalias() += h_lead_ * led;

  const Eigen::LLT<RowSquare> factor(innovation_covariance);
  // gain · L · Lᵀ = cross, column by column: as the general solver does, without its blocks.
  const RowSquare& lower = factor.matrixLLT();
  gain_ = cross;
  for (int row = 0; row < Rows; ++row) {
    gain_.col(row) *= 1.0 / lower(row, row);
    for (int below = row + 1; below < Rows; ++below)
      gain_.col(below) -= gain_.col(row) * lower(below, row);
  }
  for (int row = Rows - 1; row >= 0; --row) {
    for (int below = row + 1; below < Rows; ++below)
      gain_.col(row) -= gain_.col(below) * lower(below, row);
    gain_.col(row) *= 1.0 / lower(row, row);
  }
  const RowVector innovation = values - h_mean_ * state_;
  state = end_ + gain_ * innovation;
  const RowVector white = factor.matrixL().solve(innovation);
  return -0.5 * white.squaredNorm() - factor.matrixLLT().diagonal().array().log().sum();
}

// x₁ − x̂₁ = (F − G·H_mean)(x₀ − x̂₀) + (I − G·H_lead)·w − G·(H·r + n): independent parts.
template <int States, int Rows>
void DriftFilter::SizedUpdate<States, Rows>::spread(Square& covariance) const {
  StateSquare start = -gain_ * h_mean_;
  start.diagonal() += carry_;
  if (slopes_at_ >= 0) {
    for (int gyro = 0; gyro < 2; ++gyro)
      start(kBias1 + gyro, slopes_at_ + gyro) += window_.slope_end_s;
  }
  StateSquare walked = -gain_ * h_lead_;
  walked.diagonal().array() += 1.0;
  // Fixed sizes, term by term: Eigen's general product packs its operands first and takes several
  // times as long.
  const StateSquare started = start.lazyProduct(before_);
  StateSquare next = started.lazyProduct(start.transpose());
  next += wandered_covariance(walked);
  const Gain noisy = gain_ * noise_;
  next.noalias() += noisy * gain_.transpose();
  covariance = 0.5 * (next + next.transpose());
}

// walked · (covariance of w) · walkedᵀ, without the products that are exactly zero: among the
// states after the observables only slopes wander (Gauss–Markov terms apart), and no measurement
// depends on their w.
template <int States, int Rows>
auto DriftFilter::SizedUpdate<States, Rows>::wandered_covariance(const StateSquare& walked) const
    -> StateSquare {
  StateSquare scaled = walked * end_variance_.asDiagonal();
  if constexpr (States == Eigen::Dynamic) {
    if (slopes_at_ >= 0) scaled.noalias() = walked.lazyProduct(walk_covariance_);
    return scaled.lazyProduct(walked.transpose());
  }
  for (int slope = 0; slopes_at_ >= 0 && slope < 2; ++slope) {
    for (const int to : {kBias1 + slope, slopes_at_ + slope}) {
      scaled.col(to) = walked.col(kBias1) * walk_covariance_(kBias1, to) +
                       walked.col(kBias2) * walk_covariance_(kBias2, to);
      for (int from = slopes_at_; from < slopes_at_ + 2; ++from)
        scaled(from, to) += walk_covariance_(from, to);
    }
  }
  StateSquare wandered = scaled.template leftCols<kObservables>().lazyProduct(
      walked.template leftCols<kObservables>().transpose());
  if (slopes_at_ >= 0) {
    wandered.template middleCols<2>(slopes_at_) += scaled.template middleCols<2>(slopes_at_);
  }
  return wandered;
}

// Without Gauss–Markov terms, which only the model file adds, all sizes are known at compile time:
// several times faster.
double DriftFilter::update(double length_s, const DriftMeasurement& measurement) {
  const bool terms = model_.gauss_markov_count[0] + model_.gauss_markov_count[1] > 0;
  if (terms) return update_of<Eigen::Dynamic>(length_s, measurement);
  switch (state_.size()) {
    case kObservables:
      return update_of<kObservables>(length_s, measurement);
    case kObservables + 2:
      return update_of<kObservables + 2>(length_s, measurement);
    default:
      return update_of<kObservables + 4>(length_s, measurement);
  }
}

template <int States>
double DriftFilter::update_of(double length_s, const DriftMeasurement& measurement) {
  const auto with = [&](auto update) {
    const double log_likelihood = update.correct(measurement.values, state_);
    update.spread(covariance_);
    return log_likelihood;
  };
  switch (measurement.values.size()) {
    case 1:
      return with(SizedUpdate<States, 1>(*this, length_s, measurement));
    case 2:
      return with(SizedUpdate<States, 2>(*this, length_s, measurement));
    default:
      return with(SizedUpdate<States, 3>(*this, length_s, measurement));
  }
}

void DriftFilter::widen(double variance_1, double covariance_12, double variance_2) {
  covariance_(kBias1, kBias1) += variance_1;
  covariance_(kBias2, kBias2) += variance_2;
  covariance_(kBias1, kBias2) += covariance_12;
  covariance_(kBias2, kBias1) += covariance_12;
}

void DriftFilter::shift(std::size_t gyro, double by_dps, double variance) {
  const int bias = gyro == 0 ? kBias1 : kBias2;
  state_(bias) += by_dps;
  covariance_(bias, bias) += variance;
}

void DriftFilter::set_temperature(const std::array<double, 2>& away_k) {
  if (temperature_at_ < 0) return;
  observe_(kBias1, temperature_at_) = away_k[0];
  observe_(kBias2, temperature_at_ + 1) = away_k[1];
}

void DriftFilter::set_slopes(const Eigen::Vector2d& mean_dps_s, const Eigen::Matrix2d& covariance) {
  state_.segment<2>(slopes_at_) = mean_dps_s;
  covariance_.block<2, 2>(slopes_at_, slopes_at_) = covariance;
}

void DriftFilter::set_coefficient(std::size_t gyro, double mean_dps_k, double variance) {
  const int at = temperature_at_ + static_cast<int>(gyro);
  state_(at) = mean_dps_k;
  covariance_(at, at) = variance;
}

// With fixed sizes for the same cases as update().
template <int States>
DriftFilter::Covariance DriftFilter::covariance_of() const {
  using Sees = Eigen::Matrix<double, kObservables, States>;
  const Eigen::Map<const Sees> observe(observe_.data());
  const Eigen::Map<const Eigen::Matrix<double, States, States>> covariance(covariance_.data());
  const Sees seen = observe.lazyProduct(covariance);
  return seen.lazyProduct(observe.transpose());
}

DriftFilter::Covariance DriftFilter::covariance() const {
  switch (state_.size()) {
    case kObservables:
      return covariance_of<kObservables>();
    case kObservables + 2:
      return covariance_of<kObservables + 2>();
    case kObservables + 4:
      return covariance_of<kObservables + 4>();
    default:
      return observe_ * covariance_ * observe_.transpose();
  }
}

DriftFilter::Slopes DriftFilter::slopes() const {
  Slopes found;
  if (slopes_at_ < 0) return found;
  found.mean = state_.segment<2>(slopes_at_);
  found.covariance = covariance_.block<2, 2>(slopes_at_, slopes_at_);
  found.with_drift = observe_.topRows<2>().lazyProduct(covariance_.middleCols<2>(slopes_at_));
  return found;
}

std::array<double, 2> DriftFilter::coefficient(std::size_t gyro) const {
  const int at = temperature_at_ + static_cast<int>(gyro);
  return {state_(at), covariance_(at, at)};
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
