#pragma once

// Kalman filter over the drifts of two gyros, fed one window at a time. The states are the random
// walks b₁, b₂, the scale-factor difference s and the time skew τ of the two gyros, and the
// Gauss–Markov terms of the model. A window measures the *mean* of a drift over its length; the
// filter treats the mean exactly, so that long windows lose nothing but time. The covariance is a
// sum of squares at every step (Joseph form): it stays symmetric and positive for ever.

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "fusion/gyro_parameters.h"

namespace vgyro::fusion {

struct DriftModel {
  std::array<double, 2> walk_dps_rts{};  ///< K
  std::array<std::array<GaussMarkov, GyroParameters::kGaussMarkovMax>, 2> gauss_markov{};
  std::array<std::size_t, 2> gauss_markov_count{};
};

/// What measurements speak of: both gyros' whole drifts (deg/s), s (relative) and τ (s):
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
  static constexpr int kStatesMax = 4 + 2 * static_cast<int>(GyroParameters::kGaussMarkovMax);
  using Observables = Eigen::Matrix<double, kObservables, 1>;
  using Covariance = Eigen::Matrix<double, kObservables, kObservables>;

  /// Drift of s and τ themselves, per √s: they follow temperature and clocks.
  static constexpr double kScaleWalk_rts = 1e-6;
  static constexpr double kSkewWalk_s_rts = 2e-6;

  /// Begins with the observables' mean and covariance; Gauss–Markov terms begin stationary and
  /// share in the biases' means.
  DriftFilter(const DriftModel& model, const Observables& mean, const Covariance& covariance);

  /// A window of length_s without a measurement.
  void predict(double length_s);
  /// A window of length_s with a measurement. Returns the log likelihood of its values, up to a
  /// constant that depends on the number of rows alone.
  double update(double length_s, const DriftMeasurement& measurement);
  /// More doubt of both drifts: symmetric 2×2, as variances and covariance.
  void widen(double variance_1, double covariance_12, double variance_2);

  [[nodiscard]] Observables mean() const { return observe_ * state_; }
  [[nodiscard]] Covariance covariance() const {
    return observe_ * covariance_ * observe_.transpose();
  }
  /// How the variance of each bias grows, (deg/s)² per s.
  [[nodiscard]] std::array<double, 2> growth_per_s() const;

 private:
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kStatesMax, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kStatesMax, kStatesMax>;
  using Observe = Eigen::Matrix<double, kObservables, Eigen::Dynamic, 0, kObservables, kStatesMax>;

  /// One state over a window: end = carry·start + w, mean = carry_mean·start + lead·w + r.
  struct Motion {
    State carry;
    State carry_mean;
    State end_variance;  ///< of w
    State lead;
    State mean_variance;  ///< of r
  };
  [[nodiscard]] Motion motion(double length_s) const;
  template <int States, int Rows>
  double update_sized(double length_s, const DriftMeasurement& measurement);

  DriftModel model_;
  Observe observe_;
  State state_;
  Square covariance_;
};

}  // namespace vgyro::fusion
