// What the optimal corrector learns at stops, and what it must not learn.

#include <cmath>

#include <gtest/gtest.h>

#include "tests/fusion/optimal_run.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using Gyros = std::array<world::Gyro, 2>;

constexpr double kRate_hz = 20.0;
constexpr double kStep_s = 1.0 / kRate_hz;
constexpr std::uint64_t kRuns = 20;

const Gyros kGyros{world::Gyro{1e-3, 3e-5, 0.05}, world::Gyro{2e-3, 6e-5, -0.1}};

/// Runs for `seconds`; returns the last step.
Step drive(OptimalRun& run, double seconds, const world::World::Rate& rate) {
  Step step;
  for (const double until = run.world.now_s() + seconds; run.world.now_s() < until;)
    step = run.step(rate);
  return step;
}

double at_rest(double /*t_s*/) {
  return 0.0;
}

// Both drifts are off by the walk of half an hour; a stop measures them as well as the noise
// allows, and σ is true.
TEST(OptimalStops, TeachBothDrifts) {
  Rms before;
  Rms after;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
    run.calibrate();
    before.add(drive(run, 1800.0, winding).bias_error_dps);
    const Step step = drive(run, 60.0, at_rest);
    after.add(step.bias_error_dps);
    EXPECT_TRUE(run.corrector->condition().stopped) << "seed " << seed;
    // Noise beyond 3.5 standard deviations occasionally ends a stop.
    EXPECT_GE(run.corrector->condition().stops, 1U) << "seed " << seed;
    EXPECT_LE(run.corrector->condition().stops, 3U) << "seed " << seed;
  }
  // Noise N_v of a minute and K_v within it; a part of the stop is still held back.
  const double white = 1e-3 * 2e-3 / std::hypot(1e-3, 2e-3);
  const double walk = 3e-5 * 6e-5 / std::hypot(3e-5, 6e-5);
  const double expected = std::sqrt(white * white / 60.0 + walk * walk * 60.0 / 3.0);
  EXPECT_LT(after.value(), 1.2 * expected * (1.0 + kSigmas * after.relative_error()));
  EXPECT_GT(before.value(), 3.0 * expected) << "else there was nothing to learn";
}

// A ferry or a turntable reaches a steady rate within two minutes: nothing is learned from it, and
// the heading is true.
TEST(OptimalStops, AreNotBelievedOnAPlatformThatTurnsSteadily) {
  for (const double turntable_dps : {0.1, -0.3, 1.0}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      SCOPED_TRACE(::testing::Message() << turntable_dps << " deg/s, seed " << seed);
      OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
      run.calibrate();
      drive(run, 60.0, at_rest);
      const double from_s = run.world.now_s();
      double heading_error = 0.0;
      double turned = 0.0;
      while (run.world.now_s() < from_s + 1200.0) {
        const Step step = run.step([&](double t_s) {
          return turntable_dps * std::clamp((t_s - from_s) / 120.0, 0.0, 1.0);
        });
        heading_error += step.rate_error_dps * kStep_s;
        turned += step.now.rate_dps * kStep_s;
      }
      const double walk = 3e-5 * 6e-5 / std::hypot(3e-5, 6e-5);
      const double own_drift = walk * std::sqrt(1200.0 * 1200.0 * 1200.0 / 3.0);
      EXPECT_LT(std::abs(heading_error), 4.0 * own_drift) << "of " << turned << " deg";
      EXPECT_GE(run.corrector->condition().stops_refused, 1U);
    }
  }
}

// Both drifts jump together, unseen, while the platform turns: the first stop may be a slow turn,
// but a few stops, with turns in between, are proof.
TEST(OptimalStops, AreBelievedAfterAllWhenTheDriftHasJumped) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
    run.calibrate();
    const double jump_dps = 20.0 * drive(run, 120.0, winding).bias_sigma_dps;
    run.world.jump(0, jump_dps);
    run.world.jump(1, jump_dps);
    Step step;
    for (int stop = 0; stop < 4; ++stop) {
      drive(run, 60.0, winding);
      step = drive(run, 30.0, at_rest);
    }
    EXPECT_LT(std::abs(step.bias_error_dps), 0.1 * jump_dps);
    EXPECT_LT(std::abs(step.bias_error_dps), 4.0 * step.bias_sigma_dps);
    EXPECT_GE(run.corrector->condition().stops_refused, 1U) << "the first one could be a turn";
  }
}

