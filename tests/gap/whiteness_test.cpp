#include "gap/whiteness.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Kind;

constexpr double kSigmas = 4.0;
constexpr double kFrom_s = 50.0;
constexpr double kTo_s = 70.0;

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = 120.0;
  making.rest_s = 30.0;
  making.seed = seed;
  return making;
}

double sample_sigma(const Making& making) {
  return making.white_dps_rthz[0] / std::sqrt(making.interval_s);
}

// An error that is drawn sample after sample, beside the noise that the model knows.
Whiteness whiteness_with(Making making, const std::function<double(double t_s)>& error_dps) {
  making.error = [&](std::size_t, double t_s, double) { return error_dps(t_s); };
  return whiteness_of(*observations_of_one(making), 0, noise_effects(making));
}

bool any(const Flaws& flaws) {
  return flaws.fast() || flaws.slow() || flaws.moves_too_much;
}

// Each figure is in standard deviations of what it is by chance.
TEST(Whiteness, OfNoiseThatTheModelKnowsHasNoFlaws) {
  constexpr int kSeeds = 40;
  double colour = 0.0;
  double spiky = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Whiteness whiteness = whiteness_with(making_of(seed), [](double) { return 0.0; });
    EXPECT_FALSE(any(flaws_of(whiteness, false)))
        << "seed " << seed << ": fast " << whiteness.fast << ", slow " << whiteness.slow
        << ", colour " << whiteness.colour << ", spiky " << whiteness.spiky << ", heavy "
        << whiteness.heavy << ", low " << whiteness.low << ", slope " << whiteness.slope;
    colour += whiteness.colour * whiteness.colour / kSeeds;
    spiky += whiteness.spiky * whiteness.spiky / kSeeds;
  }
  const double tolerance = kSigmas * std::sqrt(2.0 / kSeeds);
  EXPECT_NEAR(colour, 1.0, tolerance) << "seeds 1 to " << kSeeds;
  // Of deviations from a block's mean, which are a little less apart than independent ones.
  EXPECT_NEAR(spiky, 1.0, tolerance) << "seeds 1 to " << kSeeds;
}

TEST(Whiteness, OfADifferenceHasNoFlawsEither) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Making making = making_of(seed);
    const auto data = observations_of_two(making);
    for (const std::size_t gyro : {0U, 1U}) {
      const Flaws flaws = flaws_of(whiteness_of(*data, gyro, noise_effects(making)), false);
      EXPECT_FALSE(any(flaws)) << "seed " << seed << ", gyro " << gyro;
    }
  }
}

// What the effects say of the rate is taken off first.
TEST(Whiteness, IsOfWhatTheEffectsLeave) {
  Making making = making_of(121);
  making.error = [](std::size_t, double, double rate_dps) { return 0.01 * rate_dps; };
  const auto data = observations_of_one(making);
  Effects effects = noise_effects(making);
  EXPECT_TRUE(any(flaws_of(whiteness_of(*data, 0, effects), false)));
  effects.push_back({0, Kind::kScaleFactor, {0.01}, 0});
  EXPECT_FALSE(any(flaws_of(whiteness_of(*data, 0, effects), false)));
}

TEST(Whiteness, SeesNeighboursThatHangTogether) {
  for (const double share : {0.15, -0.15}) {
    Making making = making_of(122);
    const double sigma = sample_sigma(making);
    std::mt19937_64 random(122);
    std::normal_distribution<double> normal;
    // All noise is a moving mean of two, of the variance that the model says.
    Making silent = making;
    silent.white_dps_rthz[0] = 0.0;
    double last = 0.0;
    silent.error = [&](std::size_t, double, double) {
      const double now = normal(random);
      const double value = sigma * (now + share * last) / std::sqrt(1.0 + share * share);
      last = now;
      return value;
    };
    const Whiteness whiteness =
        whiteness_of(*observations_of_one(silent), 0, noise_effects(making));
    const Flaws flaws = flaws_of(whiteness, false);
    EXPECT_TRUE(flaws.coloured) << share << ": " << whiteness.colour;
    EXPECT_FALSE(flaws.spiky) << share;
    // By how much: the correlation of neighbours times √n, less what taking off the mean of ten
    // samples makes of it.
    const double truth = std::abs(share) / (1.0 + share * share) * std::sqrt(0.9 * 12000.0);
    EXPECT_NEAR(whiteness.colour / truth, 1.0, 0.5) << share;
  }
}

