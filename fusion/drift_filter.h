#pragma once

// Kalman filter over the drifts of two gyros, fed one window at a time. The states are the random
// walks b₁, b₂, the scale-factor difference s and the time skew τ of the two gyros, and, if the
// model has them, the slopes of the drifts, their temperature coefficients, and Gauss–Markov terms.
// A window measures the *mean* of a drift over its length; the filter treats the mean exactly, so
// that long windows lose nothing but time. The covariance is a sum of squares at every step (Joseph
// form): it stays symmetric and positive.

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "fusion/gyro_parameters.h"
#include "model/effect.h"

namespace vgyro::fusion {

/// Slopes of the drifts: first-order Gauss–Markov processes in deg/s². All zero: no slope states.
struct SlopeModel {
  std::array<double, 2> begin_dps_s{};   ///< σ at the beginning
  std::array<double, 2> steady_dps_s{};  ///< σ in the long run
  double tau_s = 1.0;
  double correlation = 0.0;  ///< of the two gyros' changes of slope
  /// Part of a slope by which it may change in the long run: a steep slope changes more.
  double relative = 0.0;

  [[nodiscard]] bool any() const {
    return begin_dps_s[0] + begin_dps_s[1] + steady_dps_s[0] + steady_dps_s[1] > 0.0;
  }
};

struct DriftModel {
  std::array<double, 2> walk_dps_rts{};  ///< K
  SlopeModel slopes{};
  /// σ of the coefficients before anything is learned, deg/s/K. Both zero: no such states.
  std::array<double, 2> temperature_dps_k{};
  std::array<std::array<GaussMarkov, model::kGaussMarkovMax>, 2> gauss_markov{};
  std::array<std::size_t, 2> gauss_markov_count{};
};

/// The measured quantities: both gyros' whole drifts at their present temperatures (deg/s), s
/// (relative) and τ (s):
///   y₁ − y₂ = B₁ − B₂ + s·Ω + τ·dΩ/dt
enum Observable : int { kBias1 = 0, kBias2 = 1, kScale = 2, kSkew = 3, kObservables = 4 };

/// rows ≤ 3 linear combinations of observables, as means over the window, and their noise.
struct DriftMeasurement {
  static constexpr int kRowsMax = 3;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, kObservables, 0, kRowsMax, kObservables>;
  using Values = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kRowsMax, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kRowsMax, kRowsMax>;
  Rows rows;
  Values values;
  Square noise;

  explicit DriftMeasurement(int row_count)
      : rows(Rows::Zero(row_count, kObservables)),
        values(Values::Zero(row_count)),
        noise(Square::Identity(row_count, row_count)) {}
};

class DriftFilter {
 public:
  static constexpr int kStatesMax = 8 + 2 * static_cast<int>(model::kGaussMarkovMax);
  using Observables = Eigen::Matrix<double, kObservables, 1>;
  using Covariance = Eigen::Matrix<double, kObservables, kObservables>;

  /// Drift of s and τ themselves, per √s: they follow temperature and clocks.
  static constexpr double kScaleWalk_rts = 1e-6;
  static constexpr double kSkewWalk_s_rts = 2e-6;

  /// Begins with the observables' mean and covariance; Gauss–Markov terms begin stationary and
  /// share in the biases' means. Temperatures begin at their reference.
  DriftFilter(const DriftModel& model, const Observables& mean, const Covariance& covariance);

  /// A window of length_s without a measurement.
  void predict(double length_s);
  /// A window of length_s with a measurement. Returns the log likelihood of its values, up to
  /// ½·log 2π a row.
  double update(double length_s, const DriftMeasurement& measurement);
  /// Additional uncertainty of both drifts: symmetric 2×2, variances and covariance.
  void widen(double variance_1, double covariance_12, double variance_2);
  /// One gyro's drift has jumped.
  void shift(std::size_t gyro, double by_dps, double variance);
  /// Gyro k is away_k[k] kelvin from the reference of its coefficient.
  void set_temperature(const std::array<double, 2>& away_k);
  /// Slopes, or temperature coefficients, from an earlier run: mean and covariance. Precondition:
  /// the model has these states.
  void set_slopes(const Eigen::Vector2d& mean_dps_s, const Eigen::Matrix2d& covariance);
  void set_coefficient(std::size_t gyro, double mean_dps_k, double variance);

  [[nodiscard]] bool has_slopes() const { return slopes_at_ >= 0; }
  [[nodiscard]] bool has_temperature() const { return temperature_at_ >= 0; }
  [[nodiscard]] Observables mean() const { return observe_ * state_; }
  [[nodiscard]] Covariance covariance() const;
  /// The slopes' mean and covariance, and their covariance with the drifts (row: drift, column:
  /// slope). Zero where the model has none.
  struct Slopes {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
    Eigen::Matrix2d with_drift = Eigen::Matrix2d::Zero();
  };
  [[nodiscard]] Slopes slopes() const;
  /// Mean and variance of a temperature coefficient. Precondition: has_temperature().
  [[nodiscard]] std::array<double, 2> coefficient(std::size_t gyro) const;
  /// Growth of each bias's variance, (deg/s)² per s, without the part of the slopes.
  [[nodiscard]] std::array<double, 2> growth_per_s() const;

 private:
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kStatesMax, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kStatesMax, kStatesMax>;
  using Observe = Eigen::Matrix<double, kObservables, Eigen::Dynamic, 0, kObservables, kStatesMax>;

  /// The states over a window: end = F·start + w, mean = M·start + lead·w + r. F and M are diagonal
  /// (carry, carry_mean) except for the effect of a slope on its drift.
  struct Transition {
    State carry;
    State carry_mean;
    State end_variance;  ///< of w, without the slopes' part
    State lead;
    State mean_variance;        ///< of r
    double slope_end_s = 0.0;   ///< effect of a slope on its drift's end
    double slope_mean_s = 0.0;  ///< effect of a slope on its drift's mean
  };
  [[nodiscard]] Transition transition(double length_s) const;
  void add_slope_noise(double length_s, Square& walked) const;
  template <int States, int Rows>
  class SizedUpdate;
  template <int States>
  [[nodiscard]] Covariance covariance_of() const;
  template <int States>
  double update_of(double length_s, const DriftMeasurement& measurement);

  DriftModel model_;
  int slopes_at_ = -1;
  int temperature_at_ = -1;
  Observe observe_;
  State state_;
  Square covariance_;
};

}  // namespace vgyro::fusion
