#include "gap/noise.h"

#include <cmath>
#include <map>
#include <random>
#include <utility>

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
  std::map<std::pair<Channel, std::uint32_t>, double> about_mean;  // dear, and the same for many
  for (const Block& a : layout.blocks) {
    for (const Block& b : layout.blocks) {
      covariance.block(a.first, b.first, a.count, b.count)
          .setConstant(drift_covariance(a, b, noise));
    }
    const auto [known, is_new] = about_mean.try_emplace({a.channel, a.count});
    if (is_new) known->second = drift_about_mean(a, noise, layout);
    const double moving = known->second;
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

// Blocks of uneven size and distance, a pause of a minute among them.
Layout uneven_layout(std::size_t blocks) {
  Layout layout = some_layout(blocks);
  std::mt19937_64 random(21);
  std::uniform_int_distribution<std::uint32_t> count(1, 6);
  std::uint32_t first = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    Block& block = layout.blocks[b];
    block.first = first;
    block.count = count(random);
    first += block.count;
    block.t_s += b > blocks / 2 ? 60.0 : 0.0;
    block.rate_square = b % 2 == 0 ? 0.0 : 900.0;
    for (std::size_t i = 0; i < 3; ++i)
      block.mean_gain[i] = block.within_gain[i] / block.count;
  }
  layout.samples = first;
  return layout;
}

TEST(Noise, LogLikelihoodIsThatOfADenseNormalForUnevenBlocksToo) {
  const Layout layout = uneven_layout(60);
  const PairNoise noise = some_noise();
  double constant = 0.0;
  for (const Block& block : layout.blocks)
    constant -= 0.5 * std::log(static_cast<double>(block.count));
  for (const std::uint64_t seed : {22U, 23U, 24U}) {
    const Eigen::VectorXd residual = drawn(dense_covariance(layout, noise), seed);
    EXPECT_NEAR(log_likelihood(residual, layout, noise, Part::kAll) + constant,
                dense_log_likelihood(residual, layout, noise), 0.05)
        << "seed " << seed;
  }
}

// Likewise the ratio of two models, which decides; the constants fall out.
TEST(Noise, RatioOfLikelihoodsOfUnevenBlocksIsThatOfDenseNormals) {
  const Layout layout = uneven_layout(60);
  const PairNoise noise = some_noise();
  const Eigen::VectorXd residual = drawn(dense_covariance(layout, noise), 25);
  PairNoise other = noise;
  other[0].walk_dps_rts *= 2.0;
  other[1].white_dps_rthz *= 1.2;
  other[0].markov.clear();
  const double ours = log_likelihood(residual, layout, other, Part::kAll) -
                      log_likelihood(residual, layout, noise, Part::kAll);
  const double dense =
      dense_log_likelihood(residual, layout, other) - dense_log_likelihood(residual, layout, noise);
  EXPECT_NEAR(ours, dense, 0.05);
}

TEST(Noise, ColumnsAreWhitenedAsEachAlone) {
  const Layout layout = uneven_layout(80);
  const PairNoise noise = some_noise();
  const Eigen::MatrixXd covariance = dense_covariance(layout, noise);
  Matrix columns(static_cast<Eigen::Index>(layout.samples), 3);
  for (Eigen::Index c = 0; c < 3; ++c)
    columns.col(c) = drawn(covariance, 26 + static_cast<std::uint64_t>(c));
  const Matrix means = block_means(columns, layout);
  Matrix together = means;
  const double log_together = whiten_means(together, layout, noise, Part::kAll);
  for (Eigen::Index c = 0; c < 3; ++c) {
    Matrix alone = means.col(c);
    EXPECT_EQ(whiten_means(alone, layout, noise, Part::kAll), log_together);
    EXPECT_EQ(alone.col(0), together.col(c));
  }
}

