#include "gap/regression.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

constexpr double kSigmas = 4.0;

// Small enough for a full covariance matrix; the walk is as loud as the white noise after 10 s.
Making small(std::uint64_t seed) {
  Making making;
  making.seconds = 40.0;
  making.interval_s = 0.05;
  making.rest_s = 8.0;
  making.white_dps_rthz = {1e-3, 2e-3};
  making.walk_dps_rts = {1e-4, 3e-4};
  making.seed = seed;
  return making;
}

PairNoise noise_of(const Making& making) {
  return gap::noise_of(noise_effects(making));
}

// The estimate of textbooks, (XᵀS⁻¹X)⁻¹XᵀS⁻¹y, with the covariance of every sample with every other
// by the definitions of white noise and of a walk that begins at 0.
struct Dense {
  Eigen::VectorXd x;
  Eigen::MatrixXd covariance;
};
Dense dense_least_squares(const Observations& data, const Making& making,
                          const Eigen::MatrixXd& columns) {
  const Eigen::Index n = data.size();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto a = static_cast<std::size_t>(i);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const double walk = std::pow(making.walk_dps_rts[gyro], 2);
      const double mine = share_of(data.channel[a], gyro);
      for (Eigen::Index j = 0; j < n; ++j) {
        const auto b = static_cast<std::size_t>(j);
        covariance(i, j) +=
            mine * share_of(data.channel[b], gyro) * walk * std::min(data.t_s[a], data.t_s[b]);
      }
      covariance(i, i) +=
          mine * mine * std::pow(making.white_dps_rthz[gyro], 2) / making.interval_s;
    }
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  Dense dense;
  dense.covariance = (columns.transpose() * factor.solve(columns)).inverse();
  dense.x = dense.covariance * (columns.transpose() * factor.solve(data.observed_dps));
  return dense;
}

// Drift stands still within a tenth of a second for us, which costs less than this of a σ.
constexpr double kBlocksCost = 0.05;

void expect_dense(const Fit& fit, const Dense& dense, const std::vector<double>& x,
                  std::uint64_t seed) {
  ASSERT_EQ(fit.covariance.rows(), dense.covariance.rows());
  for (Eigen::Index i = 0; i < dense.x.size(); ++i) {
    const double sigma = std::sqrt(dense.covariance(i, i));
    EXPECT_NEAR(x[static_cast<std::size_t>(i)], dense.x[i], kBlocksCost * sigma)
        << "seed " << seed << ", parameter " << i;
    for (Eigen::Index j = 0; j < dense.x.size(); ++j) {
      const double scale = sigma * std::sqrt(dense.covariance(j, j));
      EXPECT_NEAR(fit.covariance(i, j), dense.covariance(i, j), kBlocksCost * scale)
          << "seed " << seed << ", parameters " << i << " and " << j;
    }
  }
}

TEST(Regression, ReachesDenseGeneralisedLeastSquares) {
  for (const std::uint64_t seed : {61U, 62U}) {
    Making making = small(seed);
    making.error = [](std::size_t, double t_s, double rate_dps) {
      return 0.01 - 2e-4 * t_s + 1e-3 * rate_dps;
    };
    const auto data = observations_of_one(making);
    Eigen::MatrixXd columns(data->size(), 4);
    for (Eigen::Index i = 0; i < data->size(); ++i) {
      const double t_s = data->t_s[static_cast<std::size_t>(i)];
      const double rate_dps = true_rate_dps(making, t_s);
      columns.row(i) << 1.0, t_s, rate_dps, rate_dps * rate_dps * rate_dps;
    }
    const Regression regression(data, {}, Part::kAll);
    Fit fit{{{0, Kind::kBias, {}, 0},
             {0, Kind::kBiasRamp, {}, 0},
             {0, Kind::kScaleFactor, {}, 0},
             {0, Kind::kScaleFactorCubic, {}, 0}},
            noise_of(making),
            0.0,
            {}};
    regression.improve(fit);
    std::vector<double> x;
    for (const Effect& term : fit.terms)
      x.push_back(term.parameters[0]);
    expect_dense(fit, dense_least_squares(*data, making, columns), x, seed);
  }
}

