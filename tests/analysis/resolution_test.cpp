// Gyros of known noise, rounded to a step: the reported noise is never a value far from the truth,
// and never a bound below it.

#include "analysis/resolution.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "analysis/pair_noise.h"

namespace vgyro::analysis {
namespace {

constexpr double kInterval_s = 0.01;
constexpr std::size_t kSamples = 60'000;
constexpr double kStep_dps = 0.02;
constexpr std::uint64_t kSeed = 20240611;

struct World {
  double noise_steps = 1.0;   ///< σ of a sample
  double offset_steps = 0.0;  ///< of the rate, from the middle between two thresholds
  double walk_dps_rts = 0.0;
};

Series rounded(const World& world, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Series series{kInterval_s, {{0.0, {}}}};
  double bias_dps = world.offset_steps * kStep_dps;
  for (std::size_t i = 0; i < kSamples; ++i) {
    bias_dps += world.walk_dps_rts * std::sqrt(kInterval_s) * normal(random);
    const double rate_dps = bias_dps + world.noise_steps * kStep_dps * normal(random);
    series.parts[0].rate_dps.push_back(kStep_dps * std::round(rate_dps / kStep_dps));
  }
  return series;
}

PairNoise judged(const World& coarse, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  PairRecording recording;
  recording.own = {rounded({.noise_steps = 2.0}, random), rounded(coarse, random)};
  recording.paired = recording.own;
  recording.step_dps = {kStep_dps, kStep_dps};
  return judge_pair(recording);
}

TEST(Resolution, StatesNoNoiseThatIsFarFromTheTruth) {
  for (const double sigma : {0.0, 0.03, 0.1, 0.2, 0.3, 0.4, 0.45, 0.55, 0.6, 0.8, 1.0, 3.0}) {
    for (const double offset : {0.0, 0.1, 0.25, 0.4, 0.5}) {
      SCOPED_TRACE(::testing::Message()
                   << sigma << " steps of noise, " << offset << " off, seed " << kSeed);
      const SeriesNoise noise =
          judged({.noise_steps = sigma, .offset_steps = offset}, kSeed).gyros[1];
      const double truth = sigma * kStep_dps * std::sqrt(kInterval_s);
      ASSERT_TRUE(noise.fit.has_value());
      EXPECT_EQ(noise.hidden_by_step, sigma < kHiddenShare);
      const Estimate& white = noise.fit->white_dps_rthz;
      if (white.resolved) {
        EXPECT_NEAR(white.value, truth, 4.0 * white.sigma + 0.01 * truth);
      } else {
        EXPECT_LE(truth, white.below);
        EXPECT_LE(white.below, 0.6 * kStep_dps * std::sqrt(kInterval_s));
      }
      EXPECT_FALSE(noise.fit->flicker_dps.resolved);
      EXPECT_FALSE(noise.fit->walk_dps_rts.resolved);
    }
  }
}

// Drift over many steps shows, even if the step hides the white noise; drift within a step does
// not.
TEST(Resolution, BoundsTheDriftThatStaysWithinAStep) {
  const double seconds = kInterval_s * static_cast<double>(kSamples);
  for (const double steps : {0.02, 0.3, 30.0, 300.0}) {
    SCOPED_TRACE(::testing::Message() << "a walk of " << steps << " steps, seed " << kSeed);
    const double walk = steps * kStep_dps / std::sqrt(seconds);
    const SeriesNoise noise = judged({.noise_steps = 0.1, .walk_dps_rts = walk}, kSeed).gyros[1];
    ASSERT_TRUE(noise.fit.has_value());
    EXPECT_EQ(noise.hidden_by_step, steps < 300.0)
        << "300 steps in the record are many in a second";
    const Estimate& found = noise.fit->walk_dps_rts;
    EXPECT_EQ(found.resolved, steps > 1.0);
    if (found.resolved) {
      EXPECT_NEAR(found.value, walk, 0.2 * walk);
    } else {
      EXPECT_LT(walk, found.below);
    }
  }
}

TEST(Resolution, ValuesThatNeverChangeHaveABound) {
  const PairNoise noise = judged({.noise_steps = 0.0}, kSeed);
  EXPECT_TRUE(noise.gyros[1].hidden_by_step);
  EXPECT_FALSE(noise.correlation.has_value()) << "nobody knows the noise of one of them";
  EXPECT_FALSE(noise.gyros[0].hidden_by_step);
}

TEST(Resolution, FindsTheStepOfTheSamplesThemselves) {
  StepFinder finder;
  EXPECT_EQ(finder.step_dps(), 0.0);
  for (const double rate : {1.0, 1.0, 1.5, 1.25, 1.25 + 1e-12, -3.0})
    finder.add(rate);
  EXPECT_DOUBLE_EQ(finder.step_dps(), 0.25);
}

}  // namespace
}  // namespace vgyro::analysis