TEST(OptimalStops, TeachNothingWhereTheirRateIsUnknown) {
  OptimalSettings settings = told(kGyros);
  settings.stop_rate_dps.reset();
  OptimalRun run(kGyros, kRate_hz, 41, settings);
  run.calibrate();
  const double before = run.corrector->drift(run.world.now_s()).bias_sigma_dps;
  const Step step = drive(run, 600.0, at_rest);
  EXPECT_EQ(run.corrector->condition().stops, 0U);
  EXPECT_FALSE(run.corrector->condition().stopped);
  EXPECT_GT(step.bias_sigma_dps, 2.0 * before);
}

// The Earth's rate is subtracted from the measurement of a stop.
TEST(OptimalStops, KnowTheRateThatAStopHas) {
  OptimalSettings settings = told(kGyros);
  settings.stop_rate_dps = 0.02;
  constexpr std::uint64_t kSeed = 42;
  OptimalRun run(kGyros, kRate_hz, kSeed, settings);
  run.calibrate();
  drive(run, 600.0, winding);
  const Step step = drive(run, 120.0, [](double /*t_s*/) { return 0.02; });
  EXPECT_GE(run.corrector->condition().stops, 1U);
  EXPECT_LT(std::abs(step.bias_error_dps), 4.0 * step.bias_sigma_dps) << "seed " << kSeed;
  EXPECT_LT(step.bias_sigma_dps, 0.001);
}

TEST(OptimalStops, TeachNothingWhileTheWheelsRoll) {
  OptimalRun run(kGyros, kRate_hz, 43, told(kGyros));
  run.calibrate();
  run.corrector->set_wheels(Wheels::kRolling);
  drive(run, 300.0, at_rest);  // a straight road
  EXPECT_EQ(run.corrector->condition().stops, 0U);
  run.corrector->set_wheels(Wheels::kStanding);
  drive(run, 10.0, at_rest);
  EXPECT_EQ(run.corrector->condition().stops, 1U);
}

// Passengers board: without a wheel signal there is no stop, with it there is one, and the error of
// the learned drift agrees with σ.
TEST(OptimalStops, SurviveSwayWhereTheWheelsStand) {
  double square = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
    run.calibrate();
    drive(run, 900.0, winding);
    const auto sway = [](double t_s) {
      return 0.03 * (std::sin(7.0 * t_s) + std::sin(4.3 * t_s + 1.0));
    };
    drive(run, 30.0, sway);
    EXPECT_EQ(run.corrector->condition().stops, 0U) << "seed " << seed;
    run.corrector->set_wheels(Wheels::kStanding);
    const Step step = drive(run, 60.0, sway);
    EXPECT_GE(run.corrector->condition().stops, 1U) << "seed " << seed;
    square += std::pow(step.bias_error_dps / step.bias_sigma_dps, 2.0) / kRuns;
  }
  EXPECT_LT(square, 1.0 + kSigmas * std::sqrt(2.0 / kRuns)) << "seeds 1 to " << kRuns;
}

// A wheel sensor that always reports "standing": turns show that it is dead.
TEST(OptimalStops, DoNotBelieveADeadWheelSensor) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
    run.calibrate();
    run.corrector->set_wheels(Wheels::kStanding);
    const Step step = drive(run, 1200.0, winding);
    EXPECT_LT(std::abs(step.bias_error_dps), 4.0 * step.bias_sigma_dps);
    EXPECT_LT(run.corrector->condition().stops, 2U);
  }
}

}  // namespace
}  // namespace vgyro::fusion