// What both gyros read at rest tells their biases apart, which their difference alone does not; the
// walk that each has goes on from one to the other.
TEST(Regression, ReachesDenseGeneralisedLeastSquaresOfTwoGyros) {
  constexpr std::uint64_t kSeed = 63;
  Making making = small(kSeed);
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 0 ? 0.02 : -0.01 + 5e-4 * rate_dps;
  };
  const auto data = observations_of_two(making);
  Eigen::MatrixXd columns(data->size(), 3);
  for (Eigen::Index i = 0; i < data->size(); ++i) {
    const auto place = static_cast<std::size_t>(i);
    const Channel channel = data->channel[place];
    const double first = channel == Channel::kGyro2 ? 0.0 : 1.0;
    const double second = channel == Channel::kGyro1        ? 0.0
                          : channel == Channel::kDifference ? -1.0
                                                            : 1.0;
    columns.row(i) << first, second, second * true_rate_dps(making, data->t_s[place]);
  }
  const Regression regression(data, {}, Part::kAll);
  Fit fit{{{0, Kind::kBias, {}, 0}, {1, Kind::kBias, {}, 0}, {1, Kind::kScaleFactor, {}, 0}},
          noise_of(making),
          0.0,
          {}};
  regression.improve(fit);
  const std::vector<double> x{fit.terms[0].parameters[0], fit.terms[1].parameters[0],
                              fit.terms[2].parameters[0]};
  expect_dense(fit, dense_least_squares(*data, making, columns), x, kSeed);
}

// Known effects are taken off, and stay as they are.
TEST(Regression, TakesKnownEffectsForGranted) {
  Making making = small(64);
  making.error = [](std::size_t, double, double rate_dps) { return 0.01 + 1e-3 * rate_dps; };
  const auto data = observations_of_one(making);
  const Effect bias{0, Kind::kBias, {0.01}, 0};
  const Regression knows(data, {bias}, Part::kAll);
  const Regression asks(data, {}, Part::kAll);
  const Effect scale{0, Kind::kScaleFactor, {1e-3}, 0};
  EXPECT_EQ(knows.residual({scale}), asks.residual({bias, scale}));
  Fit fit{{{0, Kind::kScaleFactor, {}, 0}}, noise_of(making), 0.0, {}};
  knows.improve(fit);
  EXPECT_NEAR(fit.terms[0].parameters[0], 1e-3, kSigmas * std::sqrt(fit.covariance(0, 0)));
  EXPECT_EQ(knows.known(), Effects{bias});
}

// An error that is called one standard error is one: over many seeds, at Part::kFit as in a search.
TEST(Regression, ErrorsScatterAsTheirCovarianceSays) {
  constexpr int kSeeds = 40;
  const model::Parameters truth{0.02, 1e-3, 0.008};
  Making making = small(0);
  making.error = [&](std::size_t, double t_s, double rate_dps) {
    const double late_dps = true_rate_dps(making, t_s - truth[2]);
    return late_dps * (1.0 + truth[1]) - rate_dps + truth[0];
  };
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    making.seed = seed;
    const Regression regression(observations_of_one(making), {}, Part::kFit);
    Fit fit{{{0, Kind::kBias, {}, 0}, {0, Kind::kScaleFactor, {}, 0}, {0, Kind::kDelay, {}, 0}},
            noise_of(making),
            0.0,
            {}};
    regression.improve(fit);
    Eigen::Vector3d error;
    for (Eigen::Index i = 0; i < 3; ++i)
      error[i] =
          fit.terms[static_cast<std::size_t>(i)].parameters[0] - truth[static_cast<std::size_t>(i)];
    // In units of the covariance: independent, each of variance 1.
    const Eigen::Vector3d white =
        Eigen::LLT<Eigen::Matrix3d>(fit.covariance).matrixL().solve(error);
    sum += white * white.transpose() / kSeeds;
  }
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(sum(i, i), 1.0, kSigmas * std::sqrt(2.0 / kSeeds)) << "seeds 1 to " << kSeeds;
    for (Eigen::Index j = 0; j < i; ++j)
      EXPECT_NEAR(sum(i, j), 0.0, kSigmas / std::sqrt(kSeeds)) << "seeds 1 to " << kSeeds;
  }
}

