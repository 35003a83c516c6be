#include "fusion/calibration.h"

#include <functional>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kRest_s = 20.0;
constexpr double kRate_hz = 100.0;

/// Two gyros, at rest by default.
struct Pair {
  std::array<double, 2> bias_dps{0.033, -0.0074};
  std::array<double, 2> slope_dps_s{0.0, 0.0};
  double sigma_dps = 0.0;
  double correlation = 0.0;
  std::function<double(double)> motion_dps = [](double) { return 0.0; };

  [[nodiscard]] std::array<double, 2> at(double t_s, Random& random) const {
    const double common = random.normal(sigma_dps * std::sqrt(correlation));
    std::array<double, 2> rate_dps{};
    for (std::size_t k = 0; k < 2; ++k) {
      rate_dps[k] = bias_dps[k] + slope_dps_s[k] * t_s + motion_dps(t_s) + common +
                    random.normal(sigma_dps * std::sqrt(1.0 - correlation));
    }
    return rate_dps;
  }
};

/// Feeds pairs until the calibration is complete; returns the time of the pair that was not used.
double feed(Calibrator& calibrator, const Pair& pair, Random& random, double from_s = 0.0,
            double until_s = 1000.0) {
  const auto first = static_cast<int>(std::ceil(from_s * kRate_hz));
  for (int i = first; i < until_s * kRate_hz; ++i) {
    const double t_s = i / kRate_hz;
    if (!calibrator.add(t_s, pair.at(t_s, random), 0.0)) return t_s;
  }
  return until_s;
}

// Biases and slopes are recovered within the errors that the injected noise explains, and these
// errors have the size that least squares predicts: the estimate is not lucky, and the theory is
// right.
TEST(Calibrator, RecoversBiasAndSlopeWithinTheInjectedNoise) {
  constexpr double kSigma = 0.01;
  constexpr int kRuns = 400;
  const double samples = kRest_s * kRate_hz;
  const double bias_sigma = kSigma / std::sqrt(samples);
  const double slope_sigma = bias_sigma * std::sqrt(12.0) / kRest_s;
  for (const int order : {0, 1}) {
    SCOPED_TRACE(::testing::Message() << "order " << order << ", seeds from 1");
    Rms bias_error;
    Rms slope_error;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      Random random(seed);
      Pair pair;
      pair.sigma_dps = kSigma;
      if (order == 1) pair.slope_dps_s = {1e-4, -3e-4};
      Calibrator calibrator(order, kRest_s);
      feed(calibrator, pair, random);
      ASSERT_EQ(calibrator.restarts(), 0U) << seed;
      const Calibration& result = calibrator.result();
      const double centre_s = 0.5 * kRest_s;
      for (const std::size_t k : {0U, 1U}) {
        const double truth = pair.bias_dps[k] + pair.slope_dps_s[k] * centre_s;
        const double error = (result.bias_dps(k, centre_s) - truth) / bias_sigma;
        EXPECT_LT(std::abs(error), 5.0) << seed;
        bias_error.add(error);
        if (order == 0) continue;
        const double slope = result.bias_dps(k, centre_s + 1.0) - result.bias_dps(k, centre_s);
        const double slope_off = (slope - pair.slope_dps_s[k]) / slope_sigma;
        EXPECT_LT(std::abs(slope_off), 5.0) << seed;
        slope_error.add(slope_off);
      }
    }
    EXPECT_NEAR(bias_error.value(), 1.0, kSigmas * bias_error.relative_error());
    if (order == 1) {
      EXPECT_NEAR(slope_error.value(), 1.0, kSigmas * slope_error.relative_error());
    }
  }
}

// The first window begins exactly at the end of the calibration.
TEST(Calibrator, EndsAfterTheRestAndLeavesTheNextPairUnused) {
  Random random(1);
  Calibrator calibrator(1, kRest_s);
  EXPECT_EQ(calibrator.covered_s(), 0.0);
  EXPECT_EQ(feed(calibrator, Pair{}, random, 5.0, 10.0), 10.0) << "not yet complete";
  EXPECT_NEAR(calibrator.covered_s(), 4.99, 1e-12);
  EXPECT_EQ(feed(calibrator, Pair{}, random, 10.0), 25.0);
  EXPECT_EQ(calibrator.covered_s(), kRest_s);
  EXPECT_EQ(calibrator.result().end_s, 25.0);
  EXPECT_FALSE(calibrator.result().in_motion);
}

// At rest the true rate is the Earth's, which is not a bias.
TEST(Calibrator, TakesTheTrueRateOff) {
  Random random(1);
  Calibrator calibrator(0, kRest_s);
  for (int i = 0; calibrator.add(i / kRate_hz, {0.5 + 0.0032, -0.1 + 0.0032}, 0.0032); ++i) {
  }
  EXPECT_NEAR(calibrator.result().bias_dps(0, 0.0), 0.5, 1e-14);
  EXPECT_NEAR(calibrator.result().bias_dps(1, 0.0), -0.1, 1e-14);
}