// The filter is linear: what it makes of a sum is the sum of what it makes of each.
TEST(Noise, WhiteningIsLinear) {
  const Layout layout = uneven_layout(80);
  const PairNoise noise = some_noise();
  Matrix columns(static_cast<Eigen::Index>(layout.samples), 3);
  columns.setRandom();
  columns.col(2) = columns.col(0) - 3.0 * columns.col(1);
  Matrix means = block_means(columns, layout);
  whiten_means(means, layout, noise, Part::kAll);
  const Eigen::VectorXd sum = means.col(0) - 3.0 * means.col(1);
  EXPECT_LT((means.col(2) - sum).cwiseAbs().maxCoeff(), 1e-9 * sum.cwiseAbs().maxCoeff());
}

TEST(Noise, WhitenedRowsOfTheOtherPartAreZero) {
  Layout layout = uneven_layout(40);
  for (std::size_t b = 0; b < 40; b += 3)
    layout.blocks[b].held_out = true;
  const PairNoise noise = some_noise();
  Matrix column = drawn(dense_covariance(layout, noise), 29);
  Matrix means = block_means(column, layout);
  whiten_within(column, layout, noise, Part::kFit);
  whiten_means(means, layout, noise, Part::kFit);
  for (std::size_t b = 0; b < 40; ++b) {
    const Block& block = layout.blocks[b];
    const double within = column.middleRows(block.first, block.count).squaredNorm();
    EXPECT_EQ(means(static_cast<Eigen::Index>(b), 0) == 0.0, block.held_out);
    if (block.count > 1) {
      EXPECT_EQ(within == 0.0, block.held_out);
    }
  }
}

// Drawn anew many times: their mean square is 1 within four of its errors, in every channel.
TEST(Noise, InnovationsAreWhiteInEachChannel) {
  const Layout layout = some_layout(90);
  const PairNoise noise = some_noise();
  const Eigen::MatrixXd covariance = dense_covariance(layout, noise);
  const Eigen::MatrixXd lower = Eigen::LLT<Eigen::MatrixXd>(covariance).matrixL();
  constexpr int kDraws = 200;
  std::mt19937_64 random(30);
  std::normal_distribution<double> normal;
  Matrix columns(static_cast<Eigen::Index>(layout.samples), kDraws);
  for (Eigen::Index i = 0; i < columns.size(); ++i)
    columns.data()[i] = normal(random);
  columns = lower * columns;
  Matrix means = block_means(columns, layout);
  whiten_means(means, layout, noise, Part::kAll);
  for (Eigen::Index channel = 0; channel < 3; ++channel) {
    double squares = 0.0;
    double products = 0.0;
    for (Eigen::Index b = channel; b < means.rows(); b += 3) {
      squares += means.row(b).squaredNorm();
      if (b > 0) products += means.row(b).dot(means.row(b - 1));
    }
    const double terms = kDraws * 30.0;
    EXPECT_NEAR(squares / terms, 1.0, 4.0 * std::sqrt(2.0 / terms)) << channel;
    EXPECT_NEAR(products / terms, 0.0, 4.0 / std::sqrt(terms)) << channel;
  }
}

// Gyro 1 alone, `blocks` of five samples each, a quarter of a second apart.
Layout one_gyro_layout(std::size_t blocks) {
  Layout layout = some_layout(blocks);
  for (Block& block : layout.blocks) {
    block.channel = Channel::kGyro1;
    block.rate_square = 0.0;
    block.within_gain = {1.0, 0.0, 0.0};
    block.mean_gain = {1.0 / block.count, 0.0, 0.0};
  }
  layout.reference_variance = 0.0;
  return layout;
}