TEST(Regression, ConvergesFromNoDelayToTheTruth) {
  for (const double delay_s : {-0.02, 0.003, 0.04, 0.2}) {
    Making making = small(65);
    making.error = [&](std::size_t, double t_s, double rate_dps) {
      return true_rate_dps(making, t_s - delay_s) - rate_dps;
    };
    const Regression regression(observations_of_one(making), {}, Part::kAll);
    Fit fit{{{0, Kind::kDelay, {0.0}, 0}}, noise_of(making), 0.0, {}};
    regression.improve(fit);
    // σ = N/√(∫(dΩ/dt)² dt) for white noise alone; the drift costs a little.
    double square = 0.0;
    constexpr double kSmall_s = 1e-4;
    for (double t_s = 0.0; t_s < making.seconds; t_s += making.interval_s) {
      const double slope =
          (true_rate_dps(making, t_s + kSmall_s) - true_rate_dps(making, t_s - kSmall_s)) /
          (2.0 * kSmall_s);
      square += slope * slope * making.interval_s;
    }
    const double sigma = making.white_dps_rthz[0] / std::sqrt(square);
    EXPECT_NEAR(std::sqrt(fit.covariance(0, 0)) / sigma, 1.0, 0.1) << delay_s;
    EXPECT_NEAR(fit.terms[0].parameters[0], delay_s, kSigmas * sigma) << delay_s;
  }
}

// From the edge of its limits: a memory ten times as long as the truth.
TEST(Regression, ConvergesToAWarmUpThatIsMuchShorter) {
  Making making = small(66);
  constexpr double kAmplitude_dps = 0.1;
  constexpr double kTau_s = 6.0;
  making.error = [](std::size_t, double t_s, double) {
    return kAmplitude_dps * std::exp(-t_s / kTau_s);
  };
  const Regression regression(observations_of_one(making), {}, Part::kAll);
  Fit fit{{{0, Kind::kWarmUp, {0.01, 30.0}, 0}}, noise_of(making), 0.0, {}};
  regression.improve(fit);
  EXPECT_NEAR(fit.terms[0].parameters[0], kAmplitude_dps,
              kSigmas * std::sqrt(fit.covariance(0, 0)));
  EXPECT_NEAR(fit.terms[0].parameters[1], kTau_s, kSigmas * std::sqrt(fit.covariance(1, 1)));
}

TEST(Regression, KeepsParametersWithinTheirLimits) {
  const Making making = small(67);
  const Regression alone(observations_of_one(making), {}, Part::kAll);
  const Regression pair(observations_of_two(making), {}, Part::kAll);
  const auto kept = [](const Regression& regression, Effect effect) {
    regression.keep_in_bounds(effect);
    return effect.parameters;
  };
  // A reference may be late itself; of two gyros nothing reads ahead of time.
  EXPECT_EQ(kept(alone, {0, Kind::kDelay, {-0.01}, 0})[0], -0.01);
  EXPECT_EQ(kept(pair, {0, Kind::kDelay, {-0.01}, 0})[0], 0.0);
  EXPECT_EQ(kept(pair, {0, Kind::kDelay, {0.01}, 0})[0], 0.01);
  EXPECT_EQ(kept(pair, {0, Kind::kClockSkew, {-10.0}, 0})[0], -10.0);
  EXPECT_EQ(kept(alone, {0, Kind::kScaleFactor, {-2.0}, 0})[0], -0.9);
  EXPECT_EQ(kept(alone, {0, Kind::kBandwidth, {1e6}, 0})[0], 1e4);
  EXPECT_EQ(kept(alone, {0, Kind::kWarmUp, {1.0, 0.1}, 0})[1], 0.5);
  // So does a fit that is drawn beyond them.
  Making wrong = making;
  wrong.error = [](std::size_t, double, double rate_dps) { return -1.5 * rate_dps; };
  const Regression drawn(observations_of_one(wrong), {}, Part::kAll);
  Fit fit{{{0, Kind::kScaleFactor, {}, 0}}, noise_of(making), 0.0, {}};
  drawn.improve(fit);
  EXPECT_GE(fit.terms[0].parameters[0], -0.9);
}

