#include "gap/steadiness.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

constexpr double kSigmas = 4.0;
// Six parts, one size each, less the one that is fitted anyway.
constexpr double kFreedom = 5.0;

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = 80.0;
  making.interval_s = 0.02;
  making.rest_s = 10.0;
  making.seed = seed;
  return making;
}

struct Judged {
  Change change;
  double statistic = 0.0;  ///< of the term
  Effect effect;
};

// The change of the first of `terms`, all fitted before.
Judged judged(const Making& making, Effects terms) {
  const Regression regression(observations_of_one(making), {}, Part::kAll);
  Fit fit{std::move(terms), noise_of(noise_effects(making)), 0.0, {}};
  regression.improve(fit);
  Effects without = fit.terms;
  without.erase(without.begin());
  Fit null{without, fit.noise, 0.0, {}};
  regression.improve(null);
  return {change_over_time(regression, fit.terms, 0, fit.noise),
          2.0 * (regression.log_likelihood(fit.terms, fit.noise) -
                 regression.log_likelihood(null.terms, fit.noise)),
          fit.terms.front()};
}

TEST(Steadiness, ChangeOfASteadySizeIsChiSquare) {
  constexpr int kSeeds = 40;
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Making making = making_of(seed);
    making.error = [](std::size_t, double, double rate_dps) { return 3e-4 * rate_dps; };
    const Judged one = judged(making, {{0, Kind::kScaleFactor, {}, 0}});
    EXPECT_EQ(one.change.freedom, kFreedom);
    EXPECT_FALSE(one.change.is_beyond_chance(one.statistic))
        << "seed " << seed << ": " << one.change.statistic;
    sum += one.change.statistic;
  }
  EXPECT_NEAR(sum / kSeeds, kFreedom, kSigmas * std::sqrt(2.0 * kFreedom / kSeeds))
      << "seeds 1 to " << kSeeds;
}

// Beside others that are fitted with it, and of amplitude and phase.
TEST(Steadiness, ChangeOfASteadyWaveBesideABiasIsChiSquareOfTwiceAsMany) {
  constexpr int kSeeds = 20;
  Making making = making_of(1);
  const std::vector<double> angle_rad = true_angle_rad(making);
  making.error = [&](std::size_t, double t_s, double) {
    const auto place = static_cast<std::size_t>(std::lround(t_s / making.interval_s));
    return 0.01 + 3e-3 * std::cos(2.0 * angle_rad[place] + 0.5);
  };
  double sum = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    making.seed = seed;
    const Judged one =
        judged(making, {{0, Kind::kAngleHarmonic, {2.0, 1e-3, 0.1}, 0}, {0, Kind::kBias, {}, 0}});
    EXPECT_EQ(one.change.freedom, 2.0 * kFreedom);
    EXPECT_FALSE(one.change.is_beyond_chance(one.statistic))
        << "seed " << seed << ": " << one.change.statistic;
    sum += one.change.statistic;
  }
  EXPECT_NEAR(sum / kSeeds, 2.0 * kFreedom, kSigmas * std::sqrt(4.0 * kFreedom / kSeeds))
      << "seeds 1 to " << kSeeds;
}

TEST(Steadiness, SizeThatChangesHalfwayIsBeyondChance) {
  for (const std::uint64_t seed : {111U, 112U, 113U}) {
    Making making = making_of(seed);
    making.error = [](std::size_t, double t_s, double rate_dps) {
      return (t_s < 45.0 ? 1e-4 : 5e-4) * rate_dps;
    };
    const Judged one = judged(making, {{0, Kind::kScaleFactor, {}, 0}});
    EXPECT_TRUE(one.change.is_beyond_chance(one.statistic))
        << "seed " << seed << ": " << one.change.statistic << " of " << one.statistic;
    // By closed form: half of the difference at each sample, over the white noise's density.
    double square = 0.0;
    for (double t_s = 0.0; t_s < making.seconds; t_s += making.interval_s)
      square += std::pow(2e-4 * true_rate_dps(making, t_s), 2) * making.interval_s;
    const double truth = square / std::pow(making.white_dps_rthz[0], 2);
    EXPECT_NEAR(one.change.statistic / truth, 1.0, 0.5) << "seed " << seed;
  }
}