// With a reference, the calibration does not wait for rest, and no motion enters the drift.
TEST(Calibrator, LearnsInMotionWhereTheTrueRateIsKnown) {
  Calibrator calibrator(1, kRest_s, WhenMoving::kKnown);
  double t_s = 0.0;
  const auto motion = [](double t) { return 50.0 * std::sin(t); };
  for (int i = 0; calibrator.add(t_s, {0.5 + motion(t_s), -0.1 + motion(t_s)}, motion(t_s)); ++i)
    t_s = i / kRate_hz;
  EXPECT_EQ(calibrator.restarts(), 0U);
  EXPECT_NEAR(calibrator.result().bias_dps(0, 30.0), 0.5, 1e-12);
  EXPECT_NEAR(calibrator.result().bias_dps(1, 30.0), -0.1, 1e-12);
  EXPECT_FALSE(calibrator.result().in_motion);
}

// If less than half of the time is covered, there is no fit: the calibration begins again with the
// next pair, and its result does not depend on the first attempt.
TEST(Calibrator, BeginsAgainAfterAHoleInTheStreams) {
  Random random(1);
  Pair pair;
  pair.slope_dps_s = {1e-3, 0.0};
  Calibrator calibrator(1, kRest_s);
  feed(calibrator, pair, random, 0.0, 8.0);
  EXPECT_EQ(feed(calibrator, pair, random, 21.0), 41.0);
  EXPECT_EQ(calibrator.restarts(), 1U);
  EXPECT_EQ(calibrator.result().end_s, 41.0);
  EXPECT_NEAR(calibrator.result().bias_dps(0, 30.0), 0.033 + 0.03, 1e-13);
}

// A few lost frames do not make a hole.
TEST(Calibrator, GoesOnOverShortGaps) {
  Random random(1);
  Calibrator calibrator(1, kRest_s);
  feed(calibrator, Pair{}, random, 0.0, 6.0);
  EXPECT_EQ(feed(calibrator, Pair{}, random, 9.0), 20.0);
  EXPECT_EQ(calibrator.restarts(), 0U);
  EXPECT_NEAR(calibrator.result().bias_dps(0, 20.0), 0.033, 1e-14);
}

// The car drives off and stops again: the result contains the later rest and no motion.
TEST(Calibrator, WaitsForRestWhereThePlatformMoves) {
  for (const double rate_dps : {0.3, -0.3, 5.0, 100.0}) {
    Random random(1);
    Pair pair;
    pair.sigma_dps = 0.01;
    pair.motion_dps = [rate_dps](double t_s) { return t_s > 8.3 && t_s < 13.3 ? rate_dps : 0.0; };
    Calibrator calibrator(0, kRest_s);
    const double end_s = feed(calibrator, pair, random);
    EXPECT_GE(calibrator.restarts(), 1U) << rate_dps;
    EXPECT_GE(end_s, 13.3 + kRest_s) << rate_dps;
    EXPECT_LE(end_s, 13.3 + kRest_s + 3 * Calibrator::kBlock_s) << rate_dps;
    EXPECT_NEAR(calibrator.result().bias_dps(0, end_s), 0.033, 5.0 * 0.01 / std::sqrt(2000.0));
    EXPECT_NEAR(calibrator.result().bias_dps(1, end_s), -0.0074, 5.0 * 0.01 / std::sqrt(2000.0));
    EXPECT_FALSE(calibrator.result().in_motion);
  }
}

// A car that drives off a second before the end has rested long enough; the result contains no
// motion.
TEST(Calibrator, IsContentWithNineTenthsOfTheRest) {
  Random random(1);
  Pair pair;
  pair.motion_dps = [](double t_s) { return t_s > 18.5 ? 20.0 : 0.0; };
  Calibrator calibrator(1, kRest_s);
  const double end_s = feed(calibrator, pair, random);
  EXPECT_NEAR(end_s, 19.0, 0.02);
  EXPECT_EQ(calibrator.result().end_s, end_s) << "the first window begins behind the motion";
  EXPECT_EQ(calibrator.restarts(), 0U);
  EXPECT_NEAR(calibrator.result().bias_dps(0, end_s), 0.033, 1e-13);
}

// Noise alone, of any size, is not motion, even if both gyros share half of its power.
TEST(Calibrator, TakesNoNoiseForMotion) {
  for (const double sigma_dps : {1e-5, 0.01, 1.0}) {
    for (const double correlation : {0.0, 0.5}) {
      for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        SCOPED_TRACE(::testing::Message() << "seed " << seed << " sigma " << sigma_dps
                                          << " correlation " << correlation);
        Random random(seed);
        Pair pair;
        pair.sigma_dps = sigma_dps;
        pair.correlation = correlation;
        Calibrator calibrator(0, kRest_s);
        EXPECT_EQ(feed(calibrator, pair, random), kRest_s);
        EXPECT_EQ(calibrator.restarts(), 0U);
      }
    }
  }
}