// Drift stands still within a block.
Eigen::VectorXd drawn_of_one(const Layout& layout, const NoiseTerms& terms, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd residual(static_cast<Eigen::Index>(layout.samples));
  double walk_dps = 0.0;
  double markov_dps = terms.markov.empty() ? 0.0 : terms.markov[0].sigma_dps * normal(random);
  double last_s = 0.0;
  for (const Block& block : layout.blocks) {
    const double step_s = block.t_s - last_s;
    last_s = block.t_s;
    walk_dps += terms.walk_dps_rts * std::sqrt(step_s) * normal(random);
    if (!terms.markov.empty()) {
      const double decay = std::exp(-step_s / terms.markov[0].tau_s);
      markov_dps = decay * markov_dps +
                   terms.markov[0].sigma_dps * std::sqrt(1.0 - decay * decay) * normal(random);
    }
    const double sigma_dps = std::sqrt(terms.variance(block.rate_square, layout.interval_s[0]));
    for (std::uint32_t i = 0; i < block.count; ++i)
      residual[block.first + i] = walk_dps + markov_dps + sigma_dps * normal(random);
  }
  return residual;
}

// The standard error of a logarithm that the likelihood's curvature states.
template <class LogLikelihood>
double sigma_of_log(const LogLikelihood& at) {
  constexpr double kStep = 0.1;
  return kStep /
         std::sqrt(std::max(1e-12, 2.0 * at(1.0) - at(std::exp(kStep)) - at(std::exp(-kStep))));
}

TEST(NoiseFit, FindsWhiteNoiseAndWalkWithinItsStatisticalError) {
  const Layout layout = one_gyro_layout(1200);
  PairNoise truth;
  truth[0].white_dps_rthz = 0.004;
  truth[0].walk_dps_rts = 0.003;
  const Freedom free{true, false, true, false};
  double white = 0.0;
  double walk = 0.0;
  constexpr int kSeeds = 8;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Eigen::VectorXd residual =
        drawn_of_one(layout, truth[0], 40 + static_cast<std::uint64_t>(seed));
    const NoiseFitResult fit =
        fit_pair_noise(residual, layout, PairNoise{}, {free, free}, {true, false}, Part::kAll);
    const double sigma_walk = sigma_of_log([&](double factor) {
      PairNoise other = fit.noise;
      other[0].walk_dps_rts *= factor;
      return log_likelihood(residual, layout, other, Part::kAll);
    });
    const double z_white =
        std::log(fit.noise[0].white_dps_rthz / 0.004) * std::sqrt(2.0 * 4.0 * 1200.0);
    const double z_walk = std::log(fit.noise[0].walk_dps_rts / 0.003) / sigma_walk;
    EXPECT_LT(std::abs(z_white), 4.0) << "seed " << seed;
    EXPECT_LT(std::abs(z_walk), 4.0) << "seed " << seed;
    white += z_white / std::sqrt(kSeeds);
    walk += z_walk / std::sqrt(kSeeds);
  }
  // Nor is there a bias beyond the error of their mean.
  EXPECT_LT(std::abs(white), 4.0);
  EXPECT_LT(std::abs(walk), 4.0);
}

TEST(NoiseFit, TellsRateNoiseFromWhiteNoise) {
  Layout layout = one_gyro_layout(2000);
  for (std::size_t b = 0; b < layout.blocks.size(); ++b)
    layout.blocks[b].rate_square = b % 2 == 0 ? 0.0 : 900.0;
  PairNoise truth;
  truth[0].white_dps_rthz = 0.004;
  truth[0].ratio_rthz = 2e-4;
  const Freedom free{true, true, false, false};
  const NoiseFitResult fit = fit_pair_noise(drawn_of_one(layout, truth[0], 50), layout, PairNoise{},
                                            {free, free}, {true, false}, Part::kAll);
  // 4000 deviations at rest tell the white noise; as many in motion the sum of both squares, of
  // which the ratio's is 0.69.
  EXPECT_NEAR(fit.noise[0].white_dps_rthz / 0.004, 1.0, 4.0 / std::sqrt(2.0 * 4000.0));
  EXPECT_NEAR(fit.noise[0].ratio_rthz / 2e-4, 1.0, 4.0 * 1.6 / std::sqrt(2.0 * 4000.0));
}

