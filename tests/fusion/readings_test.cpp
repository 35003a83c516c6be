// The hypotheses (Readings) of a small world with known truth: two gyros with white noise and walks
// on a platform that moves, stands, or turns steadily. Windows are those that the corrector makes.

#include "fusion/readings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "fusion/quadratic.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr std::array<double, 2> kWhite{1e-3, 2e-3};  // deg/s/√Hz
constexpr std::array<double, 2> kWalk{3e-5, 6e-5};   // deg/s/√s
constexpr std::array<double, 2> kBias{0.05, -0.1};   // deg/s
constexpr double kWindow_s = 10.0;

// A steady stretch is a stop in seven cases of ten; with standing wheels, three in a hundred are
// turns. The evidence of a stretch's length is tested in stop_detector_test.cpp.
const double kLogTurning = std::log(0.3 / 0.7);
const double kLogTurningOnWheels = std::log(0.03 / 0.97);

std::array<GyroParameters, 2> told() {
  std::array<GyroParameters, 2> gyros;
  for (std::size_t k = 0; k < 2; ++k) {
    gyros[k].white_dps_rthz = kWhite[k];
    gyros[k].walk_dps_rts = kWalk[k];
  }
  return gyros;
}

class World {
 public:
  explicit World(std::uint64_t seed, const std::array<GyroParameters, 2>& gyros = told())
      : readings(gyros), bias_dps(kBias), random_(seed) {}

  Readings readings;
  std::array<double, 2> bias_dps;
  std::array<double, 2> ramp_dps_s{};
  double log_turning = kLogTurning;

  /// A minute at rest.
  void calibrate(double seconds = 60.0) {
    const std::array<double, 2> mean = pass(1.0);
    readings.begin(kWhite, {mean[0] + noise(0, 1.0), mean[1] + noise(1, 1.0)},
                   {squared(kWhite[0]), 0.0, squared(kWhite[1])});
    for (double t = 1.0; t < seconds; t += 1.0)
      readings.learn(1.0, standing(1.0, 0.0));
  }
  /// Turns and straights: the difference alone is measured.
  void move(double seconds) {
    for (double t = 0.0; t < seconds; t += kWindow_s)
      readings.learn(kWindow_s, difference(kWindow_s));
  }
  /// A steady run; `elsewhere`: the platform has moved on before it.
  void steady(double seconds, double rate_dps, bool elsewhere = true) {
    double length = 1.0;
    bool first = true;
    for (double t = 0.0; t < seconds; first = false) {
      readings.learn_steady(window(length, rate_dps, elsewhere, first));
      t += length;
      length = std::min(2.0 * length, 4.0);
    }
  }
  void end() { readings.end_steady(); }
  /// A complete steady run after motion.
  void stop(double seconds, double rate_dps = 0.0) {
    steady(seconds, rate_dps);
    end();
  }

  [[nodiscard]] double error(int gyro) const {
    return readings.estimate().mean(gyro) - bias_dps[static_cast<std::size_t>(gyro)];
  }
  [[nodiscard]] double sigma(int gyro) const {
    return std::sqrt(readings.estimate().covariance(gyro, gyro));
  }
  DriftMeasurement difference(double length_s) {
    const std::array<double, 2> mean = pass(length_s);
    DriftMeasurement one(1);
    one.rows(0, kBias1) = 1.0;
    one.rows(0, kBias2) = -1.0;
    one.values(0) = mean[0] - mean[1] + noise(0, length_s) - noise(1, length_s);
    one.noise(0, 0) = (squared(kWhite[0]) + squared(kWhite[1])) / length_s;
    return one;
  }
  Random& random() { return random_; }