// Warming gyros drift together, and exactly equal readings have no noise for comparison.
TEST(Calibrator, TakesNoSlowDriftAndNoFrozenReadingForMotion) {
  Random random(1);
  Pair pair;
  pair.slope_dps_s = {0.01, 0.01};
  Calibrator warm(1, kRest_s);
  EXPECT_EQ(feed(warm, pair, random), kRest_s);
  EXPECT_EQ(warm.restarts(), 0U);
  Calibrator frozen(1, kRest_s);
  EXPECT_EQ(feed(frozen, Pair{}, random), kRest_s);
  EXPECT_EQ(frozen.restarts(), 0U);
}

// A ship never rests: its motion is accepted and reported, and no slope is learned from it.
TEST(Calibrator, AcceptsMotionWhereItIsToldToAndLearnsNoSlopeFromIt) {
  Random random(1);
  Pair pair;
  pair.slope_dps_s = {1e-3, -1e-3};
  pair.motion_dps = [](double t_s) { return 2.0 * std::sin(t_s) + 0.05 * t_s; };
  Calibrator calibrator(1, kRest_s, WhenMoving::kAccept);
  EXPECT_EQ(feed(calibrator, pair, random), kRest_s);
  const Calibration& result = calibrator.result();
  EXPECT_TRUE(result.in_motion);
  EXPECT_EQ(result.sum.slope_at(30.0), 0.0);
  EXPECT_NEAR(result.difference.slope_at(30.0), 2e-3, 1e-13) << "motion is not in the difference";
}

// The same setting on a platform that stands still is the ordinary calibration.
TEST(Calibrator, TellsNoMotionWhereItWasAllowedAndThereWasNone) {
  Random random(1);
  Pair pair;
  pair.slope_dps_s = {1e-3, 1e-3};
  Calibrator calibrator(1, kRest_s, WhenMoving::kAccept);
  feed(calibrator, pair, random);
  EXPECT_FALSE(calibrator.result().in_motion);
  EXPECT_NEAR(calibrator.result().sum.slope_at(30.0), 2e-3, 1e-13);
}

// A second of a slow gyro contains one or two pairs, whose noise must not look like motion.
TEST(Calibrator, CompletesWithSlowGyrosToo) {
  for (const double rate_hz : {0.8, 1.0, 2.7, 5.0}) {
    for (std::uint64_t seed = 1; seed <= 50; ++seed) {
      SCOPED_TRACE(::testing::Message() << rate_hz << " Hz, seed " << seed);
      Random random(seed);
      Pair pair;
      pair.sigma_dps = 0.3;
      Calibrator calibrator(1, 60.0);
      double t_s = 0.0;
      while (t_s < 100.0 && calibrator.add(t_s, pair.at(t_s, random), 0.0))
        t_s += 1.0 / rate_hz;
      EXPECT_LT(t_s, 61.5);
      EXPECT_EQ(calibrator.restarts(), 0U);
    }
  }
}

// Pairs that were discarded after a hole do not affect the detection of motion later.
TEST(Calibrator, ForgetsMotionBeforeAHole) {
  Random random(1);
  Pair pair;
  pair.motion_dps = [](double t_s) { return t_s > 3.0 && t_s < 5.0 ? 20.0 : 0.0; };
  Calibrator calibrator(1, kRest_s, WhenMoving::kAccept);
  feed(calibrator, pair, random, 0.0, 8.0);
  feed(calibrator, pair, random, 21.0);
  EXPECT_EQ(calibrator.restarts(), 1U);
  EXPECT_FALSE(calibrator.result().in_motion);
}

// Motion detected elsewhere counts like motion detected here: nine tenths of the rest are enough,
// less is not.
TEST(Calibrator, IsEndedByMotionThatAnotherOneSees) {
  for (const double until_s : {17.0, 19.0}) {
    SCOPED_TRACE(until_s);
    Random random(3);
    Pair pair;
    pair.sigma_dps = 0.01;
    Calibrator calibrator(1, kRest_s);
    feed(calibrator, pair, random, 0.0, until_s);
    const bool enough = until_s > 0.9 * kRest_s;
    EXPECT_EQ(calibrator.cut_short(until_s, until_s - 1.0), enough);
    EXPECT_EQ(calibrator.restarts(), enough ? 0U : 1U);
    if (!enough) continue;
    EXPECT_TRUE(calibrator.result().cut_short());
    EXPECT_NEAR(calibrator.result().used_until_s, 18.0, 0.05) << "the last second may hold motion";
    EXPECT_NEAR(calibrator.result().bias_dps(0, 9.0), 0.033, 5.0 * 0.01 / std::sqrt(1800.0));
  }
  Calibrator accepting(1, kRest_s, WhenMoving::kAccept);
  Random random(3);
  feed(accepting, Pair{}, random, 0.0, 10.0);
  EXPECT_FALSE(accepting.cut_short(10.0, 9.0));
  EXPECT_EQ(accepting.restarts(), 0U) << "motion is accepted";
  accepting.note_motion();
  EXPECT_LT(feed(accepting, Pair{}, random, 10.0), 1000.0);
  EXPECT_TRUE(accepting.result().in_motion);
  EXPECT_FALSE(accepting.result().cut_short());
}

}  // namespace
}  // namespace vgyro::fusion
