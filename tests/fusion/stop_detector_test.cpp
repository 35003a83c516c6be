// Blocks as two gyros of known noise would make them, on platforms that stand, turn and sway.

#include "fusion/stop_detector.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using Verdict = StopDetector::Verdict;

constexpr double kWhite = 2e-3;  // deg/s/√Hz, of either gyro
constexpr double kDoubt = 5e-3;  // deg/s, of the drift
constexpr double kBlock_s = 0.5;

class Platform {
 public:
  explicit Platform(std::uint64_t seed) : random_(seed) {}

  StopDetector detector;
  Wheels wheels = Wheels::kUnknown;
  double bias_error_dps = 0.0;  ///< both gyros' drift beyond what is known of it
  double sway_dps = 0.0;        ///< rms, of each cell

  Verdict block(double rate_dps) {
    BlockLevel level;
    level.length_s = kBlock_s;
    level.cells = 5.0;
    level.weight = {0.5, 0.5};
    level.doubt_variance = kDoubt * kDoubt;
    level.noise_variance = 0.5 * kWhite * kWhite / 0.1;
    level.bias_dps = {0.1, -0.2};
    double sum = 0.0;
    double squares = 0.0;
    const double sigma = std::hypot(std::sqrt(level.noise_variance), sway_dps);
    for (int i = 0; i < 5; ++i) {
      const double cell = random_.normal(sigma);
      sum += cell;
      squares += cell * cell;
    }
    level.cell_variance = (squares - sum * sum / 5.0) / 4.0;
    // The gyros' own noises differ; their mean is the cells'.
    const double apart = random_.normal(kWhite / std::sqrt(2.0 * kBlock_s));
    for (std::size_t k = 0; k < 2; ++k) {
      level.excess_variance[k] = kWhite * kWhite / kBlock_s;
      level.excess_dps[k] =
          level.bias_dps[k] + bias_error_dps + rate_dps + sum / 5.0 + (k == 0 ? apart : -apart);
    }
    return detector.judge(level, wheels);
  }
  /// Blocks with this verdict among those of some seconds at a constant rate.
  int count(Verdict verdict, double seconds, double rate_dps = 0.0) {
    int found = 0;
    for (int i = 0; i < static_cast<int>(seconds / kBlock_s); ++i)
      found += block(rate_dps) == verdict ? 1 : 0;
    return found;
  }
  /// Motion through an angle, about 10 deg/s, as a driver turns: not steadily.
  void turn(double angle_deg) {
    for (double angle = 0.0; angle < angle_deg; angle += 20.0 * kBlock_s) {
      block(8.0);
      block(12.0);
    }
  }

 private:
  Random random_;
};

TEST(StopDetector, FindsAStopAfterTwoAndAHalfSeconds) {
  constexpr std::uint64_t kSeed = 1;
  Platform platform(kSeed);
  platform.turn(100.0);
  int block = 0;
  for (; block < 4; ++block)
    EXPECT_NE(platform.block(0.0), Verdict::kStop) << block;
  EXPECT_EQ(platform.block(0.0), Verdict::kStop) << "seed " << kSeed;
  EXPECT_EQ(platform.block(5.0), Verdict::kMoving);
  EXPECT_EQ(platform.block(0.0), Verdict::kSteady) << "begins anew";
}

// Noise alone seldom ends a stop: the limits stand at 3.5 standard deviations.
TEST(StopDetector, KeepsALongStop) {
  constexpr std::uint64_t kSeed = 2;
  Platform platform(kSeed);
  const int blocks = 20'000;
  EXPECT_GT(platform.count(Verdict::kStop, kBlock_s * blocks), 0.97 * blocks) << "seed " << kSeed;
}

