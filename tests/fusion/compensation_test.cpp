#include "fusion/compensation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using model::Effect;
using model::Kind;
using model::Surroundings;

Effect effect(Kind kind, model::Parameters parameters) {
  return {.gyro = 0, .kind = kind, .parameters = parameters};
}

/// The readings of a gyro with these effects, written out instead of taken from the catalogue.
struct Gyro {
  double bias = 0.05, ramp = 2e-6, step = -0.01, warm = 0.03, per_k = 1.1e-3, per_k2 = 2e-5;
  double per_k_s = 0.4, per_g = 3e-3, per_g2 = 0.5, harmonic = 4e-3, line = 2e-3;
  double e = 5e-3, asymmetry = 3e-3, quadratic = 2e-5, cubic = -1e-7, per_k_scale = 1e-4;

  [[nodiscard]] std::vector<Effect> effects() const {
    return {effect(Kind::kBias, {bias}),
            effect(Kind::kBiasRamp, {ramp}),
            effect(Kind::kBiasStep, {step, 100.0}),
            effect(Kind::kWarmUp, {warm, 300.0}),
            effect(Kind::kTemperatureBias, {per_k, 25.0}),
            effect(Kind::kTemperatureBiasQuadratic, {per_k2, 20.0}),
            effect(Kind::kTemperatureRateBias, {per_k_s}),
            effect(Kind::kGSensitivity, {1.0, per_g}),
            effect(Kind::kVibrationRectification, {per_g2}),
            effect(Kind::kAngleHarmonic, {4.0, harmonic, 1.9}),
            effect(Kind::kLine, {37.0, line, 0.4}),
            effect(Kind::kScaleFactor, {e}),
            effect(Kind::kScaleFactorAsymmetry, {asymmetry}),
            effect(Kind::kScaleFactorQuadratic, {quadratic}),
            effect(Kind::kScaleFactorCubic, {cubic}),
            effect(Kind::kScaleFactorTemperature, {per_k_scale, 30.0}),
            effect(Kind::kWhiteNoise, {1e-3}),
            effect(Kind::kStuck, {1.0, 2.0})};
  }

  [[nodiscard]] double offset(const Surroundings& s) const {
    const double t = s.t_s;
    const double temperature = s.temperature_c;
    return bias + ramp * t + (t >= 100.0 ? step : 0.0) + warm * std::exp(-t / 300.0) +
           per_k * (temperature - 25.0) + per_k2 * std::pow(temperature - 20.0, 2) +
           per_k_s * s.temperature_slope_c_s + per_g * s.acceleration_g[1] +
           per_g2 * s.vibration_g2 + harmonic * std::cos(4.0 * s.angle_rad + 1.9) +
           line * std::sin(2.0 * 3.14159265358979323846 * 37.0 * t + 0.4);
  }

  [[nodiscard]] double reading(double rate, const Surroundings& s) const {
    return rate + e * rate + asymmetry * std::abs(rate) + quadratic * rate * rate +
           cubic * rate * rate * rate + per_k_scale * (s.temperature_c - 30.0) * rate + offset(s);
  }
};

Surroundings somewhere(Random& random) {
  return {.t_s = random.uniform(0.0, 1000.0),
          .temperature_c = random.uniform(-40.0, 85.0),
          .temperature_slope_c_s = random.uniform(-0.1, 0.1),
          .acceleration_g = {random.uniform(-2.0, 2.0), random.uniform(-2.0, 2.0), 1.0},
          .vibration_g2 = random.uniform(0.0, 0.1),
          .angle_rad = random.uniform(-3.0, 3.0)};
}

TEST(Compensation, GivesBackTheRateThatTheGyroHad) {
  const Gyro gyro;
  const Compensation compensation(gyro.effects());
  constexpr std::uint64_t kSeed = 20;
  SCOPED_TRACE(kSeed);
  Random random(kSeed);
  for (int place = 0; place < 50; ++place) {
    const Surroundings s = somewhere(random);
    for (double rate_dps = -300.0; rate_dps <= 300.0; rate_dps += 2.5) {
      ASSERT_NEAR(compensation.correct(gyro.reading(rate_dps, s), s), rate_dps, 1e-9);
    }
    // Around zero the asymmetry has its corner.
    for (double rate_dps = -1e-3; rate_dps <= 1e-3; rate_dps += 1e-4) {
      ASSERT_NEAR(compensation.correct(gyro.reading(rate_dps, s), s), rate_dps, 1e-9);
    }
  }
}

TEST(Compensation, OfNothingChangesNothing) {
  EXPECT_EQ(Compensation().correct(0.1, {}), 0.1);
  const Effect noise = effect(Kind::kWhiteNoise, {1e-3});
  const Compensation compensation({&noise, 1});
  EXPECT_FALSE(compensation.takes_any());
  EXPECT_EQ(compensation.correct(0.1, {}), 0.1);
}

// A missing first frame must not cause NaN.
TEST(Compensation, LeavesOutWhatDependsOnTheUnknown) {
  const Gyro gyro;
  const Compensation compensation(gyro.effects());
  const Surroundings nothing{.t_s = 10.0};
  const double offset = gyro.bias + gyro.ramp * 10.0 + gyro.warm * std::exp(-10.0 / 300.0) +
                        gyro.harmonic * std::cos(1.9) + gyro.line * std::sin(0.4);
  const double rate = -20.0;
  const double reading = offset + rate * (1.0 + gyro.e - gyro.asymmetry) +
                         gyro.quadratic * rate * rate + gyro.cubic * rate * rate * rate;
  EXPECT_NEAR(compensation.correct(reading, nothing), rate, 1e-9);
}

// A cubic that was fitted to ±100 deg/s has its extremum at 183: there, and beyond, the result is
// bounded by the reading.
TEST(Compensation, StaysBoundedWhereTheModelHasNoInverse) {
  const Effect cubic = effect(Kind::kScaleFactorCubic, {-1e-5});
  const Compensation compensation({&cubic, 1});
  for (double reading_dps = -1e5; reading_dps <= 1e5; reading_dps += 37.0) {
    const double rate_dps = compensation.correct(reading_dps, {});
    ASSERT_TRUE(std::isfinite(rate_dps));
    ASSERT_LE(std::abs(rate_dps), 2.0 * std::abs(reading_dps) + 1.0) << reading_dps;
  }
  EXPECT_NEAR(compensation.correct(100.0 - 1e-5 * 1e6, {}), 100.0, 1e-9);
}

TEST(Compensation, TellsTheZeroOffsetWithoutLines) {
  const Gyro gyro;
  const Compensation compensation(gyro.effects());
  Random random(3);
  const Surroundings s = somewhere(random);
  const double line = gyro.line * std::sin(2.0 * 3.14159265358979323846 * 37.0 * s.t_s + 0.4);
  EXPECT_NEAR(compensation.zero_offset_dps(s), gyro.offset(s) - line, 1e-12);
}

TEST(Compensation, AddsUpDelayAndGroupDelay) {
  const Effect effects[] = {effect(Kind::kDelay, {0.004}), effect(Kind::kBandwidth, {15.9154943}),
                            effect(Kind::kDelay, {-0.001})};
  EXPECT_NEAR(to_seconds(Compensation(effects).lag()), 0.013, 1e-8);
}

}  // namespace
}  // namespace vgyro::fusion
