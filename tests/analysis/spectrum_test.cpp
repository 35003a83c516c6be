#include "analysis/spectrum.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

TEST(Spectrum, SineTransformOfStepsIsItsDefinition) {
  const std::vector<double> values{0.3, -1.0, 2.0, 0.5, 0.7, -0.2};
  const auto n = values.size();
  const std::vector<double> z = step_sine_transform(values);
  ASSERT_EQ(z.size(), n - 1);
  for (std::size_t j = 1; j < n; ++j) {
    double expected = 0.0;
    for (std::size_t k = 1; k < n; ++k)
      expected += (values[k] - values[k - 1]) *
                  std::sin(std::numbers::pi * static_cast<double>(j * k) / static_cast<double>(n));
    EXPECT_NEAR(z[j - 1], expected * std::sqrt(2.0 / static_cast<double>(n)), 1e-14);
  }
}

TEST(Spectrum, SmoothSizeHasNoOtherPrimeFactor) {
  EXPECT_EQ(smooth_size(1), 1U);
  EXPECT_EQ(smooth_size(7), 6U);
  EXPECT_EQ(smooth_size(1000), 1000U);
  EXPECT_EQ(smooth_size(131'073), 131'072U);
}

TEST(Spectrum, RampIsItsOwnCoefficient) {
  Series series{0.5, {{0.0, {}}}};
  for (int i = 0; i < 360; ++i)
    series.parts[0].rate_dps.push_back(7.0 + 0.002 * 0.5 * i);
  for (const PowerBin& bin : step_spectrum(series)) {
    EXPECT_NEAR(bin.cross, 0.002 * bin.ramp_power, 1e-12);
    EXPECT_NEAR(bin.power, 0.002 * 0.002 * bin.ramp_power, 1e-12);
  }
}

// White noise and walk have the power that the fit expects, also in a long record, which is
// transformed twice.
TEST(Spectrum, LongRecordsHaveThePowerOfTheirNoise) {
  constexpr std::uint64_t kSeed = 71;
  SCOPED_TRACE(testing::Message() << "seed " << kSeed);
  std::mt19937_64 engine(kSeed);
  std::normal_distribution<double> normal;
  constexpr double kInterval_s = 0.01;
  constexpr double kWhite = 0.02;
  constexpr double kWalk = 0.01;
  Series series{kInterval_s, {{0.0, std::vector<double>(700'000)}}};
  double walk = 0.0;
  for (double& rate : series.parts[0].rate_dps) {
    walk += normal(engine) * kWalk * std::sqrt(kInterval_s);
    rate = walk + normal(engine) * kWhite / std::sqrt(kInterval_s);
  }
  double count = 0.0;
  double low_count = 0.0;
  double ratio = 0.0;
  double low_ratio = 0.0;
  for (const PowerBin& bin : step_spectrum(series)) {
    const double expected = kWhite * kWhite * bin.step_gain / bin.interval_s +
                            kWalk * kWalk * bin.interval_s * (1.0 - bin.step_gain / 6.0);
    count += bin.count;
    ratio += bin.power / expected;
    if (bin.frequency_hz > 0.1) continue;
    low_count += bin.count;
    low_ratio += bin.power / expected;
  }
  EXPECT_GT(count, 0.7 * 700'000);
  EXPECT_LT(count, 1.01 * 700'000);
  EXPECT_NEAR(low_count, 2.0 * 7000.0 * 0.1, 50.0);
  EXPECT_NEAR(ratio / count, 1.0, 3.5 * std::sqrt(2.0 / count));
  EXPECT_NEAR(low_ratio / low_count, 1.0, 3.5 * std::sqrt(2.0 / low_count));
}

}  // namespace
}  // namespace vgyro::analysis