// The arithmetic of great effects leaves a change that would be beyond chance by itself.
TEST(Steadiness, SmallShareOfAGreatEffectIsNoChange) {
  const Change change{80.0, kFreedom};
  EXPECT_TRUE(change.is_beyond_chance(1000.0));
  EXPECT_FALSE(change.is_beyond_chance(10'000.0));
  // Whatever the effect, chance is what χ² reaches.
  EXPECT_FALSE((Change{15.0, kFreedom}.is_beyond_chance(1.0)));
  EXPECT_TRUE((Change{60.0, kFreedom}.is_beyond_chance(1.0)));
}

Found found_of(const Effect& effect, double sigma = 0.0) {
  Found found;
  found.effect = effect;
  found.sigma[0] = sigma;
  return found;
}

TEST(Steadiness, StepsThatCancelArePiecesOfSomethingElse) {
  const Found up = found_of({0, Kind::kBiasStep, {0.010, 20.0}, 0}, 0.0005);
  const Found down = found_of({0, Kind::kBiasStep, {-0.0112, 40.0}, 0}, 0.0005);
  const Found other = found_of({0, Kind::kScaleFactor, {1e-3}, 0}, 1e-5);
  EXPECT_EQ(pieces_of_something_else({up, other, down}), (std::vector<bool>{true, false, true}));
  // On two gyros they are two steps, and two of a kind go up.
  Found elsewhere = down;
  elsewhere.effect.gyro = 1;
  EXPECT_EQ(pieces_of_something_else({up, elsewhere}), (std::vector<bool>{false, false}));
  const Found again = found_of({0, Kind::kBiasStep, {0.01, 40.0}, 0}, 0.0005);
  EXPECT_EQ(pieces_of_something_else({up, again}), (std::vector<bool>{false, false}));
  // What is left of both is eight standard errors, and more than a tenth.
  const Found less = found_of({0, Kind::kBiasStep, {-0.004, 40.0}, 0}, 0.0005);
  EXPECT_EQ(pieces_of_something_else({up, less}), (std::vector<bool>{false, false}));
}

TEST(Steadiness, ThreeLinesOrStepsOnOneGyroArePiecesOfSomethingElse) {
  std::vector<Found> found;
  for (int i = 0; i < 2; ++i)
    found.push_back(found_of({1, Kind::kLine, {3.0 + i, 0.01, 0.0}, 0}, 1e-4));
  found.push_back(found_of({0, Kind::kLine, {7.0, 0.01, 0.0}, 0}, 1e-4));
  EXPECT_EQ(pieces_of_something_else(found), (std::vector<bool>{false, false, false}));
  found.push_back(found_of({1, Kind::kLine, {9.0, 0.01, 0.0}, 0}, 1e-4));
  EXPECT_EQ(pieces_of_something_else(found), (std::vector<bool>{true, true, false, true}));
  std::vector<Found> steps;
  for (int i = 0; i < 3; ++i)
    steps.push_back(found_of({0, Kind::kBiasStep, {0.01 * (i + 1), 20.0 * i}, 0}, 1e-4));
  EXPECT_EQ(pieces_of_something_else(steps), (std::vector<bool>(3, true)));
  // Of other kinds there may be any number.
  std::vector<Found> harmonics;
  for (int i = 0; i < 5; ++i)
    harmonics.push_back(found_of({0, Kind::kAngleHarmonic, {1.0 + i, 0.01, 0.0}, 0}, 1e-4));
  EXPECT_EQ(pieces_of_something_else(harmonics), (std::vector<bool>(5, false)));
  EXPECT_TRUE(pieces_of_something_else({}).empty());
}

}  // namespace
}  // namespace vgyro::gap
