// Tests the noise of a pair from samples of known noise.

#include "fusion/noise_tracker.h"

#include <array>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kRate_hz = 50.0;

/// Two gyros on a platform, sample by sample, in the blocks that a tracker receives.
class Pair {
 public:
  Pair(const std::array<double, 2>& white_dps_rthz, std::uint64_t seed, double rate_hz = kRate_hz)
      : white(white_dps_rthz), rate_hz_(rate_hz), random_(seed) {}

  /// The true rate at a time, deg/s.
  std::function<double(double)> rate = [](double /*t_s*/) { return 0.0; };
  /// Added to gyro 1's rate, deg/s.
  std::function<double(double)> spike = [](double /*t_s*/) { return 0.0; };
  std::array<double, 2> white;
  double shared_white = 0.0;  ///< noise common to both
  std::array<double, 2> scale{1.0, 1.0};
  double step_dps = 0.0;  ///< to which both values are rounded
  std::array<double, 2> noise_gain{1.0, 1.0};

  template <class Use>
  void run(double seconds, Use&& use) {
    for (const double until = t_s_ + seconds; t_s_ < until; t_s_ = ++count_ / rate_hz_) {
      const double shared = random_.normal(shared_white * std::sqrt(rate_hz_));
      std::array<double, 2> y{};
      const std::array<double, 2> besides{spike(t_s_), 0.0};
      for (std::size_t k = 0; k < 2; ++k)
        y[k] = rounded(besides[k] + scale[k] * rate(t_s_) + shared +
                       random_.normal(white[k] * std::sqrt(rate_hz_ * noise_gain[k])));
      if (cells_.add(t_s_, y, noise_gain, Present::kBoth)) use(cells_.last());
    }
  }
  void measure(NoiseTracker& tracker, double seconds, bool moving = false) {
    run(seconds, [&](const CellBlock& block) { tracker.measure(block, moving); });
    tracker.settle(cells_.interval_s());
  }
  void watch(NoiseTracker& tracker, double seconds) {
    run(seconds, [&](const CellBlock& block) { tracker.watch(block); });
  }

 private:
  [[nodiscard]] double rounded(double value) const {
    return step_dps > 0.0 ? step_dps * std::round(value / step_dps) : value;
  }

  double rate_hz_;
  Random random_;
  CellBuilder cells_;
  double t_s_ = 0.0;
  double count_ = 0.0;
};

// Relative standard errors: of N² from differences of neighbouring cells √(3/cells), as four of
// five cells have a neighbour; of sample variances √(2/samples), as four of five samples are free
// with 5 in a cell.
double density_error(double seconds) {
  return std::sqrt(3.0 / (8.0 * seconds));
}
double sample_error(double seconds) {
  return std::sqrt(2.0 / (0.8 * kRate_hz * seconds));
}

TEST(NoiseTracker, MeasuresBothGyrosAtRest) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    SCOPED_TRACE(seed);
    const std::array<double, 2> white{1e-3, 3e-3};
    Pair pair(white, seed);
    NoiseTracker tracker({});
    pair.measure(tracker, 300.0);
    for (std::size_t k = 0; k < 2; ++k) {
      const double square = white[k] * white[k];
      EXPECT_NEAR(tracker.density()[2 * k] / square, 1.0, kSigmas * density_error(300.0));
      EXPECT_NEAR(tracker.sample_variance()[2 * k] / (square * kRate_hz), 1.0,
                  kSigmas * sample_error(300.0));
    }
    EXPECT_EQ(tracker.density()[1], 0.0) << "chance is no correlation";
    EXPECT_FALSE(tracker.noisy(0) || tracker.noisy(1));
  }
}

// Noise common to both gyros (vibration, supply) shows in the covariance.
TEST(NoiseTracker, MeasuresWhatTheGyrosShareAtRest) {
  constexpr std::uint64_t kSeed = 6;
  Pair pair({1e-3, 2e-3}, kSeed);
  pair.shared_white = 1e-3;
  NoiseTracker tracker({});
  pair.measure(tracker, 600.0);
  // Var of a product's mean: (Σ₁₁Σ₂₂ + Σ₁₂²), against Σ₁₂: √11 times a variance's √2 standard.
  const double error = std::sqrt(11.0 / 2.0) * density_error(600.0);
  EXPECT_NEAR(tracker.density()[1] / 1e-6, 1.0, kSigmas * error) << "seed " << kSeed;
  EXPECT_NEAR(tracker.density()[0] / 2e-6, 1.0, kSigmas * density_error(600.0));
  EXPECT_NEAR(tracker.density()[2] / 5e-6, 1.0, kSigmas * density_error(600.0));
}

