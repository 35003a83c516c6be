#include "analysis/allan.h"

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

TEST(Allan, ChiSquareQuantilesAreThoseOfTheTables) {
  // Printed tables give three decimals.
  EXPECT_NEAR(chi_square_quantile(0.025, 1.0), 0.000982, 5e-7);
  EXPECT_NEAR(chi_square_quantile(0.975, 1.0), 5.024, 5e-4);
  EXPECT_NEAR(chi_square_quantile(0.05, 10.0), 3.940, 5e-4);
  EXPECT_NEAR(chi_square_quantile(0.95, 10.0), 18.307, 5e-4);
  EXPECT_NEAR(chi_square_quantile(0.975, 100.0), 129.561, 5e-4);
}

TEST(Allan, DegreesOfFreedomShrinkWithAveraging) {
  // White noise has three halves of a degree of freedom per average.
  EXPECT_NEAR(degrees_of_freedom(NoiseKind::kWhite, 100'000, 100), 1.5 * 1000, 10.0);
  for (const NoiseKind kind :
       {NoiseKind::kWhite, NoiseKind::kFlicker, NoiseKind::kWalk, NoiseKind::kQuantisation}) {
    EXPECT_GT(degrees_of_freedom(kind, 1000, 10), degrees_of_freedom(kind, 1000, 100));
    EXPECT_GE(degrees_of_freedom(kind, 1000, 333), 1.0);
  }
}

TEST(Allan, NoTermReachesAcrossAGap) {
  // Two parts at different levels, each constant: a term across both would contain the step.
  const Series series{0.1,
                      {{0.0, std::vector<double>(50, 1.0)}, {9.0, std::vector<double>(60, 2.0)}}};
  const auto points = allan_deviation(series, [](double) { return NoiseKind::kWhite; });
  ASSERT_EQ(points.size(), 5U);
  for (const AllanPoint& point : points)
    EXPECT_NEAR(point.deviation_dps, 0.0, 1e-12);
  EXPECT_DOUBLE_EQ(points[4].tau_s, 1.6);
}

}  // namespace
}  // namespace vgyro::analysis