 private:
  double noise(std::size_t gyro, double length_s) {
    return random_.normal(kWhite[gyro] / std::sqrt(length_s));
  }
  /// Returns the biases' means over a window; afterwards the biases are those at its end.
  std::array<double, 2> pass(double length_s) {
    constexpr int kSteps = 10;
    std::array<double, 2> mean{};
    for (int i = 0; i < kSteps; ++i) {
      for (std::size_t k = 0; k < 2; ++k) {
        const double h = length_s / kSteps;
        const double step = random_.normal(kWalk[k] * std::sqrt(h)) + ramp_dps_s[k] * h;
        mean[k] += (bias_dps[k] + 0.5 * step) / kSteps;
        bias_dps[k] += step;
      }
    }
    return mean;
  }
  DriftMeasurement standing(double length_s, double rate_dps) {
    const std::array<double, 2> mean = pass(length_s);
    DriftMeasurement both(2);
    both.rows(0, kBias1) = both.rows(1, kBias2) = 1.0;
    for (int gyro = 0; gyro < 2; ++gyro) {
      const auto k = static_cast<std::size_t>(gyro);
      both.values(gyro) = mean[k] + rate_dps + noise(k, length_s);
      both.noise(gyro, gyro) = squared(kWhite[k]) / length_s;
    }
    return both;
  }
  SteadyWindow window(double length_s, double rate_dps, bool elsewhere, bool first) {
    SteadyWindow made;
    made.standing = standing(length_s, rate_dps);
    const auto& both = made.standing;
    made.turning = DriftMeasurement(1);
    made.turning.rows(0, kBias1) = 1.0;
    made.turning.rows(0, kBias2) = -1.0;
    made.turning.rows(0, kScale) = rate_dps;
    made.turning.values(0) = both.values(0) - both.values(1);
    made.turning.noise(0, 0) = both.noise(0, 0) + both.noise(1, 1);
    const double share = both.noise(1, 1) / made.turning.noise(0, 0);
    made.weight = {share, 1.0 - share};
    made.level_dps = share * both.values(0) + (1.0 - share) * both.values(1);
    made.level_variance =
        squared(share) * both.noise(0, 0) + squared(1.0 - share) * both.noise(1, 1);
    made.length_s = length_s;
    made.log_turning = first ? log_turning : 0.0;
    made.elsewhere = elsewhere;
    return made;
  }

  Random random_;
};

// --- stop or turn --------------------------------------------------------------------------------

TEST(Readings, HaveProbabilitiesThatSumToOne) {
  World world(1);
  world.calibrate();
  world.move(100.0);
  EXPECT_EQ(world.readings.standing() + world.readings.turning(), 0.0) << "not steady";
  for (const double rate_dps : {0.0, 0.002, 0.01, 0.1, 0.0}) {
    for (int window = 0; window < 4; ++window) {
      world.steady(0.5, rate_dps);
      EXPECT_NEAR(world.readings.standing() + world.readings.turning(), 1.0, 1e-12) << rate_dps;
    }
    world.end();
    EXPECT_EQ(world.readings.standing() + world.readings.turning(), 0.0) << "it has ended";
    world.move(100.0);
  }
  world.readings.split_step(0.05, 1e-6, 0.3);
  // Of many hypotheses the least likely are dropped.
  EXPECT_NEAR(world.readings.stepped(0), 0.3, 1e-3);
  EXPECT_NEAR(world.readings.stepped(0) + world.readings.stepped(1), 1.0, 1e-12);
}

// The probability of a turn is calibrated: among stretches drawn from the prior, the number of
// turns equals the sum of the probabilities, also in each part of the scale.
TEST(Readings, MeanWhatTheySayOfATurn) {
  constexpr int kStretches = 1500;
  constexpr std::uint64_t kSeed = 2;
  Random draw(kSeed);
  constexpr int kParts = 3;  // up to 0.2, to 0.8, beyond
  std::array<double, kParts> said{};
  std::array<double, kParts> spread{};
  std::array<double, kParts> true_turns{};
  for (int i = 0; i < kStretches; ++i) {
    World world(kSeed + 1000U + static_cast<std::uint64_t>(i));
    world.calibrate();
    world.move(draw.uniform(60.0, 1800.0));
    const bool turns = draw.uniform(0.0, 1.0) < 0.3;
    // 0.02 to 0.2 deg/s is as likely as 2 to 20 deg/s; below, the density is about constant.
    const double size = 0.02 * (std::exp(draw.uniform(0.0, std::log(60.02 / 0.02))) - 1.0);
    const double rate = (draw.below(2) == 0 ? 1.0 : -1.0) * size;
    world.steady(1.0, turns ? rate : 0.0);
    const double p = world.readings.turning();
    const std::size_t part = p < 0.2 ? 0 : p < 0.8 ? 1 : 2;
    said[part] += p;
    spread[part] += p * (1.0 - p);
    true_turns[part] += turns ? 1.0 : 0.0;
  }
  for (std::size_t part = 0; part < kParts; ++part) {
    EXPECT_NEAR(true_turns[part], said[part], kSigmas * std::sqrt(spread[part]) + 1.0)
        << "part " << part << ", seed " << kSeed;
  }
}