// In motion the common part is motion, not noise.
TEST(NoiseTracker, TakesNoMotionForNoise) {
  constexpr std::uint64_t kSeed = 7;
  Pair pair({1e-3, 3e-3}, kSeed);
  pair.rate = [](double t_s) { return 0.05 * std::sin(8.0 * t_s); };
  NoiseTracker moving({});
  pair.measure(moving, 600.0, true);
  EXPECT_NEAR(moving.density()[2] / 9e-6, 1.0, 0.15) << "seed " << kSeed;
  EXPECT_LT(moving.density()[0], 3e-6) << "the motion alone has " << 1.25e-3 * 0.1;
}

TEST(NoiseTracker, BelievesTheModelFile) {
  Pair pair({1e-3, 3e-3}, 8);
  std::array<GyroParameters, 2> gyros;
  gyros[0].white_dps_rthz = 5e-4;
  NoiseTracker tracker(gyros);
  pair.measure(tracker, 60.0);
  EXPECT_DOUBLE_EQ(tracker.density()[0], 25e-8);
  EXPECT_NEAR(tracker.density()[2] / 9e-6, 1.0, kSigmas * density_error(60.0));
}

// A pair's noise_gain is the remaining share of a raw sample's noise; the tracker reports the raw
// sample's.
TEST(NoiseTracker, KnowsAveragedSamplesFromRawOnes) {
  constexpr std::uint64_t kSeed = 9;
  Pair pair({1e-3, 3e-3}, kSeed);
  pair.noise_gain = {0.5, 0.2};
  NoiseTracker tracker({});
  pair.measure(tracker, 300.0);
  EXPECT_NEAR(tracker.sample_variance()[0] / (1e-6 * kRate_hz), 1.0, kSigmas * sample_error(300.0));
  EXPECT_NEAR(tracker.sample_variance()[2] / (9e-6 * kRate_hz), 1.0, kSigmas * sample_error(300.0));
}

// A sensor that repeats one value has at least the noise of its step.
TEST(NoiseTracker, GivesAStandingValueTheNoiseOfItsStep) {
  constexpr double kStep_dps = 0.1;
  std::array<GyroParameters, 2> gyros;
  gyros[0].resolution_dps = kStep_dps;
  Pair pair({0.0, 0.0}, 10);
  NoiseTracker tracker(gyros);
  pair.measure(tracker, 60.0);
  EXPECT_NEAR(tracker.sample_variance()[0], kStep_dps * kStep_dps / 12.0, 1e-12);
  EXPECT_NEAR(tracker.density()[0], kStep_dps * kStep_dps / 12.0 / kRate_hz, 1e-9);
  EXPECT_GT(tracker.density()[2], 0.0) << "no gyro is without noise";
}

// Ten times the noise, while the platform turns: the right gyro is named, its variance is found,
// and it is no longer named afterwards.
TEST(NoiseTracker, FollowsARiseOfOneGyroInMotion) {
  for (std::size_t bad = 0; bad < 2; ++bad) {
    constexpr std::uint64_t kSeed = 12;
    SCOPED_TRACE(::testing::Message() << "gyro " << bad + 1 << ", seed " << kSeed);
    const std::array<double, 2> usual{1e-3, 2e-3};
    Pair pair(usual, kSeed);
    NoiseTracker tracker({});
    pair.measure(tracker, 300.0);
    pair.rate = [](double t_s) { return 2.0 * std::sin(0.3 * t_s); };
    pair.white[bad] *= 10.0;
    pair.watch(tracker, 20.0);
    EXPECT_TRUE(tracker.noisy(bad));
    EXPECT_FALSE(tracker.noisy(1 - bad));
    const double now = pair.white[bad] * pair.white[bad];
    EXPECT_GT(tracker.density()[2 * bad], 0.5 * now);
    EXPECT_LT(tracker.density()[2 * bad], 2.0 * now);
    EXPECT_NEAR(tracker.usual_density()[2 * bad] * 100.0 / now, 1.0, 0.3) << "kept";
    pair.white = usual;
    pair.watch(tracker, 20.0);
    EXPECT_FALSE(tracker.noisy(bad));
    EXPECT_NEAR(tracker.density()[2 * bad] * 100.0 / now, 1.0, 0.5);
  }
}

