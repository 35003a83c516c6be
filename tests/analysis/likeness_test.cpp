// Tests whether two signals feel the same motion, on signals with known motion, lag and scale.

#include "analysis/likeness.h"

#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

constexpr unsigned kSeed = 20240607;

double bends(double t_s) {
  return 20.0 * std::sin(0.7 * t_s) + 9.0 * std::sin(2.3 * t_s + 1.0) + 4.0 * std::sin(5.1 * t_s);
}

struct Sensor {
  double interval_s = 0.01;
  double noise = 0.0;
  double step = 0.0;
  unsigned seed = kSeed;
};

StampedSignal made(const std::function<double(double)>& motion, const Sensor& sensor,
                   double seconds = 60.0) {
  StampedSignal signal;
  std::mt19937 random(sensor.seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  signal.step = sensor.step;
  for (double t_s = 0.001; t_s < seconds; t_s += sensor.interval_s) {
    const double value = motion(t_s) + sensor.noise * normal(random);
    signal.t_s.push_back(t_s);
    signal.value.push_back(sensor.step > 0.0 ? std::round(value / sensor.step) * sensor.step
                                             : value);
  }
  return signal;
}

TEST(Likeness, FindsLagScaleAndSign) {
  constexpr double kLag_s = 0.043;
  const auto first = made(bends, {.noise = 0.05});
  const auto second = made([](double t_s) { return -1.02 * bends(t_s - kLag_s) + 3.0; },
                           {.interval_s = 0.02, .noise = 0.1, .seed = kSeed + 1});
  const auto found = likeness(first, second);
  ASSERT_TRUE(found);
  EXPECT_LT(found->correlation, -0.99);
  EXPECT_NEAR(found->lag_s, kLag_s, 0.003);
  EXPECT_NEAR(found->scale, -1.02, 0.01);
  EXPECT_NEAR(found->ratio, -1.02, 0.01);
  EXPECT_GT(found->significance, 10.0);
}

// In raw numbers one of them may be a thousand times the other.
TEST(Likeness, TellsTheRatioOfSignalsInDifferentUnits) {
  const auto first = made(bends, {.noise = 0.3});
  const auto second =
      made([](double t_s) { return 4000.0 * bends(t_s); }, {.noise = 1200.0, .seed = kSeed + 2});
  const auto found = likeness(first, second);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->ratio / 4000.0, 1.0, 0.02);
  EXPECT_LT(found->scale_error(), 0.02);
}

TEST(Likeness, SignalsOfDifferentThingsAreNotSignificant) {
  const auto first = made(bends, {.noise = 0.05});
  const auto second =
      made([](double t_s) { return 12.0 * std::sin(0.911 * t_s) + 5.0 * std::sin(3.17 * t_s); },
           {.noise = 0.05, .seed = kSeed + 3});
  const auto found = likeness(first, second);
  ASSERT_TRUE(found);
  EXPECT_LT(std::abs(found->correlation), 0.6);
}

TEST(Likeness, BiasAndDriftDoNotCount) {
  const auto first = made([](double t_s) { return bends(t_s) + 0.5 * t_s; }, {.noise = 0.05});
  const auto second =
      made([](double t_s) { return bends(t_s) - 40.0; }, {.noise = 0.05, .seed = kSeed + 4});
  const auto found = likeness(first, second);
  ASSERT_TRUE(found);
  EXPECT_GT(found->correlation, 0.99);
  EXPECT_NEAR(found->scale, 1.0, 0.01);
}

TEST(Likeness, SaysNothingOfWhatSharesNoTimeOrStandsStill) {
  const auto first = made(bends, {}, 10.0);
  auto later = first;
  for (double& t_s : later.t_s)
    t_s += 100.0;
  EXPECT_FALSE(likeness(first, later));
  EXPECT_FALSE(likeness(first, StampedSignal{}));
  const auto still = made([](double) { return 1.0; }, {}, 10.0);
  const auto found = likeness(first, still);
  EXPECT_TRUE(!found || found->correlation == 0.0);
}

TEST(Likeness, QuickCorrelationComesNearIt) {
  const auto first = made(bends, {.noise = 0.1});
  const auto second = made([](double t_s) { return bends(t_s - 0.2); },
                           {.interval_s = 0.033, .noise = 0.5, .seed = kSeed + 5});
  const auto other =
      made([](double t_s) { return std::sin(1.3 * t_s * t_s / 20.0); }, {.noise = 0.1});
  const auto shape = [](const StampedSignal& signal) { return change_shape(signal, 0.0, 60.0); };
  EXPECT_GT(quick_correlation(shape(first), shape(second)), 0.95);
  EXPECT_LT(quick_correlation(shape(first), shape(other)), 0.6);
}

TEST(Copies, AreMadeOfTheirSourceFilteredAndRoundedToo) {
  const auto source = made(bends, {.noise = 0.05, .step = 0.001});
  StampedSignal copy;
  copy.step = 0.005;
  for (std::size_t i = 3; i < source.value.size(); ++i) {
    const double mean = (source.value[i] + source.value[i - 1] + source.value[i - 2]) / 3.0;
    copy.t_s.push_back(source.t_s[i] + 0.004);
    copy.value.push_back(std::round(mean / copy.step) * copy.step);
  }
  EXPECT_TRUE(is_made_of(copy, source, 0.014));
}

TEST(Copies, ASensorOfItsOwnIsNone) {
  const auto source = made(bends, {.noise = 0.05, .step = 0.001});
  const auto sensor = made(bends, {.noise = 0.05, .step = 0.001, .seed = kSeed + 6});
  EXPECT_FALSE(is_made_of(sensor, source, 0.0));
}

TEST(SignalFigures, TellIntervalNoiseAndPeak) {
  const auto signal = made([](double t_s) { return t_s < 30.0 ? 2.0 : 2.0 + bends(t_s); },
                           {.interval_s = 0.02, .noise = 0.1});
  const auto figures = signal_figures(signal);
  EXPECT_NEAR(figures.interval_s, 0.02, 1e-6);
  EXPECT_NEAR(figures.noise, 0.1, 0.02);
  EXPECT_TRUE(figures.changes);
  EXPECT_GT(figures.peak, 20.0);
  EXPECT_FALSE(signal_figures(made([](double) { return 1.0; }, {})).changes);
}

}  // namespace
}  // namespace vgyro::analysis
