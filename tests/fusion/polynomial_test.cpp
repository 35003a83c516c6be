#include "fusion/polynomial.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// The argument is centred and scaled: coefficients refer to the centre and to half a width.
TEST(Polynomial, HasItsCoefficientsAboutTheCentre) {
  const Polynomial line{
      .centre_s = 100.0, .half_width_s = 5.0, .coefficient = {2.0, 0.5, 0.0, 0.0}};
  EXPECT_EQ(line.at(100.0), 2.0);
  EXPECT_EQ(line.at(105.0), 2.5);
  EXPECT_EQ(line.at(95.0), 1.5);
  EXPECT_EQ(line.slope_at(0.0), 0.1);
  const Polynomial cubic{.centre_s = 0.0, .half_width_s = 1.0, .coefficient = {1.0, 2.0, 3.0, 4.0}};
  EXPECT_EQ(cubic.at(2.0), 1.0 + 4.0 + 12.0 + 32.0);
  EXPECT_EQ(cubic.slope_at(2.0), 2.0 + 12.0 + 48.0);
}

// A drift without a fit is 0.
TEST(Polynomial, IsZeroUntilItIsFitted) {
  EXPECT_EQ(Polynomial{}.at(1e9), 0.0);
  EXPECT_EQ(Polynomial{}.slope_at(1e9), 0.0);
}

// The slope is sent on the bus; it must be the derivative of the subtracted drift.
TEST(Polynomial, HasTheSlopeOfItsValues) {
  constexpr std::uint64_t kSeed = 1;
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  Random random(kSeed);
  for (int i = 0; i < 1000; ++i) {
    Polynomial p;
    p.centre_s = random.uniform(0.0, 1e4);
    p.half_width_s = random.uniform(0.5, 50.0);
    for (double& c : p.coefficient)
      c = random.uniform(-1.0, 1.0);
    const double t_s = p.centre_s + random.uniform(-2.0, 2.0) * p.half_width_s;
    const double h_s = 1e-3 * p.half_width_s;
    // Central differences have an error of h²·c₃ for a cubic, in units of x.
    const double slope = (p.at(t_s + h_s) - p.at(t_s - h_s)) / (2.0 * h_s);
    ASSERT_NEAR(p.slope_at(t_s), slope, 2e-6 / p.half_width_s) << i;
  }
}

// Present stamps are 1.7e9 s; the centred argument keeps the digits that an uncentred one loses.
TEST(Polynomial, KeepsItsDigitsFarFromTimeZero) {
  Polynomial here;
  here.half_width_s = 8.0;
  here.coefficient = {0.03, -0.7, 0.2, 0.9};
  Polynomial there = here;
  there.centre_s = 134'217'728.0;
  for (double t_s = -8.0; t_s <= 8.0; t_s += 0.25) {
    EXPECT_NEAR(there.at(there.centre_s + t_s), here.at(t_s), 4 * kEpsilon) << t_s;
  }
}

}  // namespace
}  // namespace vgyro::fusion
