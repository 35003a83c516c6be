// Blocks of two gyros of known noise, on platforms that stand, turn and sway. The detector does not
// decide between stop and turn: readings_test.cpp has the tests of ferries, turntables and drifts
// that have jumped.

#include "fusion/stop_detector.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using Steadiness = StopDetector::Steadiness;

constexpr double kWhite = 2e-3;  // deg/s/√Hz, of either gyro
constexpr double kDoubt = 5e-3;  // deg/s, of the drift
constexpr double kBlock_s = 0.5;
constexpr int kCells = 5;

class Platform {
 public:
  explicit Platform(std::uint64_t seed) : random_(seed) {}

  StopDetector detector;
  Wheels wheels = Wheels::kUnknown;
  double sway_dps = 0.0;  ///< rms, of each cell

  Steadiness block(double rate_dps) {
    BlockLevel level;
    level.length_s = kBlock_s;
    level.cells = kCells;
    level.weight = {0.5, 0.5};
    level.doubt_variance = kDoubt * kDoubt;
    level.noise_variance = 0.5 * kWhite * kWhite / (kBlock_s / kCells);
    level.bias_dps = {0.1, -0.2};
    double sum = 0.0;
    double squares = 0.0;
    const double sigma = std::hypot(std::sqrt(level.noise_variance), sway_dps);
    for (int i = 0; i < kCells; ++i) {
      const double cell = random_.normal(sigma);
      sum += cell;
      squares += cell * cell;
    }
    level.cell_variance = (squares - sum * sum / kCells) / (kCells - 1);
    // The gyros' own noise differs; their mean is the cells'.
    const double apart = random_.normal(kWhite / std::sqrt(2.0 * kBlock_s));
    for (std::size_t k = 0; k < 2; ++k) {
      level.excess_variance[k] = kWhite * kWhite / kBlock_s;
      level.excess_dps[k] = level.bias_dps[k] + rate_dps + sum / kCells + (k == 0 ? apart : -apart);
    }
    return detector.judge(level, wheels);
  }
  /// Number of blocks with this steadiness in some seconds at a constant rate.
  int count(Steadiness steadiness, double seconds, double rate_dps = 0.0) {
    int found = 0;
    for (int i = 0; i < static_cast<int>(seconds / kBlock_s); ++i)
      found += block(rate_dps) == steadiness ? 1 : 0;
    return found;
  }
  /// Motion through an angle at about 10 deg/s, like a driver's turn: not steady, not even within a
  /// block.
  void turn(double angle_deg) {
    const double sway = sway_dps;
    sway_dps = 2.0;
    for (double angle = 0.0; angle < angle_deg; angle += 10.0 * kBlock_s)
      block(10.0);
    sway_dps = sway;
  }
  /// Motion like in a wave, with a mean rate of 0.
  void shake(double seconds) {
    const double sway = sway_dps;
    sway_dps = 0.5;
    count(Steadiness::kMoving, seconds);
    sway_dps = sway;
  }

 private:
  Random random_;
};

TEST(StopDetector, IsSureOfASteadyStretchAfterTwoAndAHalfSeconds) {
  constexpr std::uint64_t kSeed = 1;
  Platform platform(kSeed);
  platform.turn(100.0);
  for (int block = 0; block < 4; ++block) {
    EXPECT_EQ(platform.block(0.0), Steadiness::kUnsure) << block;
    EXPECT_EQ(platform.detector.run_begins(), block == 0) << block;
  }
  EXPECT_EQ(platform.block(0.0), Steadiness::kSteady) << "seed " << kSeed;
  EXPECT_EQ(platform.block(5.0), Steadiness::kMoving);
  EXPECT_EQ(platform.block(0.0), Steadiness::kUnsure) << "begins anew";
  platform.count(Steadiness::kSteady, 10.0);
  platform.detector.reset();
  EXPECT_EQ(platform.block(0.0), Steadiness::kUnsure) << "begins anew after a reset";
}

