#pragma once

// The random part of two gyros, and the likelihood of what was observed under it. Observations are
// cut into short blocks. Inside a block drift stands still: what is left of white noise there is
// judged by its sum of squares. The means of the blocks go through a Kalman filter of the drifts,
// random walk and some exponentially correlated terms for each gyro.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "model/effect.h"
#include "model/flicker.h"

namespace vgyro::gap {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Of what is only ranked: half the memory.
using FloatMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct MarkovTerm {
  double sigma_dps = 0.0;
  double tau_s = 1.0;
};

/// Flicker noise is looked at as so many terms, a decade apart: quicker ones than a sample of 100
/// Hz would fold into white noise, slower ones are a bias.
inline constexpr std::size_t kFlickerTerms = 6;
inline constexpr double kFlickerFrom_s = 0.004;
inline constexpr double kFlickerTo_s = 4000.0;

/// One gyro's.
struct NoiseTerms {
  double white_dps_rthz = 0.0;
  double ratio_rthz = 0.0;  ///< white noise of this times the rate
  double walk_dps_rts = 0.0;
  std::vector<MarkovTerm> markov;
  double step_dps = 0.0;     ///< rounding: variance step²/12 in each sample
  double flicker_dps = 0.0;  ///< bias instability

  /// Every exponentially correlated term: those of the flicker noise, then `markov`.
  template <class Visit>
  void each_correlated(const Visit& visit) const {
    for (std::size_t i = 0; flicker_dps > 0.0 && i < kFlickerTerms; ++i) {
      const model::FlickerTerm term =
          model::flicker_term(flicker_dps, i, kFlickerTerms, kFlickerFrom_s, kFlickerTo_s);
      visit(MarkovTerm{term.sigma_dps, term.tau_s});
    }
    for (const MarkovTerm& term : markov)
      visit(term);
  }