TEST(Regression, ColumnsAreTheResidualAndWhatEachFreeParameterMoves) {
  const Making making = small(68);
  const Regression regression(observations_of_one(making), {}, Part::kAll);
  const Effects terms{{0, Kind::kBias, {0.1}, 0},
                      {0, Kind::kWarmUp, {0.2, 5.0}, 0},
                      {0, Kind::kBiasStep, {0.3, 20.0}, 0},
                      {0, Kind::kScaleFactor, {1e-3}, 0}};
  EXPECT_EQ(free_count(terms), 5);
  EXPECT_EQ(free_count({}), 0);
  const Matrix all = regression.columns(terms);
  ASSERT_EQ(all.cols(), 6);
  EXPECT_EQ(Eigen::VectorXd(all.col(0)), regression.residual(terms));
  for (Eigen::Index i = 0; i < all.rows(); ++i) {
    const double t_s = regression.data().t_s[static_cast<std::size_t>(i)];
    const double decay = std::exp(-t_s / 5.0);
    EXPECT_EQ(all(i, 1), 1.0);
    EXPECT_NEAR(all(i, 2), decay, 1e-12);
    EXPECT_NEAR(all(i, 3), 0.2 * t_s / 25.0 * decay, 1e-7);
    EXPECT_EQ(all(i, 4), t_s >= 20.0 ? 1.0 : 0.0);
    EXPECT_NEAR(all(i, 5), true_rate_dps(making, t_s), 1e-9);
  }
  const Matrix without = regression.columns(terms, 2, 1);
  ASSERT_EQ(without.cols(), 6);
  EXPECT_EQ(without.leftCols(2), all.leftCols(2));
  EXPECT_EQ(without.middleCols(2, 2), all.rightCols(2));
  EXPECT_EQ(without.rightCols(2).norm(), 0.0);
}

// Terms and noise at once, begun far from both.
TEST(Regression, FitsTermsAndNoiseToWhatWasInjected) {
  constexpr int kSeeds = 8;
  constexpr double kScale = 2e-4;
  double white = 0.0;
  double walk = 0.0;
  double square = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Making making = small(seed);
    making.seconds = 100.0;
    making.walk_dps_rts[0] = 1e-3;
    making.error = [](std::size_t, double, double rate_dps) { return kScale * rate_dps; };
    const Regression regression(observations_of_one(making), {}, Part::kAll);
    PairNoise start;
    start[0].white_dps_rthz = 0.01;
    start[0].walk_dps_rts = 0.01;
    const Fit fit = regression.fit({{0, Kind::kScaleFactor, {}, 0}}, start);
    white += fit.noise[0].white_dps_rthz / making.white_dps_rthz[0] / kSeeds;
    walk += fit.noise[0].walk_dps_rts / making.walk_dps_rts[0] / kSeeds;
    square += std::pow(fit.terms[0].parameters[0] - kScale, 2) / fit.covariance(0, 0) / kSeeds;
    // Nothing is likelier than what was fitted, but for the tolerance of the search.
    EXPECT_GT(fit.log_likelihood + 0.1,
              regression.log_likelihood({{0, Kind::kScaleFactor, {kScale}, 0}}, noise_of(making)))
        << "seed " << seed;
  }
  // A hundred seconds of twenty samples, four of five of which are deviations from a block's mean;
  // the walk stands out of the white noise after a second, so that some fifty are independent.
  EXPECT_NEAR(white, 1.0, kSigmas / std::sqrt(2.0 * 1600.0 * kSeeds));
  EXPECT_NEAR(walk, 1.0, kSigmas / std::sqrt(2.0 * 50.0 * kSeeds) + 0.03);
  EXPECT_NEAR(square, 1.0, kSigmas * std::sqrt(2.0 / kSeeds));
}