TEST(NoiseFit, FindsACorrelatedTermWithinItsStatisticalError) {
  const Layout layout = one_gyro_layout(2400);
  PairNoise truth;
  truth[0].white_dps_rthz = 0.004;
  truth[0].markov = {{0.02, 5.0}};
  const Eigen::VectorXd residual = drawn_of_one(layout, truth[0], 51);
  const Freedom free{true, false, false, true};
  const NoiseFitResult fit =
      fit_pair_noise(residual, layout, PairNoise{}, {free, free}, {true, false}, Part::kAll);
  ASSERT_EQ(fit.noise[0].markov.size(), 1U);
  // 600 s hold 60 independent values of a term that forgets in 5 s (twice that between them): its
  // variance is known to √(2/60), its memory to twice as much.
  EXPECT_NEAR(std::log(fit.noise[0].markov[0].sigma_dps / 0.02), 0.0, 4.0 * std::sqrt(0.5 / 60.0));
  EXPECT_NEAR(std::log(fit.noise[0].markov[0].tau_s / 5.0), 0.0, 4.0 * std::sqrt(2.0 / 60.0));
  // The likeliest is likelier than the truth, by half a χ² of three unknowns.
  const double ahead = fit.log_likelihood - log_likelihood(residual, layout, truth, Part::kAll);
  EXPECT_GT(ahead, -0.1);
  EXPECT_LT(ahead, 0.5 * 21.1);
}

TEST(NoiseFit, LeavesWhatIsNotFreeAsItWas) {
  const Layout layout = one_gyro_layout(400);
  PairNoise start;
  start[0] = {0.004, 1e-4, 0.003, {{0.01, 3.0}}, 0.01};
  start[1] = {0.1, 0.2, 0.3, {}, 0.4};
  const Freedom none{false, false, false, false};
  const Freedom all{true, true, true, true};
  const Eigen::VectorXd residual = drawn_of_one(layout, start[0], 52);
  const NoiseFitResult fit =
      fit_pair_noise(residual, layout, start, {none, all}, {true, false}, Part::kAll);
  EXPECT_EQ(fit.noise[0].white_dps_rthz, 0.004);
  EXPECT_EQ(fit.noise[0].ratio_rthz, 1e-4);
  EXPECT_EQ(fit.noise[0].walk_dps_rts, 0.003);
  EXPECT_EQ(fit.noise[0].markov.size(), 1U);
  // Nothing was observed of gyro 2.
  EXPECT_EQ(fit.noise[1].white_dps_rthz, 0.1);
  EXPECT_TRUE(fit.noise[1].markov.empty());
  EXPECT_NEAR(fit.log_likelihood, log_likelihood(residual, layout, start, Part::kAll), 1e-9);
}

TEST(NoiseFit, IsOfThePartThatCounts) {
  Layout layout = one_gyro_layout(1200);
  PairNoise loud;
  loud[0].white_dps_rthz = 0.04;
  PairNoise quiet;
  quiet[0].white_dps_rthz = 0.004;
  Eigen::VectorXd residual = drawn_of_one(layout, quiet[0], 53);
  const Eigen::VectorXd noisy = drawn_of_one(layout, loud[0], 54);
  for (std::size_t b = 0; b < layout.blocks.size(); b += 4) {
    Block& block = layout.blocks[b];
    block.held_out = true;
    residual.segment(block.first, block.count) = noisy.segment(block.first, block.count);
  }
  const Freedom free{true, false, false, false};
  const auto white_of = [&](Part part) {
    return fit_pair_noise(residual, layout, PairNoise{}, {free, free}, {true, false}, part)
        .noise[0]
        .white_dps_rthz;
  };
  EXPECT_NEAR(white_of(Part::kFit) / 0.004, 1.0, 4.0 / std::sqrt(2.0 * 3600.0));
  EXPECT_NEAR(white_of(Part::kHeldOut) / 0.04, 1.0, 4.0 / std::sqrt(2.0 * 1200.0));
}

}  // namespace
}  // namespace vgyro::gap