// Turning is not noise, however hard.
TEST(NoiseTracker, FindsNoRiseWhereThePlatformOnlyTurns) {
  constexpr std::uint64_t kSeed = 13;
  Pair pair({1e-3, 2e-3}, kSeed);
  NoiseTracker tracker({});
  pair.measure(tracker, 300.0);
  const double usual = tracker.density()[0];
  pair.rate = [](double t_s) { return 60.0 * std::sin(2.0 * t_s); };
  pair.run(120.0, [&](const CellBlock& block) {
    tracker.watch(block);
    EXPECT_FALSE(tracker.noisy(0) || tracker.noisy(1)) << block.from_s << " s, seed " << kSeed;
    EXPECT_LT(tracker.density()[0], 4.0 * usual) << block.from_s << " s, seed " << kSeed;
  });
}

// --- coarse values -------------------------------------------------------------------------------

/// Mean square error of the mean of round(x + noise), in units of the step: 40 places of x between
/// two steps, drawn.
double rounding_by_chance(double noise, Random& random) {
  constexpr int kPlaces = 40;
  constexpr int kDraws = 20'000;
  double square = 0.0;
  for (int place = 0; place < kPlaces; ++place) {
    const double x = (place + 0.5) / kPlaces;
    double mean = 0.0;
    double squares = 0.0;
    for (int i = 0; i < kDraws; ++i) {
      const double away = std::round(x + random.normal(noise)) - x;
      mean += away / kDraws;
      squares += away * away / kDraws;
    }
    // Removes the draws' own variance.
    square += (mean * mean - (squares - mean * mean) / (kDraws - 1)) / kPlaces;
  }
  return square;
}

// Never less than the true value, and where it matters no more than twice as much: one term of a
// series represents all of it.
TEST(NoiseTracker, KnowsHowFarRoundingPutsAMeanOff) {
  constexpr double kStep_dps = 0.1;
  constexpr std::uint64_t kSeed = 21;
  Random random(kSeed);
  NoiseTracker tracker({});
  for (const double noise : {0.0, 0.05, 0.1, 0.2, 0.3, 0.4}) {
    const double truth = squared(kStep_dps) * rounding_by_chance(noise, random);
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      tracker.set_resolution(gyro, kStep_dps);
    const double sample = squared(kStep_dps) * (squared(noise) + 1.0 / 12.0);
    tracker.resume({sample / kRate_hz, 0.0, sample / kRate_hz}, {sample, sample});
    // Remaining error of the draws: the squared standard error of a mean.
    const double chance = squared(kStep_dps) * 4.0 * 0.35 / 20'000;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      EXPECT_GT(tracker.rounding_variance(gyro), 0.97 * truth - chance)
          << noise << " steps of noise, seed " << kSeed;
      EXPECT_LT(tracker.rounding_variance(gyro), 2.0 * truth + chance)
          << noise << " steps of noise, seed " << kSeed;
    }
  }
  NoiseTracker fine({});
  fine.resume({1e-6, 0.0, 1e-6}, {5e-5, 5e-5});
  EXPECT_EQ(fine.rounding_variance(0), 0.0) << "no step is known";
}

// Both gyros step at the same instants by the same amount: each one's own part is zero, or a
// rounding error below zero. Nothing may become NaN, or a noise of 0.
TEST(NoiseTracker, StaysFiniteWhereBothStepAlike) {
  for (const double step_dps : {1e-3, 0.1, 1.0 / 3.0}) {
    constexpr std::uint64_t kSeed = 22;
    SCOPED_TRACE(::testing::Message() << step_dps << ", seed " << kSeed);
    Pair pair({0.0, 0.0}, kSeed);
    pair.step_dps = step_dps;
    pair.rate = [](double t_s) { return 3.0 * std::sin(0.7 * t_s) + 1e4; };
    NoiseTracker tracker({});
    pair.measure(tracker, 60.0, true);
    for (int i = 0; i < 2; ++i) {
      pair.run(300.0, [&](const CellBlock& block) {
        tracker.watch(block);
        for (std::size_t k = 0; k < 3; ++k) {
          ASSERT_TRUE(std::isfinite(tracker.density()[k])) << block.from_s;
          ASSERT_TRUE(std::isfinite(tracker.sample_variance()[k])) << block.from_s;
        }
        ASSERT_GT(tracker.density()[0], 0.0);
        ASSERT_GT(tracker.density()[2], 0.0);
        ASSERT_GT(tracker.sample_variance()[0], 0.0);
        ASSERT_GT(tracker.sample_variance()[2], 0.0);
      });
      for (std::size_t gyro = 0; gyro < 2; ++gyro)
        tracker.set_resolution(gyro, step_dps);
      pair.measure(tracker, 60.0, true);
    }
  }
}