  /// Variance of one sample.
  [[nodiscard]] double variance(double rate_square, double interval_s) const {
    return (white_dps_rthz * white_dps_rthz + ratio_rthz * ratio_rthz * rate_square) / interval_s +
           step_dps * step_dps / 12.0;
  }
};
using PairNoise = std::array<NoiseTerms, 2>;
/// What a model file and the corrector can hold of them; no more are named.
inline constexpr std::size_t kMarkovNamedMax = model::kGaussMarkovMax;
/// A fit allows one more, which no effect may pass for.
inline constexpr std::size_t kMarkovMax = kMarkovNamedMax + 1;

/// What a model's effects of nature kNoise say, densities adding in squares.
PairNoise noise_of(const std::vector<model::Effect>& effects);

/// What an observation is of.
enum class Channel : std::uint8_t { kGyro1, kGyro2, kDifference };
constexpr double share_of(Channel channel, std::size_t gyro) {
  if (channel == Channel::kDifference) return gyro == 0 ? 1.0 : -1.0;
  return static_cast<std::size_t>(channel) == gyro ? 1.0 : 0.0;
}

/// What motion between the samples does to a block, over the power of the fast motion in it. A
/// block of n samples is its mean and the cosines k = 1 to n − 1, of k half periods each.
struct UnseenMotion {
  double mean = 0.0;           ///< variance of the block's mean
  std::vector<double> cosine;  ///< of the k-th cosine's, k from 1 on, of those that can be compared
  double lost_hz = 0.0;        ///< from here on the motion cannot be compared; 0: all can
  double all = 0.0;            ///< variance of a sample, with what cannot be compared
};

/// Samples of one channel that follow each other within kBlock_s.
struct Block {
  double t_s = 0.0;  ///< mean of its instants
  Channel channel = Channel::kGyro1;
  std::uint32_t first = 0;  ///< of the samples
  std::uint32_t count = 0;
  double rate_square = 0.0;  ///< mean, (deg/s)²
  /// What interpolation makes of the noise of gyro 1, of gyro 2 and of the reference: expected
  /// scatter about the block's mean, and variance of that mean, over the variance of one sample.
  std::array<double, 3> within_gain{};
  std::array<double, 3> mean_gain{};
  /// Power of the fast motion in it, (deg/s)²: gap/unseen_motion.
  double motion_power = 0.0;
  bool compared = false;  ///< with another stream, which samples the motion at other instants
  std::uint32_t kept =
      0;  ///< dimensions that count beside the mean: all, or cosines from the slowest
  bool held_out = false;
  /// First of a further recording: drift begins anew there, and the gyros' biases with it.
  bool begins = false;
};
inline constexpr double kBlock_s = 0.1;

struct Layout {
  std::vector<Block> blocks;  ///< in the order of time
  std::array<double, 2> interval_s{};
  double reference_variance = 0.0;  ///< of the rate that the readings are compared with, (deg/s)²
  std::size_t samples = 0;
  double block_s = kBlock_s;  ///< usual length of a block
  UnseenMotion unseen;
};

/// Of a sample about its block's mean: white noise, and what drift moves within a block.
double within_variance(const Block& block, const PairNoise& noise, const Layout& layout);
/// Without the drift.
double sample_variance(const Block& block, const PairNoise& noise, const Layout& layout);
/// Of the block's mean without the drift.
double mean_variance(const Block& block, const PairNoise& noise, const Layout& layout);

/// Which blocks count.
enum class Part : std::uint8_t { kFit, kHeldOut, kAll };
inline bool counts(const Block& block, Part part) {
  return part == Part::kAll || block.held_out == (part == Part::kHeldOut);
}

/// Columns over all samples → means of blocks.
Matrix block_means(const Matrix& columns, const Layout& layout);

/// The slowest cosines of a block, orthonormal: cosines × samples.
Matrix slowest_cosines(std::uint32_t samples, std::uint32_t cosines);
/// Variance of its k-th cosine, k from 1 on.
double cosine_variance(const Block& block, std::uint32_t k, const PairNoise& noise,
                       const Layout& layout);
/// How many of its cosines lie below a frequency.
std::uint32_t cosines_below(const Block& block, double frequency_hz, const Layout& layout);
/// Dimensions that count, of all its samples.
inline std::uint32_t dimensions(const Block& block) {
  return block.kept + 1;
}

/// Block means → normalised innovations, in place; rows of blocks that do not count are zeroed.
/// Returns −½ Σ log of the innovations' variances over the blocks that count.
double whiten_means(Matrix& means, const Layout& layout, const PairNoise& noise, Part part);

/// Samples → deviations from their block's mean in units of the noise, in place. Zeroes rows and
/// returns −½ Σ log of variances as whiten_means() does. Of a block in fast motion the first rows
/// are the cosines that are kept, the others zero.
double whiten_within(Matrix& columns, const Layout& layout, const PairNoise& noise, Part part);

/// Samples → what whiten_within makes of them, but for the noise, which weighs rows.
template <class Columns>
void turn_within(Columns& columns, const Layout& layout);
/// 1/variance of each row of these; 0 where it does not count.
Eigen::VectorXd within_weights(const Layout& layout, const PairNoise& noise, Part part);

/// What is needed of a residual to fit white noise: sums of squares within blocks, by channel and
/// rate.
struct WithinBin {
  Channel channel = Channel::kGyro1;
  double rate_square = 0.0;
  std::array<double, 3> gain{};
  double motion = 0.0;   ///< what motion between the samples adds, (deg/s)²
  double seconds = 0.0;  ///< length of its blocks
  double freedom = 0.0;
  double squares = 0.0;
};
std::vector<WithinBin> within_bins(const Eigen::VectorXd& residual, const Layout& layout,
                                   Part part);
double within_log_likelihood(const std::vector<WithinBin>& bins, const PairNoise& noise,
                             const Layout& layout);
double means_log_likelihood(const Eigen::VectorXd& means, const Layout& layout,
                            const PairNoise& noise, Part part);

/// Which terms of a gyro are free in a fit.
struct Freedom {
  bool white = true;
  bool ratio = true;
  bool walk = true;
  bool markov = false;  ///< one further exponentially correlated term
  bool flicker = false;
};

struct NoiseFitResult {
  PairNoise noise;
  double log_likelihood = 0.0;  ///< of both parts; constants left out
};

/// Maximum likelihood over the free terms; `start` is where the search begins and what the others
/// stay at. `used[gyro]`: the layout holds observations of it.
NoiseFitResult fit_pair_noise(const Eigen::VectorXd& residual, const Layout& layout,
                              const PairNoise& start, const std::array<Freedom, 2>& free,
                              const std::array<bool, 2>& used, Part part);

double log_likelihood(const Eigen::VectorXd& residual, const Layout& layout, const PairNoise& noise,
                      Part part);

}  // namespace vgyro::gap
