#pragma once

// Residuals made ready for the eye: on an even grid, over frequency, over averaging time, against
// what they may depend on. And how a gain in likelihood spreads over time and frequency.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "gap/noise.h"
#include "gap/observations.h"
#include "gap/result.h"

namespace vgyro::gap {

/// Which observations that a gyro takes part in.
enum class Sight : std::uint8_t { kOwn, kDifference, kBoth };
/// How the gyro's error shows in an observation: 1, −1 or, where it is not to be seen, 0.
double weight_of(Channel channel, std::size_t gyro, Sight sight);
/// Its own readings against a known rate, or the difference of the two: of which there are more.
Sight main_sight(const Observations& data, std::size_t gyro);

/// Values at even instants from time 0; 0 where there is none.
struct EvenSeries {
  double interval_s = 0.0;
  std::vector<double> value;
  std::vector<std::uint8_t> present;
};
EvenSeries even_series(const Observations& data, std::size_t gyro, Sight sight,
                       const Eigen::VectorXd& values);

/// √PSD, two-sided, so that white noise lies at its density in the model file; about 200 points.
Curve spectrum_curve(const EvenSeries& series, std::string label);
Curve allan_curve(const EvenSeries& series, std::string label);

/// The Allan deviation that the noise terms make together; `rate_square` as the mean of the motion.
double allan_deviation(const NoiseTerms& terms, double interval_s, double rate_square,
                       double tau_s);
/// The two-sided PSD that the noise terms make together; `rate_square` as the mean of the motion.
double noise_psd(const NoiseTerms& terms, double interval_s, double rate_square,
                 double frequency_hz);
/// Mean square of the rate over what a gyro takes part in.
double mean_rate_square(const Observations& data, std::size_t gyro);

/// A residual such as a model with this noise leaves.
Eigen::VectorXd simulate_residual(const Observations& data, const PairNoise& noise,
                                  std::uint64_t seed);

/// The effects' noise; fitted to the residual where they say nothing of a gyro's white noise.
PairNoise usable_noise(const Observations& data, const std::vector<model::Effect>& effects,
                       const Eigen::VectorXd& residual);

/// ΔlogL of each block when `with` is left instead of `without`.
std::vector<double> block_gains(const Layout& layout, const PairNoise& noise,
                                const Eigen::VectorXd& without, const Eigen::VectorXd& with);

/// The shortest stretch of time that holds 90 % of the gains, and the narrowest band that holds
/// 90 % of `shape`, seen above the noise.
Where where_of(const Observations& data, std::size_t gyro, const PairNoise& noise, double seconds,
               const std::vector<double>& gains, const Eigen::VectorXd& shape);

/// Means of a residual in bins of `against`, by least squares under the noise, so that drift counts
/// in the errors. `unit`: what a bin's value is times of; empty: 1.
struct Bins {
  std::vector<double> at;
  std::vector<std::vector<double>> value;  ///< of each residual
  std::vector<double> sigma;
};
Bins binned(const Observations& data, std::size_t gyro, const PairNoise& noise,
            const std::vector<const Eigen::VectorXd*>& residuals,
            const std::vector<double>& against, const std::vector<double>& unit);

}  // namespace vgyro::gap
