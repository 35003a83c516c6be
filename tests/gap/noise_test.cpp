#include "gap/noise.h"

#include <cmath>
#include <random>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

namespace vgyro::gap {
namespace {

PairNoise some_noise() {
  PairNoise noise;
  noise[0] = {0.004, 2e-4, 0.003, {{0.02, 1.5}}, 0.01};
  noise[1] = {0.006, 0.0, 0.002, {{0.01, 4.0}, {0.005, 0.4}}, 0.0};
  return noise;
}

// Blocks of 5 samples, each channel in turn, a quarter of a second apart.
Layout some_layout(std::size_t blocks) {
  Layout layout;
  layout.interval_s = {0.02, 0.05};
  layout.reference_variance = 1e-6;
  for (std::size_t b = 0; b < blocks; ++b) {
    Block block;
    block.t_s = 0.2 + 0.25 * static_cast<double>(b);
    block.channel = static_cast<Channel>(b % 3);
    block.first = static_cast<std::uint32_t>(5 * b);
    block.count = 5;
    block.rate_square = 400.0;
    block.within_gain = {block.channel == Channel::kGyro2 ? 0.0 : 1.0,
                         block.channel == Channel::kGyro1 ? 0.0 : 1.0, 1.0};
    for (std::size_t i = 0; i < 3; ++i)
      block.mean_gain[i] = block.within_gain[i] / block.count;
    layout.blocks.push_back(block);
  }
  layout.samples = 5 * blocks;
  return layout;
}

// Variance of a sample, from the definitions of the terms.
double variance_of(const Block& block, const PairNoise& noise, const Layout& layout) {
  double variance = layout.reference_variance;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (share_of(block.channel, gyro) == 0.0) continue;
    const NoiseTerms& n = noise[gyro];
    variance += std::pow(n.white_dps_rthz, 2) / layout.interval_s[gyro] +
                std::pow(n.ratio_rthz, 2) * block.rate_square / layout.interval_s[gyro] +
                n.step_dps * n.step_dps / 12.0;
  }
  return variance;
}

double drift_covariance(const Block& a, const Block& b, const PairNoise& noise) {
  double covariance = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    double of_gyro = std::pow(noise[gyro].walk_dps_rts, 2) * std::min(a.t_s, b.t_s);
    for (const MarkovTerm& term : noise[gyro].markov) {
      of_gyro += term.sigma_dps * term.sigma_dps * std::exp(-std::abs(a.t_s - b.t_s) / term.tau_s);
    }
    covariance += share_of(a.channel, gyro) * share_of(b.channel, gyro) * of_gyro;
  }
  return covariance;
}

// Variance of the drift about its mean over a block, by adding up its covariance.
double drift_about_mean(const Block& block, const PairNoise& noise, const Layout& layout) {
  const double length_s = block.count * layout.interval_s[block.channel == Channel::kGyro2 ? 1 : 0];
  constexpr int kParts = 400;
  double at_one = 0.0;
  double at_two = 0.0;
  for (int i = 0; i < kParts; ++i) {
    Block a = block;
    a.t_s = length_s * (i + 0.5) / kParts;
    at_one += drift_covariance(a, a, noise) / kParts;
    for (int j = 0; j < kParts; ++j) {
      Block b = block;
      b.t_s = length_s * (j + 0.5) / kParts;
      at_two += drift_covariance(a, b, noise) / kParts / kParts;
    }
  }
  return at_one - at_two;
}

// In a block all samples share the mean of the drift; what drift moves about that is taken for
// white, and moves the mean by nothing.
Eigen::MatrixXd dense_covariance(const Layout& layout, const PairNoise& noise) {
  const auto n = static_cast<Eigen::Index>(layout.samples);
  Eigen::MatrixXd covariance(n, n);
  for (const Block& a : layout.blocks) {
    for (const Block& b : layout.blocks) {
      covariance.block(a.first, b.first, a.count, b.count)
          .setConstant(drift_covariance(a, b, noise));
    }
    const double moving = drift_about_mean(a, noise, layout);
    auto own = covariance.block(a.first, a.first, a.count, a.count);
    own.array() -= moving / a.count + moving;
    for (std::uint32_t i = a.first; i < a.first + a.count; ++i)
      covariance(i, i) += variance_of(a, noise, layout) + moving;
  }
  return covariance;
}

Eigen::VectorXd drawn(const Eigen::MatrixXd& covariance, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd white(covariance.rows());
  for (double& value : white)
    value = normal(random);
  return Eigen::LLT<Eigen::MatrixXd>(covariance).matrixL() * white;
}

// Less the constant that ours leaves out.
double dense_log_likelihood(const Eigen::VectorXd& residual, const Layout& layout,
                            const PairNoise& noise) {
  const Eigen::MatrixXd covariance = dense_covariance(layout, noise);
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::MatrixXd lower = factor.matrixL();
  return -lower.diagonal().array().log().sum() - 0.5 * residual.dot(factor.solve(residual));
}

