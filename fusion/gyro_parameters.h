#pragma once

// Noise and drift of one gyro in IEEE 952 terms. What is not given is estimated from the data.

#include <array>
#include <cstddef>
#include <optional>

#include "model/effect.h"

namespace vgyro::fusion {

/// Exponentially correlated drift: a usual model of bias instability.
struct GaussMarkov {
  double sigma_dps = 0.0;
  double tau_s = 1.0;

  friend bool operator==(const GaussMarkov&, const GaussMarkov&) = default;
};

struct GyroParameters {
  std::optional<double> white_dps_rthz;  ///< N, angle random walk
  std::optional<double> walk_dps_rts;    ///< K, rate random walk
  std::array<GaussMarkov, model::kGaussMarkovMax> gauss_markov{};
  std::size_t gauss_markov_count = 0;
  double rate_noise_rthz = 0.0;  ///< white noise of density rate_noise_rthz · |Ω|, on top of N
  double resolution_dps = 0.0;   ///< step of the values, 0 when unknown
  /// 1σ of the known delay of its readings; and, where the delay may as well be another gyro's, the
  /// part that both would have in common, so that neither contradicts the other.
  double lag_sigma_s = 0.0;
  double lag_common_sigma_s = 0.0;
  std::optional<double> max_bias_dps = {};  ///< largest bias that this gyro can have
  bool learns_temperature = false;  ///< its temperature is measured, its coefficient not given

  friend bool operator==(const GyroParameters&, const GyroParameters&) = default;
};

}  // namespace vgyro::fusion