// With standing wheels a stretch is a stop that would be a slow turn without them.
TEST(Readings, HoldAStretchForAStopSoonerOnStandingWheels) {
  constexpr std::uint64_t kSeed = 3;
  World alone(kSeed);
  World wheels(kSeed);
  for (World* world : {&alone, &wheels}) {
    world->calibrate();
    world->move(1200.0);
  }
  wheels.log_turning = kLogTurningOnWheels;
  alone.steady(10.0, 0.004);
  wheels.steady(10.0, 0.004);
  EXPECT_GT(wheels.readings.standing(), alone.readings.standing()) << "seed " << kSeed;
  // A level that no drift explains is a turn even then: a ferry's deck.
  World ferry(kSeed);
  ferry.calibrate();
  ferry.move(300.0);
  ferry.log_turning = kLogTurningOnWheels;
  ferry.steady(10.0, 0.3);
  EXPECT_GT(ferry.readings.turning(), 0.99) << "seed " << kSeed;
}

// A healthy, calibrated pair with small uncertainty learns nothing from slow turns, ferries and
// turntables. Each lasts twenty minutes, with stops in between.
TEST(Readings, LearnNoSlowTurn) {
  for (const double rate_dps : {0.05, -0.1, 0.2, -0.5, 1.0}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << rate_dps << " deg/s, seed " << seed);
      World world(seed);
      world.calibrate();
      world.move(120.0);
      world.steady(1200.0, rate_dps);
      EXPECT_GT(world.readings.turning(), 0.99);
      world.end();
      for (int gyro = 0; gyro < 2; ++gyro) {
        EXPECT_LT(std::abs(world.error(gyro)), 4.0 * world.sigma(gyro)) << gyro;
        EXPECT_LT(std::abs(world.error(gyro)), 0.2 * std::abs(rate_dps)) << gyro;
      }
    }
  }
}

// A ferry casts off without a shake during a run of steady windows: the new level is a new run, and
// the result of the stop before it stays.
TEST(Readings, KeepAStopApartFromTheTurnThatFollowsIt) {
  constexpr std::uint64_t kSeed = 4;
  World world(kSeed);
  world.calibrate();
  world.move(600.0);
  world.steady(60.0, 0.0);
  EXPECT_GT(world.readings.standing(), 0.99) << "seed " << kSeed;
  world.steady(300.0, 0.2);
  EXPECT_GT(world.readings.turning(), 0.99) << "seed " << kSeed;
  for (int gyro = 0; gyro < 2; ++gyro)
    EXPECT_LT(std::abs(world.error(gyro)), 4.0 * world.sigma(gyro)) << gyro;
}

// Both drifts have jumped together by far more than expected: the first stop looks like a turn. A
// few stops, in places that the platform has moved between, are proof.
TEST(Readings, FindAJumpOfBothDriftsAfterAFewStops) {
  for (const double jump_dps : {0.02, -0.05, 0.1}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << jump_dps << " deg/s, seed " << seed);
      World world(seed);
      world.calibrate();
      world.move(120.0);
      for (double& bias : world.bias_dps)
        bias += jump_dps;
      for (int stop = 0; stop < 5; ++stop) {
        world.move(60.0);
        world.stop(30.0);
      }
      for (int gyro = 0; gyro < 2; ++gyro) {
        EXPECT_LT(std::abs(world.error(gyro)), 0.1 * std::abs(jump_dps)) << gyro;
        EXPECT_LT(std::abs(world.error(gyro)), 4.0 * world.sigma(gyro)) << gyro;
      }
    }
  }
}