// Scale factors differ, and the platform sways: the louder gyro's common part exceeds all of the
// other's signal. Neither gyro is left without noise.
TEST(NoiseTracker, LeavesNoGyroWithoutNoiseWhereScalesDifferAndThePlatformSways) {
  for (const double scale : {0.9, 0.98, 1.02, 1.1}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << scale << ", seed " << seed);
      Pair pair({1e-3, 3e-3}, seed);
      pair.scale = {1.0, scale};
      pair.rate = [](double t_s) { return 0.5 * std::sin(8.0 * t_s) + 0.3 * std::sin(3.0 * t_s); };
      for (const bool told : {false, true}) {
        NoiseTracker tracker({});
        pair.measure(tracker, 120.0, told);
        // Each gyro keeps at least a twentieth of the difference's variance.
        EXPECT_GT(tracker.density()[0], 0.04 * (1e-6 + 9e-6)) << told;
        EXPECT_GT(tracker.density()[2], 0.04 * (1e-6 + 9e-6)) << told;
        EXPECT_GT(tracker.sample_variance()[0], 0.04 * (1e-6 + 9e-6) * kRate_hz) << told;
        EXPECT_GT(tracker.sample_variance()[2], 0.04 * (1e-6 + 9e-6) * kRate_hz) << told;
      }
    }
  }
}

// All blocks of an ordinary rest are usual, except one in ten thousand; a block with boarding
// passengers is not.
TEST(NoiseTracker, KnowsAnUnusualBlock) {
  constexpr std::uint64_t kSeed = 23;
  Pair pair({1e-3, 3e-3}, kSeed);
  NoiseTracker tracker({});
  pair.measure(tracker, 300.0);
  int unusual = 0;
  int blocks = 0;
  pair.run(3600.0, [&](const CellBlock& block) {
    unusual += tracker.usual(block) ? 0 : 1;
    ++blocks;
  });
  EXPECT_LT(unusual, blocks / 100) << "seed " << kSeed;
  pair.rate = [](double t_s) { return 0.1 * std::sin(40.0 * t_s); };
  pair.run(1.0, [](const CellBlock& /*of both*/) {});
  pair.run(60.0,
           [&](const CellBlock& block) { EXPECT_FALSE(tracker.usual(block)) << block.from_s; });
}

// A value that is no measurement is found in its block and affects no other. Noise and motion, of
// both gyros or felt by one alone, do not look like one. The smallest is twenty times the noise.
TEST(NoiseTracker, KnowsABlockWithASpike) {
  constexpr std::uint64_t kSeed = 24;
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  const std::array<std::function<double(double)>, 3> motions{
      [](double /*t_s*/) { return 0.0; },
      [](double t_s) { return 20.0 * std::sin(0.8 * t_s); },
      [](double t_s) { return 5.0 * std::sin(6.0 * t_s); },
  };
  for (const auto& motion : motions) {
    for (const double other_feels : {1.0, 1.01, 0.0}) {
      Pair pair({1e-3, 3e-3}, kSeed);
      NoiseTracker tracker({});
      pair.measure(tracker, 300.0);
      pair.rate = motion;
      pair.scale[1] = other_feels;
      pair.run(1.0, [](const CellBlock& /*in which it begins*/) {});
      pair.run(300.0, [&](const CellBlock& block) { EXPECT_FALSE(tracker.spiked(block, 0.0)); });
    }
    for (const double spike_dps : {0.5, -1.0, 50.0}) {
      Pair pair({1e-3, 3e-3}, kSeed);
      NoiseTracker tracker({});
      pair.measure(tracker, 300.0);
      double at_s = 330.0;
      pair.rate = motion;
      pair.spike = [&](double t_s) { return std::abs(t_s - at_s) < 1e-6 ? spike_dps : 0.0; };
      int spiked = 0;
      pair.run(300.0, [&](const CellBlock& block) {
        const bool holds_it = block.from_s - 1e-6 < at_s && at_s < block.to_s - 1e-6;
        EXPECT_EQ(tracker.spiked(block, 0.0), holds_it) << spike_dps << " at " << at_s;
        if (holds_it) at_s += 3.14;
        spiked += holds_it ? 1 : 0;
      });
      EXPECT_GT(spiked, 50);
    }
  }
}

}  // namespace
}  // namespace vgyro::fusion
