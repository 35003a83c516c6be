#pragma once

// A corrector's memory of two gyros, so that a restart needs no new calibration. Plain numbers: the
// caller decides on the format. Rates deg/s.

#include <array>
#include <cstddef>

namespace vgyro::fusion {

/// Values of K over N that the optimal corrector weighs against each other where K is not given,
/// 1/s.
inline constexpr std::array<double, 9> kWalkRatios_per_s{1e-3,   3.2e-3, 5.6e-3, 1e-2, 1.8e-2,
                                                         3.2e-2, 5.6e-2, 1e-1,   2e-1};
inline constexpr std::size_t kWalkPairs = kWalkRatios_per_s.size() * kWalkRatios_per_s.size();

/// Kinds of drift that the optimal corrector weighs against each other: the walk alone, warming up
/// fast, warming up slowly, slopes that come and go in each gyro by itself, and in both alike.
inline constexpr std::size_t kDriftKinds = 5;

struct DriftMemory {
  std::array<double, 2> bias_dps{};
  std::array<double, 3> bias_covariance{};  ///< of gyro 1, of both, of gyro 2; (deg/s)²
  std::array<double, 3> white_density{};    ///< N₁², N₁N₂ρ, N₂²; (deg/s)²/Hz
  std::array<double, 2> sample_variance{};  ///< of one raw sample about the rate; (deg/s)²
  /// Probability of each pair of ratios, gyro 2's ratio varying faster; sums to 1.
  std::array<double, kWalkPairs> walk_weight{};
  double scale_difference = 0.0;  ///< gyro 1 less gyro 2, relative
  double scale_difference_sigma = 0.0;
  double skew_s = 0.0;  ///< gyro 2 is later than gyro 1
  double skew_sigma_s = 0.0;

  // Absent from older memories: a σ or a sum of 0 means "not known".
  std::array<double, kDriftKinds> kind_weight{};    ///< probability of each kind of drift
  std::array<double, 2> slope_dps_s{};              ///< of the biases
  std::array<double, 2> slope_sigma_dps_s{};        ///< 1σ
  std::array<double, 2> coefficient_dps_k{};        ///< of the biases, per kelvin
  std::array<double, 2> coefficient_sigma_dps_k{};  ///< 1σ
  std::array<double, 2> temperature_c{};            ///< at which the biases hold
  std::array<bool, 2> has_temperature{};            ///< that temperature_c is known
};

}  // namespace vgyro::fusion
