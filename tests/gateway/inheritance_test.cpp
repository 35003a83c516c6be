// Which biases are kept when a reload requires a new calibration. Uses the product's own pipelines,
// from frames on.

#include "gateway/inheritance.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "rig.h"

namespace vgyro::gateway {
namespace {

using rig::ms;

constexpr std::uint32_t kSeed = 5;
constexpr double kBiasA_dps = 0.3;
constexpr double kBiasB_dps = -0.1;
constexpr double kTurn_dps = 5.0;

class InheritanceTest : public testing::Test {
 protected:
  InheritanceTest() { plan.calibration.rest_s = 20.0; }

  /// Both gyros for this many seconds, with the platform turning at this rate.
  rig::Recording recording(std::int64_t from_s, std::int64_t for_s, double rate_dps) {
    const auto noisy = [&](double bias_dps) {
      return [this, value = bias_dps + rate_dps](double) { return value + noise(rng); };
    };
    const Duration from = std::chrono::seconds(from_s);
    const Duration to = from + std::chrono::seconds(for_s);
    return rig::merge(
        {rig::stream_a(from, to, noisy(kBiasA_dps)), rig::stream_b(from, to, noisy(kBiasB_dps))});
  }
  std::optional<SavedState> choose(const Pipeline& pipeline) {
    return inheritance.choose(pipeline.memory(), plan, pipeline.status().stops);
  }

  std::mt19937 rng{kSeed};
  std::normal_distribution<double> noise{0.0, 0.01};
  Plan plan = rig::two_gyros();
  Inheritance inheritance;
  rig::Collector out;
};

/// At rest for half a minute; then a reload with another configured rate at rest.
class AfterAReload : public InheritanceTest {
 protected:
  AfterAReload() {
    Pipeline before(plan);
    rig::play(before, recording(0, 30, 0.0), out);
    old = before.memory().value();
    plan.calibration.rate_dps = 0.0032;
    plan.calibration.stop_rate_dps = 0.0032;
    EXPECT_FALSE(Pipeline(plan).resume(old)) << "it calls for a new calibration";
    inheritance.keep(old);
  }

  SavedState old;
};

TEST_F(AfterAReload, TheOldBiasesAreKeptUntilTheNewCalibrationIsComplete) {
  Pipeline after(plan);
  EXPECT_EQ(choose(after)->drift.bias_dps, old.drift.bias_dps);
  rig::play(after, recording(31, 10, 0.0), out);
  ASSERT_EQ(after.status().state, State::kCalibrating);
  const std::optional<SavedState> kept = choose(after);
  EXPECT_EQ(kept->drift.bias_dps, old.drift.bias_dps);
  EXPECT_EQ(kept->rate_stamp, old.rate_stamp) << "its age goes on";
  EXPECT_FALSE(inheritance.is_contradicted());
}

TEST_F(AfterAReload, ANewCalibrationThatAgreesTakesTheirPlace) {
  Pipeline after(plan);
  rig::play(after, recording(31, 22, 0.0), out);
  ASSERT_EQ(after.status().state, State::kRunning);
  EXPECT_EQ(choose(after)->rest_rate_dps, 0.0032);
  EXPECT_FALSE(inheritance.is_contradicted());
}

TEST_F(AfterAReload, ASteadyTurnThatWasCalibratedAsRestDoesNotTakeTheirPlace) {
  Pipeline after(plan);
  rig::play(after, recording(31, 22, kTurn_dps), out);
  ASSERT_EQ(after.status().state, State::kRunning);
  ASSERT_NEAR(after.memory()->drift.bias_dps[0], kBiasA_dps + kTurn_dps, 0.1);
  for (int second = 0; second < 3; ++second)
    EXPECT_EQ(choose(after)->drift.bias_dps, old.drift.bias_dps);
  EXPECT_TRUE(inheritance.is_contradicted());
}

// Otherwise the σ of the old biases would grow until any new ones agreed.
TEST_F(AfterAReload, AContradictionStaysUntilAStopDecides) {
  SavedState turned = old;
  turned.drift.bias_dps[0] += kTurn_dps;
  turned.drift.bias_dps[1] += kTurn_dps;
  EXPECT_EQ(inheritance.choose(turned, plan, 0)->drift.bias_dps, old.drift.bias_dps);
  turned.rate_stamp += std::chrono::hours(24 * 365);
  EXPECT_EQ(inheritance.choose(turned, plan, 0)->drift.bias_dps, old.drift.bias_dps);
  EXPECT_EQ(inheritance.choose(turned, plan, 1)->drift.bias_dps, turned.drift.bias_dps);
  EXPECT_FALSE(inheritance.is_contradicted());
  EXPECT_EQ(inheritance.choose(turned, plan, 0)->drift.bias_dps, turned.drift.bias_dps);
}

TEST_F(AfterAReload, AMistakeInTheRateAtRestThatIsPutRightContradictsNothing) {
  plan.calibration.rate_dps = 0.5;
  Pipeline after(plan);
  rig::play(after, recording(31, 22, 0.0), out);
  EXPECT_NEAR(choose(after)->drift.bias_dps[0], kBiasA_dps - 0.5, 0.01);
  EXPECT_FALSE(inheritance.is_contradicted());
}

TEST_F(AfterAReload, BiasesOfOtherGyrosContradictNothing) {
  SavedState others = old;
  others.devices[0] = "fog: can1 0x333";
  others.drift.bias_dps[0] += kTurn_dps;
  EXPECT_EQ(inheritance.choose(others, plan, 0)->devices[0], "fog: can1 0x333");
}

TEST_F(AfterAReload, WhatIsForgottenIsNotKept) {
  inheritance.forget();
  EXPECT_FALSE(choose(Pipeline(plan)));
}

// A reload right after the start, and another right after that.
TEST_F(InheritanceTest, BiasesThatNoPairHasTakenUpYetGoOnToTheNextSetup) {
  Pipeline first(plan);
  rig::play(first, recording(0, 30, 0.0), out);
  const SavedState learned = first.memory().value();
  Pipeline second(plan);
  ASSERT_TRUE(second.resume(learned));
  rig::Recording few = recording(31, 1, kTurn_dps);
  few.resize(7);
  rig::play(second, few, out);
  ASSERT_EQ(second.status().pairs, 0U);
  ASSERT_TRUE(second.memory());
  EXPECT_EQ(to_text(*second.memory()), to_text(learned));
  Pipeline third(plan);
  ASSERT_TRUE(third.resume(*second.memory()));
  rig::play(third, recording(32, 25, kTurn_dps), out);
  EXPECT_NEAR(third.memory()->drift.bias_dps[0], kBiasA_dps, 0.1);
}

}  // namespace
}  // namespace vgyro::gateway