// Repetition alone is no proof: a circle with a wobble, a turntable that is switched on and off, a
// ferry in a swell. The platform has not moved on between one steady run and the next.
TEST(Readings, AreNotPersuadedByRepetitionAlone) {
  struct Case {
    const char* name;
    double rate_dps;
    double other_dps;  ///< every second run
    double swell_dps;  ///< rms, from run to run
  };
  const std::vector<Case> cases{
      {"circle with a wobble", 0.3, 0.3, 0.0},
      {"turntable on and off", 0.2, 0.0, 0.0},
      {"ferry in a swell", 0.2, 0.2, 0.01},
  };
  for (const Case& which : cases) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << which.name << ", seed " << seed);
      World world(seed);
      world.calibrate();
      world.move(120.0);
      double worst = 0.0;
      for (int run = 0; run < 50; ++run) {
        const double rate = run % 2 == 0 ? which.rate_dps : which.other_dps;
        world.steady(20.0, rate + world.random().normal(which.swell_dps), run == 0);
        world.end();
        world.readings.predict(3.0);
        for (int gyro = 0; gyro < 2; ++gyro)
          worst = std::max(worst, std::abs(world.error(gyro)) / world.sigma(gyro));
      }
      // The greatest of a hundred: 4.5 standard deviations are one in a thousand of such runs.
      EXPECT_LT(worst, 4.5);
      EXPECT_LT(std::abs(world.error(0)), 0.2 * which.rate_dps);
    }
  }
}

// --- slopes --------------------------------------------------------------------------------------

// From some time on both drifts have a constant slope, which stops show. The estimated slope agrees
// with the true one within its σ.
TEST(Readings, FindTheSlopeOfARamp) {
  // Slopes of the size that sensors of this class have: a tenth to a third of N a second.
  for (const double share : {0.1, 0.3}) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << share << " N a second, seed " << seed);
      World world(seed);
      world.ramp_dps_s = {share * kWhite[0], -share * kWhite[1]};
      world.calibrate(120.0);
      for (int stop = 0; stop < 3; ++stop) {
        world.move(60.0);
        world.stop(30.0);
      }
      const DriftEstimate found = world.readings.estimate();
      for (int gyro = 0; gyro < 2; ++gyro) {
        const double slope = world.ramp_dps_s[static_cast<std::size_t>(gyro)];
        const double sigma = std::sqrt(found.slope_covariance(gyro, gyro));
        EXPECT_LT(std::abs(found.slope(gyro) - slope), 4.0 * sigma) << gyro;
        EXPECT_LT(std::abs(found.slope(gyro) - slope), 0.5 * std::abs(slope)) << gyro;
        EXPECT_LT(std::abs(world.error(gyro)), 4.0 * world.sigma(gyro)) << gyro;
      }
    }
  }
}

// --- steps ---------------------------------------------------------------------------------------

// Two gyros cannot show which one has stepped: both hypotheses stay, and σ covers either. A stop
// decides for the right one.
TEST(Readings, LeaveAStepOpenUntilAStopSettlesIt) {
  constexpr double kStep_dps = 0.05;
  constexpr double kFirst = 0.2;  // K₁² : K₂²
  for (std::size_t bad = 0; bad < 2; ++bad) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << "gyro " << bad + 1 << ", seed " << seed);
      World world(seed);
      world.calibrate();
      world.move(120.0);
      world.bias_dps[bad] += kStep_dps;
      world.readings.split_step(bad == 0 ? kStep_dps : -kStep_dps, squared(2e-3), kFirst);
      world.move(300.0);
      EXPECT_NEAR(world.readings.stepped(0), kFirst, 0.1) << "nothing has told";
      EXPECT_TRUE(world.readings.ambiguous());
      for (int gyro = 0; gyro < 2; ++gyro) {
        const double share = gyro == 0 ? kFirst : 1.0 - kFirst;
        const double spread = std::sqrt(share * (1.0 - share)) * kStep_dps;
        EXPECT_GT(world.sigma(gyro), 0.8 * spread) << gyro;
        EXPECT_LT(std::abs(world.error(gyro)), 3.0 * world.sigma(gyro)) << gyro;
      }
      world.stop(30.0);
      world.move(60.0);
      EXPECT_FALSE(world.readings.ambiguous());
      // A turn of exactly the step's size is not quite excluded.
      EXPECT_LT(world.readings.stepped(0) + world.readings.stepped(1), 0.01) << "settled";
      for (int gyro = 0; gyro < 2; ++gyro) {
        EXPECT_LT(world.sigma(gyro), 0.1 * kStep_dps) << gyro;
        EXPECT_LT(std::abs(world.error(gyro)), 4.0 * world.sigma(gyro)) << gyro;
      }
    }
  }
}

