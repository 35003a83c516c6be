#include "fusion/temperature_filter.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::fusion {
namespace {

constexpr double kInterval_s = 0.01;

TimePoint at(double t_s) {
  return TimePoint{from_seconds(t_s)};
}

struct Worst {
  double temperature_c = 0.0;
  double slope_c_s = 0.0;
};

// Largest errors after the first `learning_s` seconds, with a sensor that reports in steps.
Worst follow(double step_c, double learning_s, double length_s,
             const std::function<double(double)>& temperature,
             const std::function<double(double)>& slope) {
  TemperatureFilter filter(step_c);
  Worst worst;
  for (double t_s = 0.0; t_s < length_s; t_s += kInterval_s) {
    const double reported_c =
        step_c > 0.0 ? std::round(temperature(t_s) / step_c) * step_c : temperature(t_s);
    filter.add(at(t_s), reported_c);
    if (t_s < learning_s) continue;
    worst.temperature_c =
        std::max(worst.temperature_c, std::abs(filter.temperature_c() - temperature(t_s)));
    worst.slope_c_s = std::max(worst.slope_c_s, std::abs(filter.slope_c_s() - slope(t_s)));
  }
  return worst;
}

// 10 K up and down in ten minutes; the slope reaches 0.1 K/s.
double swing(double t_s) {
  return 30.0 + 10.0 * std::sin(2.0 * std::numbers::pi * t_s / 600.0);
}
double swing_slope(double t_s) {
  const double omega = 2.0 * std::numbers::pi / 600.0;
  return 10.0 * omega * std::cos(omega * t_s);
}

TEST(TemperatureFilter, KnowsNothingBeforeTheFirstValue) {
  const TemperatureFilter filter(0.01);
  EXPECT_FALSE(filter.known());
  EXPECT_TRUE(std::isnan(filter.temperature_c()));
  EXPECT_TRUE(std::isnan(filter.slope_c_s()));
}

TEST(TemperatureFilter, BeginsAtTheFirstValueWithoutASlope) {
  TemperatureFilter filter(0.01);
  filter.add(at(1.0), 31.5);
  EXPECT_EQ(filter.temperature_c(), 31.5);
  EXPECT_EQ(filter.slope_c_s(), 0.0);
}

TEST(TemperatureFilter, FollowsAnEvenChangeWithoutLag) {
  const Worst worst = follow(
      0.0, 120.0, 300.0, [](double t) { return 20.0 + 0.05 * t; }, [](double) { return 0.05; });
  EXPECT_LT(worst.slope_c_s, 1e-9);
  EXPECT_LT(worst.temperature_c, 1e-9);
}

// The lag of a parabola is of third order: three squared memories times T''', here below 1 %.
TEST(TemperatureFilter, FollowsASwingSeenInFineSteps) {
  const Worst worst = follow(0.01, 60.0, 1200.0, swing, swing_slope);
  EXPECT_LT(worst.slope_c_s, 0.02 * 0.105);
  EXPECT_LT(worst.temperature_c, 0.01);
}

// Car sensors: one degree a step. The slope is poor, but far below the 100 K/s that a difference of
// neighbouring values would give, and better than none.
TEST(TemperatureFilter, MakesTheBestOfACoarseSensor) {
  const Worst worst = follow(1.0, 300.0, 1800.0, swing, swing_slope);
  EXPECT_LT(worst.slope_c_s, 0.25 * 0.105);
  EXPECT_LT(worst.temperature_c, 0.5);
}

// At rest a value that flickers between two neighbours must not look like a change.
TEST(TemperatureFilter, OneStepMovesTheSlopeByAStepPerMemoryAtMost) {
  for (const double step_c : {0.01, 0.1, 1.0}) {
    TemperatureFilter filter(step_c);
    double most = 0.0;
    for (double t_s = 0.0; t_s < 400.0; t_s += kInterval_s) {
      filter.add(at(t_s), t_s < 200.0 ? 25.0 : 25.0 + step_c);
      most = std::max(most, std::abs(filter.slope_c_s()));
    }
    EXPECT_LT(most, 0.82 * step_c / filter.memory_s()) << step_c;
    EXPECT_GT(most, 0.6 * step_c / filter.memory_s()) << step_c;
  }
}

TEST(TemperatureFilter, GivesTheSameAtAnyRateOfValues) {
  TemperatureFilter slow(0.0);
  TemperatureFilter fast(0.0);
  for (int i = 0; i < 4000; ++i)
    fast.add(at(0.005 * i), swing(0.005 * i));
  for (int i = 0; i < 200; ++i)
    slow.add(at(0.1 * i), swing(0.1 * i));
  EXPECT_NEAR(slow.slope_c_s(), fast.slope_c_s(), 1e-3);
}

// Gains of one interval are not used for another: a filter that has seen thousands of different
// intervals continues like one that begins there, except for its state.
TEST(TemperatureFilter, TakesEachIntervalForWhatItIs) {
  constexpr std::uint64_t kSeed = 7;
  std::mt19937_64 random(kSeed);
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  TemperatureFilter filter(0.01);
  const double memory_s = filter.memory_s();
  TimePoint t = at(1.0);
  filter.add(t, 20.0);
  double temperature_c = 20.0;
  double slope_c_s = 0.0;
  double curvature_c_s2 = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    const Duration step(random() % 4 == 0
                            ? static_cast<std::int64_t>(1 + random() % 50'000'000)
                            : 2'000'000 + 1000 * static_cast<std::int64_t>(random() % 40));
    t += step;
    const double value_c = 20.0 + 0.01 * static_cast<double>(random() % 200);
    filter.add(t, value_c);
    // Three poles at −1/memory, written out.
    const double dt_s = to_seconds(step);
    const double keep = std::exp(-dt_s / memory_s);
    const double lose = -std::expm1(-dt_s / memory_s);
    const double foretold_c = temperature_c + dt_s * (slope_c_s + 0.5 * dt_s * curvature_c_s2);
    const double surprise_c = value_c - foretold_c;
    temperature_c = foretold_c + (1.0 - keep * keep * keep) * surprise_c;
    slope_c_s += dt_s * curvature_c_s2 + 1.5 * lose * lose * (1.0 + keep) / dt_s * surprise_c;
    curvature_c_s2 += lose * lose * lose / (dt_s * dt_s) * surprise_c;
    ASSERT_EQ(filter.temperature_c(), temperature_c) << "value " << i;
    ASSERT_EQ(filter.slope_c_s(), slope_c_s) << "value " << i;
  }
}

TEST(TemperatureFilter, BeginsAnewAfterASilence) {
  TemperatureFilter filter(0.01);
  for (double t_s = 0.0; t_s < 60.0; t_s += kInterval_s)
    filter.add(at(t_s), 20.0 + 0.1 * t_s);
  filter.add(at(3600.0), 60.0);
  EXPECT_EQ(filter.temperature_c(), 60.0);
  EXPECT_EQ(filter.slope_c_s(), 0.0);
  filter.add(at(3599.0), 10.0);
  EXPECT_EQ(filter.temperature_c(), 60.0) << "an older value is passed over";
}

}  // namespace
}  // namespace vgyro::fusion
