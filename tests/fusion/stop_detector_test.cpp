// Blocks as two gyros of known noise would make them, on platforms that stand, turn and sway. What
// a steady stretch is, stop or turn, is not judged here any more: readings_test.cpp has the tests
// of ferries, turntables and drifts that have jumped.

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
    // The gyros' own noises differ; their mean is the cells'.
    const double apart = random_.normal(kWhite / std::sqrt(2.0 * kBlock_s));
    for (std::size_t k = 0; k < 2; ++k) {
      level.excess_variance[k] = kWhite * kWhite / kBlock_s;
      level.excess_dps[k] = level.bias_dps[k] + rate_dps + sum / kCells + (k == 0 ? apart : -apart);
    }
    return detector.judge(level, wheels);
  }
  /// Blocks of this steadiness among those of some seconds at a constant rate.
  int count(Steadiness steadiness, double seconds, double rate_dps = 0.0) {
    int found = 0;
    for (int i = 0; i < static_cast<int>(seconds / kBlock_s); ++i)
      found += block(rate_dps) == steadiness ? 1 : 0;
    return found;
  }
  /// Motion through an angle, about 10 deg/s, as a driver turns: not steadily, not even within a
  /// block.
  void turn(double angle_deg) {
    const double sway = sway_dps;
    sway_dps = 2.0;
    for (double angle = 0.0; angle < angle_deg; angle += 10.0 * kBlock_s)
      block(10.0);
    sway_dps = sway;
  }
  /// As a wave moves it: about no rate.
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

// Noise alone seldom ends a stretch: the limits stand at 3.5 standard deviations. It is the same
// for a turn at a constant rate, however fast: which of the two it is, is for others to say.
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

// A rate that changes by ten standard deviations of a block each time is no constant one.
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

// Boarding passengers and wind are no motion where the wheels say so, and their sway is told: half
// to twice of what a cell scatters by, on average.
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

// Wheels that stand while the platform turns are broken, until they have rolled.
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

// A ferry's deck turns under wheels that stand, but not as fast as this; a step of the drift that
// was doubted as much is no turn.
TEST(StopDetector, TakesNoDoubtOfTheDriftForATurnUnderStandingWheels) {
  constexpr std::uint64_t kSeed = 9;
  Platform platform(kSeed);
  platform.wheels = Wheels::kStanding;
  for (const double rate_dps : {0.1, 0.5, 0.9}) {
    platform.count(Steadiness::kSteady, 60.0, rate_dps);
    EXPECT_FALSE(platform.detector.wheels_distrusted()) << rate_dps << ", seed " << kSeed;
  }
}

// --- what is said of a turn ----------------------------------------------------------------------

// Stops are commoner than steady turns; wheels that stand make a turn rare.
TEST(StopDetector, HoldsAStopForLikelierAndMoreSoOnWheels) {
  const StopDetector detector;
  const double unknown = detector.log_turning(Wheels::kUnknown);
  EXPECT_LT(unknown, 0.0);
  EXPECT_GT(unknown, std::log(0.1)) << "yet turns are no rarity";
  EXPECT_LT(detector.log_turning(Wheels::kStanding), unknown - 1.0);
}

// What a stretch's length tells does not depend on how it is cut into windows.
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

// A bend ends within a minute. Under wheels that stand there are no bends, so their end tells less.
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

  // Somebody gets in, a wave comes: a few seconds that are not steady, and nothing has turned.
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
// smooth block is no steady stretch, and the angle counts on.
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