// What the likelihood rests on: a mean's variance is that of the drift at its middle less its
// scatter.
TEST(Noise, MeanOfADriftScattersLessThanTheDriftByItsScatterWithinTheBlock) {
  const PairNoise noise = some_noise();
  const Layout layout = some_layout(6);
  for (const Block& block : layout.blocks) {
    const double length_s =
        block.count * layout.interval_s[block.channel == Channel::kGyro2 ? 1 : 0];
    constexpr int kParts = 400;
    double of_mean = 0.0;
    Block a = block;
    Block b = block;
    for (int i = 0; i < kParts; ++i) {
      a.t_s = block.t_s + length_s * ((i + 0.5) / kParts - 0.5);
      for (int j = 0; j < kParts; ++j) {
        b.t_s = block.t_s + length_s * ((j + 0.5) / kParts - 0.5);
        of_mean += drift_covariance(a, b, noise) / kParts / kParts;
      }
    }
    const double at_middle = drift_covariance(block, block, noise);
    EXPECT_NEAR(of_mean, at_middle - drift_about_mean(block, noise, layout), 1e-5 * at_middle);
  }
}

TEST(Noise, LogLikelihoodIsThatOfADenseNormalUpToAConstant) {
  const Layout layout = some_layout(40);
  const PairNoise noise = some_noise();
  const Eigen::VectorXd residual = drawn(dense_covariance(layout, noise), 11);
  // A block's mean and deviations for its samples: ½ log of their number, whatever the noise.
  const double constant = -0.5 * 40.0 * std::log(5.0);
  for (const double factor : {0.5, 1.0, 3.0}) {
    PairNoise other = noise;
    other[0].walk_dps_rts *= factor;
    other[0].white_dps_rthz *= factor;
    other[1].markov[0].sigma_dps *= factor;
    EXPECT_NEAR(log_likelihood(residual, layout, other, Part::kAll) + constant,
                dense_log_likelihood(residual, layout, other), 1e-4)
        << factor;
  }
}

TEST(Noise, PartsOfTheBlocksTakeNoneOfTheOthersIn) {
  Layout layout = some_layout(40);
  for (std::size_t b = 0; b < 40; b += 4)
    layout.blocks[b].held_out = true;
  const PairNoise noise = some_noise();
  const Eigen::VectorXd residual = drawn(dense_covariance(layout, noise), 12);
  const double all = log_likelihood(residual, layout, noise, Part::kAll);
  const double parts = log_likelihood(residual, layout, noise, Part::kFit) +
                       log_likelihood(residual, layout, noise, Part::kHeldOut);
  // Each innovation is told by all before it, and counts once.
  EXPECT_NEAR(all, parts, 1e-8);
}

TEST(Noise, WhitenedNoiseHasUnitVariance) {
  const Layout layout = some_layout(300);
  const PairNoise noise = some_noise();
  Matrix column = drawn(dense_covariance(layout, noise), 13);
  Matrix means = block_means(column, layout);
  whiten_within(column, layout, noise, Part::kAll);
  whiten_means(means, layout, noise, Part::kAll);
  const double freedom = 4.0 * 300.0;
  EXPECT_NEAR(column.squaredNorm() / freedom, 1.0, 5.0 * std::sqrt(2.0 / freedom));
  EXPECT_NEAR(means.squaredNorm() / 300.0, 1.0, 5.0 * std::sqrt(2.0 / 300.0));
  double product = 0.0;
  for (Eigen::Index i = 1; i < means.rows(); ++i)
    product += means(i, 0) * means(i - 1, 0);
  EXPECT_NEAR(product / 299.0, 0.0, 5.0 / std::sqrt(299.0));
}

TEST(Noise, FitFindsWhatWasDrawn) {
  Layout layout = some_layout(1200);
  for (Block& block : layout.blocks) {
    block.channel = Channel::kGyro1;
    block.within_gain = {1.0, 0.0, 0.0};
    block.mean_gain = {1.0 / block.count, 0.0, 0.0};
  }
  layout.reference_variance = 0.0;
  PairNoise noise;
  noise[0].white_dps_rthz = 0.004;
  noise[0].walk_dps_rts = 0.003;
  std::mt19937_64 random(14);
  std::normal_distribution<double> normal;
  Eigen::VectorXd residual(static_cast<Eigen::Index>(layout.samples));
  double walk_dps = 0.0;
  double last_s = 0.0;
  for (const Block& block : layout.blocks) {
    walk_dps += 0.003 * std::sqrt(block.t_s - last_s) * normal(random);
    last_s = block.t_s;
    for (std::uint32_t i = 0; i < block.count; ++i)
      residual[block.first + i] = walk_dps + 0.004 / std::sqrt(0.02) * normal(random);
  }
  const Freedom free{true, false, true, false};
  const NoiseFitResult fit =
      fit_pair_noise(residual, layout, PairNoise{}, {free, free}, {true, false}, Part::kAll);
  // 4800 deviations within blocks; the walk is told by 1200 means in about as much white noise.
  EXPECT_NEAR(fit.noise[0].white_dps_rthz / 0.004, 1.0, 5.0 / std::sqrt(2.0 * 4800.0));
  EXPECT_NEAR(fit.noise[0].walk_dps_rts / 0.003, 1.0, 0.4);
}

}  // namespace
}  // namespace vgyro::gap
