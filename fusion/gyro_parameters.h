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
  /// Doubt of how late its readings are known to come; and, where that is another gyro's as likely,
  /// the part that neither would contradict.
  double lag_sigma_s = 0.0;
  double lag_common_sigma_s = 0.0;
  std::optional<double> max_bias_dps = {};  ///< largest bias that this gyro can have
  bool learns_temperature = false;  ///< its temperature is known, what it does to the bias is not

  friend bool operator==(const GyroParameters&, const GyroParameters&) = default;
};

}  // namespace vgyro::fusion