TEST(Whiteness, SeesSingleSamplesThatStandOut) {
  const Making making = making_of(123);
  std::mt19937_64 random(123);
  std::bernoulli_distribution rare(5e-4);
  const double size_dps = 8.0 * sample_sigma(making);
  const Whiteness whiteness =
      whiteness_with(making, [&](double) { return rare(random) ? size_dps : 0.0; });
  const Flaws flaws = flaws_of(whiteness, false);
  EXPECT_TRUE(flaws.spiky) << whiteness.spiky;
  EXPECT_TRUE(flaws.fast());
  EXPECT_FALSE(flaws.coloured) << whiteness.colour;
}

TEST(Whiteness, SeesAStretchOfOtherNoiseAndWhere) {
  for (const double factor : {1.3, 1.5}) {
    const Making making = making_of(124);
    std::mt19937_64 random(124);
    std::normal_distribution<double> normal;
    const double more_dps = sample_sigma(making) * std::sqrt(factor * factor - 1.0);
    const Whiteness whiteness = whiteness_with(making, [&](double t_s) {
      return t_s >= kFrom_s && t_s < kTo_s ? more_dps * normal(random) : 0.0;
    });
    EXPECT_TRUE(flaws_of(whiteness, false).uneven) << factor << ": " << whiteness.fast;
    EXPECT_GE(whiteness.fast_at.from_s, kFrom_s);
    EXPECT_LE(whiteness.fast_at.to_s, kTo_s);
  }
}

// A walk for twenty seconds that otherwise stands still.
TEST(Whiteness, SeesBurstsOfDriftAndWhere) {
  const Making making = making_of(125);
  std::mt19937_64 random(125);
  std::normal_distribution<double> normal;
  constexpr double kWalk_dps_rts = 2e-3;
  double drift_dps = 0.0;
  const Whiteness whiteness = whiteness_with(making, [&](double t_s) {
    if (t_s >= kFrom_s && t_s < kTo_s)
      drift_dps += kWalk_dps_rts * std::sqrt(making.interval_s) * normal(random);
    return drift_dps;
  });
  const Flaws flaws = flaws_of(whiteness, false);
  EXPECT_TRUE(flaws.bursts) << "slow " << whiteness.slow << ", heavy " << whiteness.heavy;
  EXPECT_TRUE(flaws.slow());
  if (flaws.moves_too_much) {
    EXPECT_GE(whiteness.slow_at.from_s, kFrom_s);
  }
}

TEST(Whiteness, SeesASlowDriftThatTheNoiseCouldNotMake) {
  const Making making = making_of(126);
  const Whiteness whiteness =
      whiteness_with(making, [](double t_s) { return 2e-3 * std::sin(2.0 * kPi * 0.05 * t_s); });
  const Flaws flaws = flaws_of(whiteness, false);
  EXPECT_TRUE(flaws.wanders) << "low " << whiteness.low << ", slope " << whiteness.slope;
  EXPECT_FALSE(flaws.fast());
}

// Where the model says too much noise the innovations are too quiet: that is no white noise either.
TEST(Whiteness, SeesNoiseThatIsNotThere) {
  const Making making = making_of(127);
  Making loud = making;
  loud.white_dps_rthz[0] *= 1.3;
  const Flaws flaws =
      flaws_of(whiteness_of(*observations_of_one(making), 0, noise_effects(loud)), false);
  EXPECT_TRUE(flaws.uneven);
}

// A quick drift leaves a colour that the noise knows to a tenth only.
TEST(Whiteness, BearsMoreColourBesideAQuickDrift) {
  Whiteness whiteness;
  whiteness.colour = 8.0;
  EXPECT_TRUE(flaws_of(whiteness, false).coloured);
  EXPECT_FALSE(flaws_of(whiteness, true).coloured);
  whiteness.colour = 20.0;
  EXPECT_TRUE(flaws_of(whiteness, true).coloured);
  EXPECT_FALSE(any(flaws_of(Whiteness{}, false)));
}

}  // namespace
}  // namespace vgyro::gap