// The gyro that falls out after a step was probably the one that stepped.
TEST(Readings, SuspectAGyroThatFallsOut) {
  for (std::size_t bad = 0; bad < 2; ++bad) {
    World world(5);
    world.calibrate();
    world.readings.split_step(0.05, 1e-6, 0.5);
    world.readings.suspect(bad);
    EXPECT_GT(world.readings.stepped(bad), 0.9);
    EXPECT_NEAR(world.readings.stepped(0) + world.readings.stepped(1), 1.0, 1e-12);
  }
}

// Two hypotheses are ambiguous only if both are likely, and differ by more than their σ.
TEST(Readings, AreAmbiguousOnlyWhereTheReadingsDiffer) {
  const auto after = [](double step_dps, double first_share) {
    World world(6);
    world.calibrate();
    world.readings.split_step(step_dps, 1e-8, first_share);
    return world.readings.ambiguous();
  };
  EXPECT_TRUE(after(0.05, 0.5));
  EXPECT_FALSE(after(0.05, 0.01)) << "one of them is next to impossible";
  EXPECT_FALSE(after(1e-5, 0.5)) << "they say the same";
  World world(7);
  world.calibrate();
  EXPECT_FALSE(world.readings.ambiguous()) << "there is one reading";
}

// --- the mixture ---------------------------------------------------------------------------------

// Parts whose every number differs; their moments by hand.
TEST(EstimateMixer, GivesTheMomentsOfItsParts) {
  constexpr std::uint64_t kSeed = 8;
  Random random(kSeed);
  const std::vector<double> weights{0.5, 0.3, 0.15, 0.05};
  std::vector<DriftEstimate> parts(weights.size());
  for (DriftEstimate& part : parts) {
    Eigen::Matrix<double, 6, 6> root;
    for (int i = 0; i < 36; ++i)
      root(i / 6, i % 6) = random.normal();
    const Eigen::Matrix<double, 6, 6> square = root * root.transpose();
    part.covariance = square.topLeftCorner<4, 4>();
    part.slope_covariance = square.bottomRightCorner<2, 2>();
    part.slope_with_bias = square.block<2, 2>(0, 4);
    for (int i = 0; i < 4; ++i)
      part.mean(i) = random.normal(3.0);
    part.slope << random.normal(), random.normal();
    part.growth = {random.uniform(0.0, 1.0), random.uniform(0.0, 1.0)};
    part.scale = {random.normal(), random.normal()};
    part.scale_covariance = {2.0, random.uniform(-1.0, 1.0), 3.0};
  }
  EstimateMixer mixer;
  for (std::size_t i = 0; i < parts.size(); ++i)
    mixer.add(weights[i], parts[i]);
  const DriftEstimate found = mixer.result();

  std::array<double, 6> mean{};
  std::array<double, 2> scale{};
  std::array<double, 2> growth{};
  const auto value = [](const DriftEstimate& part, int i) {
    return i < 4 ? part.mean(i) : part.slope(i - 4);
  };
  const auto covariance = [](const DriftEstimate& part, int i, int j) {
    if (i < 4 && j < 4) return part.covariance(i, j);
    if (i >= 4 && j >= 4) return part.slope_covariance(i - 4, j - 4);
    return i < 4 ? part.slope_with_bias(i, j - 4) : part.slope_with_bias(j, i - 4);
  };
  for (std::size_t n = 0; n < parts.size(); ++n) {
    for (int i = 0; i < 6; ++i)
      mean[static_cast<std::size_t>(i)] += weights[n] * value(parts[n], i);
    for (std::size_t k = 0; k < 2; ++k) {
      scale[k] += weights[n] * parts[n].scale[k];
      growth[k] += weights[n] * parts[n].growth[k];
    }
  }
  for (int i = 0; i < 6; ++i) {
    const double of_i = mean[static_cast<std::size_t>(i)];
    EXPECT_NEAR(value(found, i), of_i, 1e-12) << i;
    for (int j = 0; j < 6; ++j) {
      if ((i >= 4) != (j >= 4) && std::min(i, j) >= 2) continue;  // slopes with scale: not reported
      double expected = 0.0;
      for (std::size_t n = 0; n < parts.size(); ++n) {
        expected += weights[n] * (covariance(parts[n], i, j) +
                                  (value(parts[n], i) - of_i) *
                                      (value(parts[n], j) - mean[static_cast<std::size_t>(j)]));
      }
      EXPECT_NEAR(covariance(found, i, j), expected, 1e-10) << i << ", " << j;
    }
  }
  for (std::size_t a = 0; a < 2; ++a) {
    EXPECT_NEAR(found.scale[a], scale[a], 1e-12);
    EXPECT_NEAR(found.growth[a], growth[a], 1e-12);
    for (std::size_t b = a; b < 2; ++b) {
      double expected = 0.0;
      for (std::size_t n = 0; n < parts.size(); ++n) {
        expected += weights[n] * (parts[n].scale_covariance[a + b] +
                                  (parts[n].scale[a] - scale[a]) * (parts[n].scale[b] - scale[b]));
      }
      EXPECT_NEAR(found.scale_covariance[a + b], expected, 1e-10) << a << ", " << b;
    }
  }
}

