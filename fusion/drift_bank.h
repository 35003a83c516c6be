#pragma once

// What is known of the drifts when K, the drift's own size, is not: one filter for each pair of
// values that K₁ and K₂ may have, weighed by how well it foretold the data (Magill's adaptive
// estimator). Where the model gives K there is one filter. The spread between the filters is part
// of the covariance, so doubt of K is doubt of the bias.
//
// A scale-factor difference is shared out in proportion to N·K: the gyro that is quieter and drifts
// less is the one that is believed, but a vague K does not decide all.

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
  /// Of both gyros' scale factors, as far as their difference tells: variances and covariance.
  Symmetric scale_covariance{};
  /// Which gyro is likely the cause where the two differ about a turn: (N·K)² over the sum.
  std::array<double, 2> blame{};
  std::array<double, 2> drift_share{};  ///< K_k² over K₁² + K₂²
};

class DriftBank {
 public:
  /// Prior doubt of the two gyros' scale-factor difference and time skew.
  static constexpr double kScaleSigma = 0.01;
  static constexpr double kSkewSigma_s = 0.02;
  /// Evidence for one K fades: sensors age and environments change.
  static constexpr double kMemory_s = 7200.0;

  explicit DriftBank(const std::array<GyroParameters, 2>& gyros);

  /// Both drifts measured for the first time. The white noise sets the scale of the K that are
  /// tried.
  void begin(const std::array<double, 2>& white_dps_rthz, const std::array<double, 2>& bias_dps,
             const Symmetric& covariance);
  /// From a memory, aged.
  void resume(const DriftMemory& memory, double age_s);

  void predict(double length_s);
  void learn(double length_s, const DriftMeasurement& measurement);
  void widen(double variance_1, double covariance_12, double variance_2);

  [[nodiscard]] DriftEstimate estimate() const;
  [[nodiscard]] bool single() const { return hypotheses_.size() == 1; }
  [[nodiscard]] bool empty() const { return hypotheses_.empty(); }
  void save(DriftMemory& memory) const;

 private:
  struct Hypothesis {
    DriftFilter filter;
    double scale_share = 0.5;  ///< of gyro 1 in the scale-factor difference
    double log_prior = 0.0;
    double log_weight = 0.0;
    std::size_t place = 0;  ///< in DriftMemory::walk_weight
  };
  void make(const std::array<double, 2>& white_dps_rthz, const DriftFilter::Observables& mean,
            const DriftFilter::Covariance& covariance);
  void normalize();

  std::array<GyroParameters, 2> gyros_;
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace vgyro::fusion
