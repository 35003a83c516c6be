#include "analysis/series.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

// Interval 10 ms; value = place on the grid.
struct Ramp {
  static constexpr double kInterval_s = 0.01;
  SeriesBuilder builder;
  void add(int place, double late_s = 0.0) {
    builder.add(place * kInterval_s + late_s, {static_cast<double>(place), -2.0 * place});
  }
};

TEST(Series, JitterBelowHalfAnIntervalChangesNothing) {
  Ramp ramp;
  for (int i = 0; i < 2000; ++i)
    ramp.add(i, 0.003 * std::sin(1.7 * i));
  const auto series = ramp.builder.finish();
  ASSERT_EQ(series[0].parts.size(), 1U);
  ASSERT_EQ(series[0].size(), 2000U);
  for (std::size_t i = 0; i < 2000; ++i) {
    EXPECT_EQ(series[0].parts[0].rate_dps[i], static_cast<double>(i));
    EXPECT_EQ(series[1].parts[0].rate_dps[i], -2.0 * static_cast<double>(i));
  }
  EXPECT_NEAR(series[0].interval_s, 0.01, 0.006 / 2000);
  EXPECT_EQ(series[0].filled_share, 0.0);
}

TEST(Series, ClockThatRunsFastKeepsEverySampleAPlace) {
  SeriesBuilder builder;
  constexpr double kInterval_s = 0.01 * (1.0 + 3e-4);
  for (int i = 0; i < 50'000; ++i)
    builder.add(
        i * (i < 1000 ? 0.01 : kInterval_s) - (i < 1000 ? 0.0 : 1000 * (kInterval_s - 0.01)),
        {1.0, 0.0});
  const auto series = builder.finish();
  EXPECT_EQ(series[0].size(), 50'000U);
  EXPECT_EQ(series[0].parts.size(), 1U);
}

TEST(Series, ShortHoleIsBridgedByItsNeighboursAndCounted) {
  Ramp ramp;
  for (int i = 0; i < 1000; ++i)
    if (i != 700 && i != 701) ramp.add(i);
  const auto series = ramp.builder.finish();
  ASSERT_EQ(series[0].size(), 1000U);
  EXPECT_DOUBLE_EQ(series[0].parts[0].rate_dps[700], 700.5);
  EXPECT_DOUBLE_EQ(series[0].parts[0].rate_dps[701], 700.5);
  EXPECT_EQ(series[0].parts[0].rate_dps[702], 702.0);
  EXPECT_DOUBLE_EQ(series[0].filled_share, 2e-3);
}

TEST(Series, LongGapBeginsANewPart) {
  Ramp ramp;
  for (int i = 0; i < 1000; ++i)
    if (i < 600 || i >= 610) ramp.add(i);
  const auto series = ramp.builder.finish();
  ASSERT_EQ(series[0].parts.size(), 2U);
  EXPECT_EQ(series[0].parts[0].rate_dps.size(), 600U);
  EXPECT_EQ(series[0].parts[1].rate_dps.front(), 610.0);
  EXPECT_NEAR(series[0].parts[1].begin_s, 6.1, 1e-12);
  EXPECT_NEAR(series[0].interval_s, 0.01, 1e-12);
}

TEST(Series, SliceTakesWhatLiesBetween) {
  Ramp ramp;
  for (int i = 0; i < 1000; ++i)
    if (i < 600 || i >= 610) ramp.add(i);
  const Series piece = slice(ramp.builder.finish()[0], 5.995, 6.125);
  ASSERT_EQ(piece.parts.size(), 1U);
  EXPECT_EQ(piece.parts[0].rate_dps, (std::vector<double>{610.0, 611.0, 612.0}));
}

TEST(Series, TooFewSamplesAreNoSeries) {
  Ramp ramp;
  ramp.add(0);
  ramp.add(1);
  EXPECT_EQ(ramp.builder.finish()[0].size(), 0U);
}

}  // namespace
}  // namespace vgyro::analysis
