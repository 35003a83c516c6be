#include "gap/curve.h"

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::gap {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kInterval_s = 0.01;

struct Worst {
  double value = 0.0;
  double slope = 0.0;
};

// A sine of amplitude 1 between its samples, away from the ends.
Worst worst_of_sine(double frequency_hz) {
  std::vector<double> t_s;
  std::vector<double> value;
  const double omega = 2.0 * kPi * frequency_hz;
  for (int i = 0; i < 400; ++i) {
    t_s.push_back(kInterval_s * i);
    value.push_back(std::sin(omega * t_s.back()));
  }
  const SampledCurve curve(t_s, value);
  Worst worst;
  for (double t = 0.2; t < 3.8; t += 0.00137) {
    const SampledCurve::Point point = curve.at(t);
    worst.value = std::max(worst.value, std::abs(point.value - std::sin(omega * t)));
    worst.slope = std::max(worst.slope, std::abs(point.slope / omega - std::cos(omega * t)));
  }
  return worst;
}

TEST(SampledCurve, MeetsASineOfAThirdOfTheSamplingRate) {
  EXPECT_LT(worst_of_sine(33.0).value, 2e-4);
  EXPECT_LT(worst_of_sine(33.0).slope, 1e-3);
}

TEST(SampledCurve, MeetsASineOfTwoFifthsOfTheSamplingRate) {
  EXPECT_LT(worst_of_sine(40.0).value, 1e-3);
}

// The weights are straight between 512 places.
TEST(SampledCurve, MeetsASineOfATenthOfTheSamplingRate) {
  EXPECT_LT(worst_of_sine(10.0).value, 1e-4);
  EXPECT_LT(worst_of_sine(10.0).slope, 1e-3);
}

TEST(SampledCurve, MeetsSlowMotionToSomeMillionths) {
  EXPECT_LT(worst_of_sine(3.0).value, 4e-6);
  EXPECT_LT(worst_of_sine(3.0).slope, 1e-4);
  EXPECT_LT(worst_of_sine(1.0).value, 1e-6);
}

TEST(SampledCurve, MeetsAPolynomialOfFifthDegreeOnUnevenTimes) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-0.3, 0.3);
  const auto f = [](double x) { return 1.0 + x - 2.0 * x * x + std::pow(x, 5); };
  std::vector<double> t_s;
  std::vector<double> value;
  for (int i = 0; i < 200; ++i) {
    t_s.push_back(kInterval_s * (i + uniform(random)));
    value.push_back(f(t_s.back()));
  }
  const SampledCurve curve(t_s, value);
  for (double t = 0.05; t < 1.9; t += 0.0031)
    EXPECT_NEAR(curve.at(t).value, f(t), 1e-9);
}

TEST(SampledCurve, SaysHowMuchNoiseInterpolationKeeps) {
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  std::vector<double> t_s;
  std::vector<double> value;
  for (int i = 0; i < 40000; ++i) {
    t_s.push_back(kInterval_s * i);
    value.push_back(normal(random));
  }
  const SampledCurve curve(t_s, value);
  double squares = 0.0;
  double gain = 0.0;
  int count = 0;
  // Every fortieth interval: no sample counts twice.
  for (int i = 40; i < 39950; i += 40, ++count) {
    const SampledCurve::Point point = curve.at(kInterval_s * (i + 0.5));
    squares += point.value * point.value;
    gain = 0.0;
    for (const double weight : curve.weights_at(kInterval_s * (i + 0.5)).value)
      gain += weight * weight;
  }
  EXPECT_NEAR(squares / count / gain, 1.0, 5.0 * std::sqrt(2.0 / count));
}

TEST(SampledCurve, KnowsItsHolesAndEnds) {
  std::vector<double> t_s;
  std::vector<double> value;
  for (int i = 0; i < 100; ++i) {
    if (i >= 40 && i < 60) continue;
    t_s.push_back(kInterval_s * i);
    value.push_back(i);
  }
  const SampledCurve curve(t_s, value);
  EXPECT_TRUE(curve.hole_at(0.5, 0.03));
  EXPECT_FALSE(curve.hole_at(0.2, 0.03));
  EXPECT_TRUE(curve.hole_at(1.2, 0.03));
  EXPECT_EQ(curve.at(-1.0).value, 0.0);
  EXPECT_EQ(curve.at(5.0).value, 99.0);
  EXPECT_DOUBLE_EQ(curve.linear(0.005), 0.5);
}

// With pauses of seconds and of hours, and stamps that are not quite even.
TEST(SampledCurve, FindsItsPlaceAfterPausesToo) {
  std::mt19937_64 random(72);
  std::uniform_real_distribution<double> uniform(-0.3, 0.3);
  for (const double pause_s : {2.0, 7200.0}) {
    std::vector<double> t_s;
    for (int i = 0; i < 3000; ++i)
      t_s.push_back(kInterval_s * (i + uniform(random)) + pause_s * (i / 1000));
    const SampledCurve curve(t_s, t_s);
    EXPECT_EQ(curve.index_before(t_s.front() - 1.0), 0U);
    EXPECT_EQ(curve.index_before(t_s.back() + 1.0), t_s.size() - 2);
    for (std::size_t i = 0; i + 1 < t_s.size(); ++i) {
      ASSERT_EQ(curve.index_before(t_s[i]), i) << "seed 72, pause " << pause_s;
      ASSERT_EQ(curve.index_before(std::midpoint(t_s[i], t_s[i + 1])), i);
      ASSERT_EQ(curve.index_before(std::nextafter(t_s[i + 1], 0.0)), i);
    }
  }
}

}  // namespace
}  // namespace vgyro::gap