// Compares two hypotheses of a step with two banks, each of which was given one gyro's step.
TEST(Readings, AreTheMixtureOfTheBanksThatTheyStandFor) {
  constexpr double kStep_dps = 0.05;
  constexpr double kVariance = 1e-6;
  constexpr double kFirst = 0.3;
  World world(9);
  std::array<DriftBank, 2> banks{DriftBank(told()), DriftBank(told())};
  world.readings.begin(kWhite, kBias, {1e-6, 0.0, 4e-6});
  for (DriftBank& bank : banks)
    bank.begin(kWhite, kBias, {1e-6, 0.0, 4e-6});
  const auto learn = [&](double length_s) {
    const DriftMeasurement one = world.difference(length_s);
    world.readings.learn(length_s, one);
    for (DriftBank& bank : banks)
      bank.learn(length_s, one);
  };
  learn(5.0);
  world.readings.split_step(kStep_dps, kVariance, kFirst);
  // The share of each hypothesis follows from the shift of each bias in the mixture.
  DriftEstimate one = world.readings.estimate();
  const double away_1 = one.mean(kBias1) - banks[0].estimate().mean(kBias1);
  const double away_2 = one.mean(kBias2) - banks[0].estimate().mean(kBias2);
  EXPECT_NEAR(away_1, kFirst * kStep_dps, 1e-12);
  EXPECT_NEAR(away_2, -(1.0 - kFirst) * kStep_dps, 1e-12);
  // Spread between the two, and the variance of each.
  const double spread = kFirst * (1.0 - kFirst) * squared(kStep_dps);
  const double doubt_1 =
      one.covariance(kBias1, kBias1) - banks[0].estimate().covariance(kBias1, kBias1) - spread;
  EXPECT_GE(doubt_1, kFirst * kVariance * (1.0 - 1e-9));
  EXPECT_LE(doubt_1, kFirst * (kVariance + squared(0.1 * kStep_dps)));
  EXPECT_NEAR(one.covariance(kBias1, kBias2) - banks[0].estimate().covariance(kBias1, kBias2),
              spread, 1e-9 * spread + 1e-15)
      << "either has stepped, not both";
}

}  // namespace
}  // namespace vgyro::fusion