// Two gyros that read alike what no drift explains: the platform turns, however steadily.
TEST(StopDetector, RefusesAFerryAndATurntable) {
  for (const double rate_dps : {0.1, -0.1, 0.3, 1.0}) {
    constexpr std::uint64_t kSeed = 3;
    SCOPED_TRACE(::testing::Message() << rate_dps << " deg/s, seed " << kSeed);
    Platform platform(kSeed);
    EXPECT_EQ(platform.count(Verdict::kStop, 60.0), 120 - 4);
    EXPECT_EQ(platform.count(Verdict::kStop, 7200.0, rate_dps), 0);
    EXPECT_EQ(platform.count(Verdict::kRelearn, 7200.0, rate_dps), 0);
    EXPECT_GT(platform.count(Verdict::kRefused, 100.0, rate_dps), 180);
    // Back at rest a stop is a stop.
    platform.count(Verdict::kSteady, 3.0);
    EXPECT_GT(platform.count(Verdict::kStop, 10.0), 15);
  }
}

// One steady level at three stops, with real turns in between, is drift: no platform does that.
TEST(StopDetector, IsNotLockedOutByADriftThatWasThoughtImpossible) {
  constexpr std::uint64_t kSeed = 4;
  Platform platform(kSeed);
  platform.bias_error_dps = 20.0 * kDoubt;
  for (int stop = 0; stop < 2; ++stop) {
    platform.turn(90.0);
    EXPECT_GT(platform.count(Verdict::kRefused, 20.0), 30) << stop << ", seed " << kSeed;
  }
  platform.turn(90.0);
  EXPECT_EQ(platform.count(Verdict::kRelearn, 10.0), 1) << "and then it is known; seed " << kSeed;
}

// A turntable that is switched off and on again has not turned in between; a ferry's course
// changes are not one and the same rate.
TEST(StopDetector, IsNotPersuadedByRepetitionAlone) {
  constexpr std::uint64_t kSeed = 5;
  Platform table(kSeed);
  Platform ferry(kSeed);
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(table.count(Verdict::kRelearn, 20.0, 0.2), 0);
    table.count(Verdict::kStop, 20.0);
    EXPECT_EQ(ferry.count(Verdict::kRelearn, 20.0, i % 2 == 0 ? 0.2 : 0.4), 0);
    ferry.turn(45.0);
  }
}

TEST(StopDetector, LearnsNothingWhileTheWheelsRoll) {
  Platform platform(6);
  platform.wheels = Wheels::kRolling;
  EXPECT_EQ(platform.count(Verdict::kMoving, 600.0), 1200);
}

// Boarding passengers and wind are no motion where the wheels say so, and their sway is told.
TEST(StopDetector, AllowsAStandingVehicleToSway) {
  constexpr std::uint64_t kSeed = 7;
  Platform platform(kSeed);
  platform.sway_dps = 0.02;
  EXPECT_EQ(platform.count(Verdict::kStop, 120.0), 0) << "without wheels, seed " << kSeed;
  platform.wheels = Wheels::kStanding;
  EXPECT_GT(platform.count(Verdict::kStop, 120.0), 180) << "seed " << kSeed;
  EXPECT_GT(platform.detector.sway_variance(), 0.01 * 0.01);
  platform.sway_dps = 0.3;
  EXPECT_EQ(platform.count(Verdict::kStop, 120.0), 0) << "that is motion";
}

// Wheels that stand while the platform turns are broken, until they have rolled.
TEST(StopDetector, DoesNotBelieveADeadWheelSensor) {
  constexpr std::uint64_t kSeed = 8;
  Platform platform(kSeed);
  platform.wheels = Wheels::kStanding;
  platform.sway_dps = 0.02;
  EXPECT_GT(platform.count(Verdict::kStop, 60.0), 90);
  platform.turn(50.0);
  EXPECT_EQ(platform.count(Verdict::kStop, 300.0), 0) << "sway counts as motion again";
  platform.wheels = Wheels::kRolling;
  platform.turn(50.0);
  platform.wheels = Wheels::kStanding;
  EXPECT_GT(platform.count(Verdict::kStop, 60.0), 90) << "they live, seed " << kSeed;
}

}  // namespace
}  // namespace vgyro::fusion