// Exponentially correlated drift, by its own recursion.
std::vector<double> drawn_drift(const Making& making, double sigma_dps, double tau_s,
                                std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double keeps = std::exp(-making.interval_s / tau_s);
  std::vector<double> drift;
  double value = sigma_dps * normal(random);
  for (double t_s = 0.0; t_s < making.seconds; t_s += making.interval_s) {
    drift.push_back(value);
    value = keeps * value + sigma_dps * std::sqrt(1.0 - keeps * keeps) * normal(random);
  }
  return drift;
}

Making drifting(std::uint64_t seed, const std::vector<double>& drift) {
  Making making = small(seed);
  making.seconds = 150.0;
  making.walk_dps_rts = {0.0, 0.0};
  making.error = [drift, interval_s = making.interval_s](std::size_t, double t_s, double) {
    return drift[static_cast<std::size_t>(std::lround(t_s / interval_s))];
  };
  return making;
}

TEST(Regression, AllowsForADriftThatForgets) {
  constexpr std::uint64_t kSeeds = 6;
  constexpr double kGain = 2.0;
  std::uint64_t allowed = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Making still = drifting(seed, {});
    const Making making = drifting(seed, drawn_drift(still, 4e-3, 3.0, 100 + seed));
    const Regression regression(observations_of_one(making), {}, Part::kAll);
    const PairNoise start = noise_of(making);
    const Fit fit = regression.fit({}, start);
    if (fit.noise[0].markov.empty()) continue;
    ++allowed;
    // What white noise and a walk by themselves reach.
    const NoiseFitResult plain = fit_pair_noise(regression.residual({}), regression.data().layout,
                                                start, {}, regression.data().holds, Part::kAll);
    EXPECT_GE(fit.log_likelihood, plain.log_likelihood + kGain) << "seed " << seed;
  }
  // A walk may pass for it once.
  EXPECT_GE(allowed, kSeeds - 1) << "of seeds 1 to " << kSeeds;
}

// Of white noise and walk alone a further term seldom gains what it must.
TEST(Regression, AddsNoDriftWhereThereIsNone) {
  constexpr int kSeeds = 10;
  int added = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Making making = small(seed);
    const Regression regression(observations_of_one(making), {}, Part::kAll);
    const Fit fit = regression.fit({}, noise_of(making));
    added += fit.noise[0].markov.empty() ? 0 : 1;
    EXPECT_TRUE(fit.noise[1].markov.empty());
  }
  EXPECT_LE(added, 3) << "of seeds 1 to " << kSeeds;
}

// What a model knows of correlated drift stays in the fit.
TEST(Regression, KeepsTheDriftThatIsKnown) {
  const Making making = small(69);
  Effects known = noise_effects(making);
  known.push_back({0, Kind::kGaussMarkov, {1e-3, 7.0}, 0});
  const Regression regression(observations_of_one(making), known, Part::kAll);
  EXPECT_EQ(regression.known_noise()[0].markov.size(), 1U);
  const Fit fit = regression.fit({}, regression.known_noise());
  ASSERT_GE(fit.noise[0].markov.size(), 1U);
  EXPECT_EQ(fit.noise[0].markov[0].sigma_dps, 1e-3);
  EXPECT_EQ(fit.noise[0].markov[0].tau_s, 7.0);
}

// A residual in units of its noise has a square of one for each sample.
TEST(Regression, WhitenedNoiseHasOneForEachSample) {
  const Making making = small(70);
  const Regression regression(observations_of_one(making), noise_effects(making), Part::kAll);
  const Matrix white = regression.whitened(Matrix(regression.residual({})), noise_of(making));
  const auto samples = static_cast<double>(regression.data().size());
  EXPECT_NEAR(white.squaredNorm() / samples, 1.0, kSigmas * std::sqrt(2.0 / samples)) << "seed 70";
}

}  // namespace
}  // namespace vgyro::gap
