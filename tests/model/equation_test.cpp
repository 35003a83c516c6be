#include "model/equation.h"

#include <cmath>
#include <complex>
#include <numbers>

#include <gtest/gtest.h>

namespace vgyro::model {
namespace {

Effect effect(Kind kind, Parameters parameters) {
  return {.gyro = 0, .kind = kind, .parameters = parameters};
}

// In arbitrary order, with two of each kind whose effects add up.
const std::vector<Effect>& mixed() {
  static const std::vector<Effect> effects{effect(Kind::kQuantization, {0.3}),
                                           effect(Kind::kScaleFactor, {0.02}),
                                           effect(Kind::kClockSkew, {100.0}),
                                           effect(Kind::kBias, {0.5}),
                                           effect(Kind::kDelay, {0.030}),
                                           effect(Kind::kSaturation, {12.0}),
                                           effect(Kind::kWhiteNoise, {1.0}),
                                           effect(Kind::kBandwidth, {10.0}),
                                           effect(Kind::kScaleFactorCubic, {1e-3}),
                                           effect(Kind::kDeadBand, {1.0}),
                                           effect(Kind::kTemperatureBias, {0.1, 20}),
                                           effect(Kind::kBandwidth, {4.0}),
                                           effect(Kind::kDelay, {-0.005}),
                                           effect(Kind::kClockSkew, {-20.0}),
                                           effect(Kind::kSpikes, {1.0, 9.0}),
                                           effect(Kind::kDroppedFrames, {0.5})};
  return effects;
}

TEST(Equation, OfNothingReadsTheRateAtItsTime) {
  const Equation equation;
  EXPECT_FALSE(equation.adds() || equation.responds() || equation.is_late());
  EXPECT_EQ(equation.reading_dps(7.25, {}), 7.25);
  EXPECT_EQ(equation.clipped_dps(7.25), 7.25);
  EXPECT_EQ(equation.true_time_s(3.5), 3.5);
  EXPECT_EQ(equation.felt_at_s(3.5), 3.5);
}

// Against numbers computed by hand.
TEST(Equation, EveryResponseIsToTheLateRateAndNotToTheOthers) {
  const Equation equation(mixed());
  const Surroundings s{.temperature_c = 24.0};
  // 10 + 0.02 * 10 + 0.5 + 1e-3 * 1000 + 0.1 * 4
  EXPECT_NEAR(equation.reading_dps(10.0, s), 12.1, 1e-12);
  EXPECT_NEAR(equation.added_dps(10.0, s), 2.1, 1e-12);
  EXPECT_NEAR(equation.offset_dps(s), 0.9, 1e-12);
  EXPECT_NEAR(equation.slope(10.0, s), 1.0 + 0.02 + 0.3, 1e-12);
  EXPECT_NEAR(equation.without_offsets_dps(12.1, s), 11.2, 1e-12);
  EXPECT_NEAR(equation.excess_dps(10.0, 11.0, s), 0.2, 1e-12);
  EXPECT_TRUE(equation.adds() && equation.responds());
}

TEST(Equation, ClipsActInTheirOrderWhateverTheFilesOrder) {
  const Equation equation(mixed());
  EXPECT_NEAR(equation.clipped_dps(12.5), 12.0, 1e-12);
  EXPECT_NEAR(equation.clipped_dps(-1.03), -0.9, 1e-12) << "outside the dead band, then rounded";
  EXPECT_EQ(equation.clipped_dps(0.98), 0.0) << "0.9 after rounding, but 0 before it";
}

// The two poles are those of w² / (s² + 2·damping·w·s + w²), whatever the damping.
TEST(Equation, PolesOfASecondOrderHaveItsSumAndProduct) {
  for (const double damping : {0.02, 0.5, 0.999, 1.0, 1.4, 9.0}) {
    const SecondOrder second{3.0, damping};
    const auto [a, b] = second.poles();
    const double w = 2.0 * std::numbers::pi * 3.0;
    EXPECT_NEAR(std::real(a + b) / (2.0 * damping * w), 1.0, 1e-6) << damping;
    EXPECT_NEAR(std::abs(a * b / (w * w) - 1.0), 0.0, 1e-12) << damping;
    EXPECT_GT(std::real(a), 0.0);
    EXPECT_GT(std::abs(a - b), 1e-3 * w) << "somebody divides by it";
  }
}

// A first-order low-pass delays a ramp by 1 / (2 pi cutoff) once it has settled.
TEST(Equation, IsLateByDelaysThenLowPassesOfTheTrueTime) {
  const Equation equation(mixed());
  EXPECT_TRUE(equation.is_late());
  EXPECT_NEAR(equation.delay_s(), 0.025, 1e-15);
  ASSERT_EQ(equation.cutoffs_hz().size(), 2U);
  EXPECT_EQ(equation.cutoffs_hz()[0], 10.0);
  EXPECT_EQ(equation.cutoffs_hz()[1], 4.0);
  double group_delay_s = 0.0;
  for (const double cutoff_hz : equation.cutoffs_hz())
    group_delay_s += 1.0 / (2.0 * 3.14159265358979323846 * cutoff_hz);
  EXPECT_NEAR(equation.lag_s(), 0.025 + group_delay_s, 1e-15);
  const auto ramp_behind_them = [&](double t_s) { return 40.0 * (t_s - group_delay_s); };
  EXPECT_NEAR(equation.late_rate_dps(ramp_behind_them, 5.0), 40.0 * (5.0 - equation.lag_s()),
              1e-12);
}

TEST(Equation, ClocksThatRunFastStampLater) {
  const Equation equation(mixed());
  EXPECT_NEAR(equation.clock_rate(), 1.0 + 80e-6, 1e-15);
  EXPECT_NEAR(equation.stamp_s(1000.0), 1000.08, 1e-9);
  EXPECT_NEAR(equation.true_time_s(1000.08), 1000.0, 1e-9);
}

TEST(Equation, WhatIsNotKnownAddsNothing) {
  const Effect warm = effect(Kind::kTemperatureBias, {0.1, 20.0});
  const Equation equation({&warm, 1});
  EXPECT_EQ(equation.reading_dps(3.0, {}), 3.0);
  EXPECT_EQ(equation.without_offsets_dps(3.0, {}), 3.0);
}

TEST(Equation, MovesInTimeWithLagsAndClocksAlone) {
  for (const Kind kind : {Kind::kDelay, Kind::kBandwidth, Kind::kClockSkew}) {
    const Effect one = effect(kind, {1.0});
    EXPECT_TRUE(moves_in_time(kind) && Equation({&one, 1}).is_late());
  }
  for (const Kind kind : {Kind::kBias, Kind::kTimestampJitter, Kind::kWhiteNoise, Kind::kStuck}) {
    const Effect one = effect(kind, {1.0});
    EXPECT_FALSE(moves_in_time(kind) || Equation({&one, 1}).is_late());
  }
}

}  // namespace
}  // namespace vgyro::model
