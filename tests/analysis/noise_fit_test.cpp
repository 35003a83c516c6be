#include "analysis/noise_fit.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

TEST(NoiseFit, ConstantRateIsNoNoise) {
  // The constant value of a simulated or dead sensor.
  const Series series{0.1, {{0.0, std::vector<double>(5000, 0.25)}}};
  EXPECT_FALSE(fit_noise(step_spectrum(series), {.interval_s = 0.1}).has_value());
}

TEST(NoiseFit, TooFewCoefficientsAreRefused) {
  Series series{0.1, {{0.0, {}}}};
  for (int i = 0; i < 90; ++i)
    series.parts[0].rate_dps.push_back(std::sin(1e4 * i * i));
  EXPECT_FALSE(fit_noise(step_spectrum(series), {.interval_s = 0.1}).has_value());
}

TEST(NoiseFit, VarianceOfEachKindIsIeee952s) {
  NoiseFit fit;
  fit.white_dps_rthz.value = 2.0;
  fit.walk_dps_rts.value = 3.0;
  fit.flicker_dps.value = 5.0;
  fit.quantisation_deg.value = 7.0;
  EXPECT_DOUBLE_EQ(fit.variance(NoiseKind::kWhite, 4.0), 1.0);
  EXPECT_DOUBLE_EQ(fit.variance(NoiseKind::kWalk, 4.0), 12.0);
  EXPECT_NEAR(std::sqrt(fit.variance(NoiseKind::kFlicker, 4.0)), 0.6643 * 5.0, 1e-3);
  EXPECT_DOUBLE_EQ(fit.variance(NoiseKind::kQuantisation, 4.0), 3.0 * 49.0 / 16.0);
  EXPECT_EQ(fit.dominant(1e6), NoiseKind::kWalk);
  EXPECT_EQ(fit.dominant(1e-6), NoiseKind::kQuantisation);
}

}  // namespace
}  // namespace vgyro::analysis