// Noise alone seldom ends a stretch: the limits are at 3.5 standard deviations. The same holds for
// a turn at a constant rate, however fast: the detector does not distinguish the two.
TEST(StopDetector, KeepsALongStretchAtWhateverRate) {
  for (const double rate_dps : {0.0, 0.1, -1.0, 40.0}) {
    constexpr std::uint64_t kSeed = 2;
    Platform platform(kSeed);
    const int blocks = 20'000;
    EXPECT_GT(platform.count(Steadiness::kSteady, kBlock_s * blocks, rate_dps), 0.97 * blocks)
        << rate_dps << " deg/s, seed " << kSeed;
    EXPECT_EQ(platform.detector.sway_variance(), 0.0);
  }
}

// A rate that changes by ten standard deviations of a block each time is not constant.
TEST(StopDetector, CallsAChangingRateMotion) {
  constexpr std::uint64_t kSeed = 3;
  Platform platform(kSeed);
  const double step_dps = 10.0 * kWhite / std::sqrt(kBlock_s);
  int moving = 0;
  for (int i = 0; i < 200; ++i)
    moving += platform.block(i % 2 == 0 ? 0.0 : step_dps) != Steadiness::kSteady ? 1 : 0;
  EXPECT_EQ(moving, 200) << "seed " << kSeed;
}

TEST(StopDetector, FindsNothingSteadyWhileTheWheelsRoll) {
  Platform platform(6);
  platform.wheels = Wheels::kRolling;
  EXPECT_EQ(platform.count(Steadiness::kMoving, 600.0), 1200);
}

// With standing wheels, boarding passengers and wind are not motion, and their sway is reported:
// half to twice the scatter of a cell, on average.
TEST(StopDetector, AllowsAStandingVehicleToSway) {
  constexpr std::uint64_t kSeed = 7;
  Platform platform(kSeed);
  platform.sway_dps = 0.02;
  EXPECT_EQ(platform.count(Steadiness::kSteady, 120.0), 0) << "without wheels, seed " << kSeed;
  platform.wheels = Wheels::kStanding;
  EXPECT_GT(platform.count(Steadiness::kSteady, 120.0), 180) << "seed " << kSeed;
  double told = 0.0;
  for (int i = 0; i < 100; ++i) {
    platform.block(0.0);
    told += platform.detector.sway_variance() / 100.0;
  }
  const double scatter = platform.sway_dps * platform.sway_dps;
  EXPECT_GT(told, 0.5 * scatter) << "seed " << kSeed;
  EXPECT_LT(told, 2.0 * scatter) << "seed " << kSeed;
  platform.sway_dps = 0.3;
  EXPECT_EQ(platform.count(Steadiness::kSteady, 120.0), 0) << "that is motion";
}

// A wheel signal that stands while the platform turns is ignored until the wheels have rolled.
TEST(StopDetector, DoesNotBelieveADeadWheelSensor) {
  constexpr std::uint64_t kSeed = 8;
  Platform platform(kSeed);
  platform.wheels = Wheels::kStanding;
  platform.sway_dps = 0.02;
  EXPECT_GT(platform.count(Steadiness::kSteady, 60.0), 90);
  EXPECT_FALSE(platform.detector.wheels_distrusted());
  const double believed = platform.detector.log_turning(Wheels::kStanding);
  platform.turn(50.0);
  EXPECT_TRUE(platform.detector.wheels_distrusted());
  EXPECT_EQ(platform.detector.log_turning(Wheels::kStanding),
            platform.detector.log_turning(Wheels::kUnknown))
      << "they say nothing";
  EXPECT_EQ(platform.count(Steadiness::kSteady, 300.0), 0) << "sway counts as motion again";
  platform.wheels = Wheels::kRolling;
  platform.turn(50.0);
  platform.wheels = Wheels::kStanding;
  EXPECT_GT(platform.count(Steadiness::kSteady, 60.0), 90) << "they live, seed " << kSeed;
  EXPECT_FALSE(platform.detector.wheels_distrusted());
  EXPECT_EQ(platform.detector.log_turning(Wheels::kStanding), believed);
}

// A ferry's deck turns under standing wheels, but not this fast; a step within the drift's
// uncertainty is not a turn.
TEST(StopDetector, TakesNoDoubtOfTheDriftForATurnUnderStandingWheels) {
  constexpr std::uint64_t kSeed = 9;
  Platform platform(kSeed);
  platform.wheels = Wheels::kStanding;
  for (const double rate_dps : {0.1, 0.5, 0.9}) {
    platform.count(Steadiness::kSteady, 60.0, rate_dps);
    EXPECT_FALSE(platform.detector.wheels_distrusted()) << rate_dps << ", seed " << kSeed;
  }
}

