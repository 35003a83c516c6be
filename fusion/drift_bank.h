#pragma once

// Estimates the drifts when neither their size nor their kind is known: one filter for each kind
// of drift and each pair of values of K₁ and K₂, weighted by how well it predicted the
// data (Magill's adaptive estimator). The kinds: a walk alone; a gyro that warms up; slopes that
// come and go, in each gyro by itself or in both alike. Where the model gives K there is one filter
// a kind. The spread between the filters is part of the covariance, so uncertainty of K is
// uncertainty of the bias.
//
// A scale-factor difference is divided in proportion to N·K: the gyro that is quieter and drifts
// less gets the smaller share, but an uncertain K does not decide alone.

#include <array>
#include <vector>

#include "fusion/drift_filter.h"
#include "fusion/drift_memory.h"
#include "fusion/gyro_parameters.h"
#include "fusion/quadratic.h"

namespace vgyro::fusion {

struct DriftEstimate {
  DriftFilter::Observables mean = DriftFilter::Observables::Zero();
  DriftFilter::Covariance covariance = DriftFilter::Covariance::Zero();
  std::array<double, 2> growth{};  ///< of the biases' variances, (deg/s)²/s
  std::array<double, 2> scale{};   ///< share of each gyro in the scale-factor difference
  /// Variances and covariance of both gyros' scale factors, as known from their difference.
  Symmetric scale_covariance{};
  /// Which gyro is likely the cause where the two differ about a turn: (N·K)² over the sum.
  std::array<double, 2> blame{};
  std::array<double, 2> drift_share{};  ///< K_k² over K₁² + K₂²
  /// Slopes of the biases, deg/s², their covariance, and that with the biases (row: bias).
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  Eigen::Matrix2d slope_covariance = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d slope_with_bias = Eigen::Matrix2d::Zero();
  std::array<double, kDriftKinds> kind_weight{};  ///< probability of each kind of drift
};

/// Moments of a mixture: adds its parts in proportion to their weights.
class EstimateMixer {
 public:
  /// The weights must add up to 1.
  void add(double weight, const DriftEstimate& part);
  [[nodiscard]] DriftEstimate result() const;

 private:
  bool any_ = false;
  DriftEstimate origin_;
  DriftEstimate sum_;  ///< moments about the first part's
  Eigen::Matrix<double, 6, 1> first_ = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> second_ = Eigen::Matrix<double, 6, 6>::Zero();
  Symmetric scale_square_{};
};

class DriftBank {
 public:
  /// Prior σ of the two gyros' scale-factor difference and time skew.
  static constexpr double kScaleSigma = 0.01;
  static constexpr double kSkewSigma_s = 0.02;
  /// Evidence for one K fades: sensors age and environments change.
  static constexpr double kMemory_s = 7200.0;

  explicit DriftBank(const std::array<GyroParameters, 2>& gyros);

  /// Both drifts measured for the first time. The white noise sets the scale of the K that are
  /// tried.
  void begin(const std::array<double, 2>& white_dps_rthz, const std::array<double, 2>& bias_dps,
             const Symmetric& covariance);
  /// Continues from a memory that is `age_s` seconds old.
  void resume(const DriftMemory& memory, double age_s);

  void predict(double length_s);
  /// Returns the log density of the measurement's values.
  double learn(double length_s, const DriftMeasurement& measurement);
  void widen(double variance_1, double covariance_12, double variance_2);
  /// One gyro's drift has jumped.
  void shift(std::size_t gyro, double by_dps, double variance);
  /// The gyros' temperatures: coefficients count from the first one. A NaN is ignored.
  void set_temperature(const std::array<double, 2>& temperature_c);
  /// The temperatures of the next measurement, if they differ from the present ones.
  void observe_at(const std::array<double, 2>& temperature_c);

  [[nodiscard]] DriftEstimate estimate() const;
  /// N² of a gyro, as given to begin() or resume().
  [[nodiscard]] double white_density(std::size_t gyro) const {
    return squared(white_dps_rthz_[gyro]);
  }
  [[nodiscard]] bool few() const { return filters_.size() <= kDriftKinds; }
  [[nodiscard]] bool empty() const { return filters_.empty(); }
  void save(DriftMemory& memory) const;

 private:
  struct WeighedFilter {
    DriftFilter filter;
    double scale_share = 0.5;  ///< of gyro 1 in the scale-factor difference
    double log_prior = 0.0;
    double log_weight = 0.0;
    std::size_t place = 0;  ///< in DriftMemory::walk_weight
    std::size_t kind = 0;   ///< in DriftMemory::kind_weight
  };
  void make(const std::array<double, 2>& white_dps_rthz, const DriftFilter::Observables& mean,
            const DriftFilter::Covariance& covariance);
  void make_kind(std::size_t kind, const std::array<double, 2>& white_dps_rthz,
                 const DriftFilter::Observables& mean, const DriftFilter::Covariance& covariance);
  [[nodiscard]] double prior_of(std::size_t kind) const;
  void weigh_as(const DriftMemory& memory);
  [[nodiscard]] double usual_scale_doubt(double difference, double variance) const;
  void take_slopes(const DriftMemory& memory);
  void take_coefficients(const DriftMemory& memory);
  /// Returns the logarithm of the sum that the weights had.
  double normalize();

  std::array<GyroParameters, 2> gyros_;
  std::array<double, 2> white_dps_rthz_{};
  std::array<double, 2> reference_c_{};  ///< temperature at which the coefficients begin
  std::array<bool, 2> has_reference_{};
  std::array<double, 2> away_k_{};
  std::vector<WeighedFilter> filters_;
};

}  // namespace vgyro::fusion
