#include "simulation/curve.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <gtest/gtest.h>

namespace vgyro::simulation {
namespace {

constexpr double kPi = std::numbers::pi;

struct Points {
  std::vector<double> times_s;
  std::vector<double> values;
};

Points sampled(const std::function<double(double)>& f, double interval_s, std::size_t count) {
  Points points;
  for (std::size_t i = 0; i < count; ++i) {
    points.times_s.push_back(static_cast<double>(i) * interval_s);
    points.values.push_back(f(points.times_s.back()));
  }
  return points;
}

// Largest error between `from` and `to`, on a grid that avoids the points.
double worst(const std::function<double(double)>& error, double from_s, double to_s) {
  double most = 0.0;
  for (double t_s = from_s; t_s < to_s; t_s += (to_s - from_s) / 9973.0)
    most = std::max(most, std::abs(error(t_s)));
  return most;
}

struct SineErrors {
  double value;
  double integral;
  double slope;
};

SineErrors sine_errors(double samples_a_period) {
  const double w = 2.0 * kPi / (samples_a_period * 0.01);
  const Points p = sampled([&](double t) { return std::sin(w * t + 0.3); }, 0.01, 400);
  const Curve curve(p.times_s, p.values);
  // Away from the ends, where fewer points are available.
  const double from = 0.1;
  const double to = 3.9;
  const double start = curve.integral(from) + std::cos(w * from + 0.3) / w;
  return {worst([&](double t) { return curve.value(t) - std::sin(w * t + 0.3); }, from, to),
          w * worst([&](double t) { return curve.integral(t) + std::cos(w * t + 0.3) / w - start; },
                    from, to),
          worst([&](double t) { return curve.slope(t) / w - std::cos(w * t + 0.3); }, from, to)};
}

TEST(Curve, FollowsASineOfTenSamplesAPeriod) {
  const SineErrors errors = sine_errors(10.0);
  EXPECT_LT(errors.value, 1e-6);
  EXPECT_LT(errors.integral, 1e-6);
  EXPECT_LT(errors.slope, 2e-6);
}

TEST(Curve, FollowsASineOfSixSamplesAPeriodToATenThousandth) {
  EXPECT_LT(sine_errors(6.1).value, 1e-4);
}

// Between two values the curve never leaves their range, and constant parts stay constant.
TEST(Curve, DoesNotRingAtStepsAndKinks) {
  const std::function<double(double)> motions[] = {
      [](double t) { return t < 1.0 ? 0.0 : 1.0; },
      [](double t) { return t < 1.0 ? 0.0 : t - 1.0; },
      [](double t) { return t < 1.0 ? 1.0 : std::max(0.0, 2.0 - t); },
  };
  for (const auto& motion : motions) {
    const Points p = sampled(motion, 0.01, 250);
    const Curve curve(p.times_s, p.values);
    for (std::size_t i = 0; i + 1 < p.values.size(); ++i) {
      const auto [low, high] = std::minmax(p.values[i], p.values[i + 1]);
      for (double share = 0.01; share < 1.0; share += 0.01) {
        const double value = curve.value(p.times_s[i] + share * 0.01);
        ASSERT_GE(value, low - 1e-14) << p.times_s[i];
        ASSERT_LE(value, high + 1e-14) << p.times_s[i];
      }
    }
  }
}

TEST(Curve, RoundsACornerByAFifthOfASampleAtMost) {
  const auto corner = [](double t) { return std::max(0.0, t - 1.0); };
  const Points p = sampled(corner, 0.01, 250);
  const Curve curve(p.times_s, p.values);
  EXPECT_LT(worst([&](double t) { return curve.value(t) - corner(t); }, 0.0, 2.4), 0.2 * 0.01);
}

TEST(Curve, JoinsFewAndUnevenPointsWithoutOvershoot) {
  const std::vector<double> times{0.0, 10.0, 11.0, 60.0, 61.0};
  const std::vector<double> values{0.0, 0.0, 30.0, 30.0, -5.0};
  const Curve curve(times, values);
  for (double t_s = 0.0; t_s <= 10.0; t_s += 0.1)
    EXPECT_EQ(curve.value(t_s), 0.0);
  EXPECT_DOUBLE_EQ(curve.value(30.0), 30.0);
  EXPECT_NEAR(curve.value(10.5), 15.0, 1e-12);
  EXPECT_NEAR(curve.integral(60.0), 15.0 + 49.0 * 30.0, 1e-9);
}

TEST(Curve, GoesThroughItsPointsAndStandsStillBeyondThem) {
  const std::vector<double> times{1.0, 2.0, 4.0};
  const std::vector<double> values{3.0, -1.0, 5.0};
  const Curve curve(times, values);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(curve.value(times[i]), values[i], 1e-14);
  EXPECT_EQ(curve.value(-7.0), 3.0);
  EXPECT_EQ(curve.value(9.0), 5.0);
  EXPECT_EQ(curve.slope(9.0), 0.0);
  EXPECT_DOUBLE_EQ(curve.integral(-1.0), -6.0);
  EXPECT_DOUBLE_EQ(curve.integral(6.0) - curve.integral(4.0), 10.0);
  const Curve two(std::vector<double>{0.0, 2.0}, std::vector<double>{1.0, 2.0});
  EXPECT_DOUBLE_EQ(two.value(0.5), 1.25) << "two points make a line";
  const Curve one(std::vector<double>{0.0}, std::vector<double>{4.0});
  EXPECT_EQ(one.value(0.0), 4.0);
  EXPECT_EQ(Curve().value(1.0), 0.0);
}

// Checked by trapezoids over the values, independently of the curve's formulas.
TEST(Curve, IntegralAndSlopeBelongToTheValue) {
  const Points p =
      sampled([](double t) { return std::sin(9.0 * t) + (t > 1.3 ? 2.0 : 0.0); }, 0.05, 60);
  const Curve curve(p.times_s, p.values);
  constexpr double kStep_s = 1e-5;
  double sum = 0.0;
  for (double t_s = 0.0; t_s < 2.9; t_s += kStep_s) {
    sum += 0.5 * kStep_s * (curve.value(t_s) + curve.value(t_s + kStep_s));
    const double rise = (curve.value(t_s + kStep_s) - curve.value(t_s)) / kStep_s;
    ASSERT_NEAR(curve.integral(t_s + kStep_s), sum, 1e-7);
    const double within = std::fmod(t_s, 0.05);
    if (within < 0.001 || within > 0.049) continue;  // pieces may meet in corners
    ASSERT_NEAR(curve.slope(t_s + 0.5 * kStep_s), rise, 1e-3) << t_s;
  }
}

}  // namespace
}  // namespace vgyro::simulation