// --- the odds of a turn --------------------------------------------------------------------------

// Stops are commoner than steady turns; with standing wheels a turn is rare.
TEST(StopDetector, HoldsAStopForLikelierAndMoreSoOnWheels) {
  const StopDetector detector;
  const double unknown = detector.log_turning(Wheels::kUnknown);
  EXPECT_LT(unknown, 0.0);
  EXPECT_GT(unknown, std::log(0.1)) << "yet turns are no rarity";
  EXPECT_LT(detector.log_turning(Wheels::kStanding), unknown - 1.0);
}

// The evidence of a stretch's length does not depend on how it is cut into windows.
TEST(StopDetector, TellsTheSameOfALengthHoweverItIsCut) {
  for (const Wheels wheels : {Wheels::kUnknown, Wheels::kStanding}) {
    Platform platform(10);
    platform.wheels = wheels;
    double sum = 0.0;
    double covered_s = 0.0;
    while (covered_s < 40.0 && platform.block(0.0) != Steadiness::kMoving) {
      sum += platform.detector.log_turning_gain(wheels, kBlock_s);
      covered_s += kBlock_s;
    }
    ASSERT_GT(covered_s, 5.0);
    EXPECT_NEAR(platform.detector.log_turning_gain(wheels, covered_s), sum, 1e-12);
  }
}

// A bend ends within a minute. With standing wheels there are no bends, so the length is weaker
// evidence.
TEST(StopDetector, HoldsWhatLastsForAStop) {
  Platform road(11);
  Platform wheels(11);
  wheels.wheels = Wheels::kStanding;
  for (int i = 0; i < 60; ++i) {
    road.block(0.0);
    wheels.block(0.0);
  }
  const double told = road.detector.log_turning_gain(Wheels::kUnknown, 30.0);
  EXPECT_LT(told, -0.5);
  EXPECT_GT(wheels.detector.log_turning_gain(Wheels::kStanding, 30.0), told);
}

// --- has the platform moved on? ------------------------------------------------------------------

TEST(StopDetector, KnowsWhetherThePlatformHasMovedOn) {
  constexpr std::uint64_t kSeed = 12;
  Platform platform(kSeed);
  EXPECT_TRUE(platform.detector.moved_on()) << "nothing is known yet";
  platform.count(Steadiness::kSteady, 10.0);
  platform.detector.stay();
  EXPECT_FALSE(platform.detector.moved_on());

  // A passenger gets in, or a wave comes: a few seconds are not steady, and nothing has turned.
  platform.shake(5.0);
  platform.count(Steadiness::kSteady, 10.0);
  EXPECT_FALSE(platform.detector.moved_on()) << "seed " << kSeed;

  platform.turn(60.0);
  EXPECT_TRUE(platform.detector.moved_on()) << "it has turned";
  platform.count(Steadiness::kSteady, 10.0);
  platform.detector.stay();

  platform.shake(30.0);
  EXPECT_TRUE(platform.detector.moved_on()) << "half a minute of motion";
  platform.count(Steadiness::kSteady, 10.0);
  platform.detector.stay();

  platform.wheels = Wheels::kRolling;
  platform.block(0.0);
  EXPECT_TRUE(platform.detector.moved_on()) << "the wheels rolled";
}

// A turn of 90 deg whose rate changes from block to block, each of them smooth in itself: one
// smooth block is no steady stretch, and the angle still accumulates.
TEST(StopDetector, CountsATurnThroughSmoothBlocks) {
  constexpr std::uint64_t kSeed = 13;
  Platform platform(kSeed);
  platform.count(Steadiness::kSteady, 10.0);
  platform.detector.stay();
  for (int i = 0; i < 18; ++i)
    EXPECT_NE(platform.block(i % 2 == 0 ? 8.0 : 12.0), Steadiness::kSteady);
  EXPECT_TRUE(platform.detector.moved_on()) << "seed " << kSeed;
}

}  // namespace
}  // namespace vgyro::fusion
