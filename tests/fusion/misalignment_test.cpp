#include "fusion/misalignment.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr double kRate_hz = 50.0;

/// Two units on a car: turns about z, some sway about x and y.
struct Drive {
  std::array<double, 3> angle_rad{};
  std::array<double, 3> scale{};
  double skew_s = 0.0;
  double noise_dps = 0.02;     ///< of a sample of each unit
  double walk_dps_rts = 1e-4;  ///< of each bias
  double turns_dps = 15.0;     ///< about z
  double sway_dps = 1.5;       ///< about x and y, at about half a hertz
  std::uint64_t seed = 1;
};

std::array<double, 3> rate_at(const Drive& drive, double t_s) {
  const double sway = drive.sway_dps;
  return {sway * std::sin(2.9 * t_s) + 0.5 * sway * std::sin(0.71 * t_s + 1.0),
          sway * std::sin(2.3 * t_s + 2.0) + 0.5 * sway * std::sin(0.53 * t_s),
          drive.turns_dps * std::sin(0.31 * t_s) * std::sin(0.047 * t_s)};
}

/// (Ω × θ) + scale + skew, as in the header.
std::array<double, 3> second_at(const Drive& drive, double t_s) {
  std::array<double, 3> rate = rate_at(drive, t_s + drive.skew_s);
  const std::array<double, 3> w = rate;
  const std::array<double, 3>& a = drive.angle_rad;
  rate[0] += w[1] * a[2] - w[2] * a[1];
  rate[1] += w[2] * a[0] - w[0] * a[2];
  rate[2] += w[0] * a[1] - w[1] * a[0];
  for (std::size_t i = 0; i < 3; ++i)
    rate[i] += drive.scale[i] * w[i];
  return rate;
}

void play(const Drive& drive, double length_s, Misalignment& misalignment) {
  Random random(drive.seed);
  AxisRates first_bias{0.1, -0.2, 0.3};
  AxisRates second_bias{-0.3, 0.1, 0.05};
  const auto count = static_cast<int>(length_s * kRate_hz);
  for (int n = 0; n < count; ++n) {
    const double t_s = n / kRate_hz;
    AxisRates first = rate_at(drive, t_s);
    AxisRates second = second_at(drive, t_s);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first_bias[axis] += random.normal(drive.walk_dps_rts / std::sqrt(kRate_hz));
      second_bias[axis] += random.normal(drive.walk_dps_rts / std::sqrt(kRate_hz));
      first[axis] += first_bias[axis] + random.normal(drive.noise_dps);
      second[axis] += second_bias[axis] + random.normal(drive.noise_dps);
    }
    misalignment.add(t_s, first, second);
  }
}

TEST(Misalignment, OfHalfADegreeIsFoundToAFiftiethInTenMinutesOfDriving) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const Drive drive{.angle_rad = {0.3 * kRadPerDeg, -0.32 * kRadPerDeg, 0.24 * kRadPerDeg},
                      .seed = seed};
    Misalignment misalignment;
    play(drive, 600.0, misalignment);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double off_deg = (misalignment.angle_rad()[axis] - drive.angle_rad[axis]) / kRadPerDeg;
      EXPECT_LT(std::abs(off_deg), 0.02) << axis;
      EXPECT_LT(misalignment.sigma_rad()[axis] / kRadPerDeg, 0.02) << axis;
    }
  }
}

TEST(Misalignment, IsAsFarOffAsItSays) {
  double squares = 0.0;
  double count = 0.0;
  for (std::uint64_t seed = 100; seed < 140; ++seed) {
    Random random(seed);
    Drive drive{.noise_dps = random.uniform(0.005, 0.1), .seed = seed};
    for (double& angle : drive.angle_rad)
      angle = random.normal(0.5 * kRadPerDeg);
    for (double& scale : drive.scale)
      scale = random.normal(2e-3);
    Misalignment misalignment;
    play(drive, 120.0, misalignment);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double off = misalignment.angle_rad()[axis] - drive.angle_rad[axis];
      squares += std::pow(off / misalignment.sigma_rad()[axis], 2);
      count += 1.0;
    }
  }
  // A mean of squares of normal errors has a spread of sqrt(2 / n).
  EXPECT_NEAR(squares / count, 1.0, kSigmas * std::sqrt(2.0 / count));
}

TEST(Misalignment, IsNotTakenFromScaleFactorsOrLateStamps) {
  const Drive drive{.scale = {5e-3, -4e-3, 6e-3}, .skew_s = 0.002, .noise_dps = 0.01};
  Misalignment misalignment;
  play(drive, 600.0, misalignment);
  for (std::size_t axis = 0; axis < 3; ++axis)
    EXPECT_LT(std::abs(misalignment.angle_rad()[axis]) / kRadPerDeg, 0.02) << axis;
}

TEST(Misalignment, StaysUnknownAtRest) {
  const Drive drive{.angle_rad = {0.01, 0.01, 0.01}, .turns_dps = 0.0, .sway_dps = 0.0};
  Misalignment misalignment;
  play(drive, 600.0, misalignment);
  EXPECT_EQ(misalignment.segments(), 0U);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(misalignment.angle_rad()[axis], 0.0);
    EXPECT_NEAR(misalignment.sigma_rad()[axis] / kRadPerDeg, Misalignment::kPrior_deg, 1e-9);
  }
}

// Motion about z alone shows θ about x and y; the third component stays as uncertain as it was.
TEST(Misalignment, IsLearnedOnlyWhereTheMotionShowsIt) {
  const Drive drive{.angle_rad = {0.008, -0.006, 0.007}, .sway_dps = 0.0};
  Misalignment misalignment;
  play(drive, 300.0, misalignment);
  EXPECT_NEAR(misalignment.angle_rad()[0], 0.008, 3e-4);
  EXPECT_NEAR(misalignment.angle_rad()[1], -0.006, 3e-4);
  EXPECT_GT(misalignment.sigma_rad()[2], 0.5 * Misalignment::kPrior_deg * kRadPerDeg);
}

// The rate about an axis that only one unit measures is used for the other axes, whose differences
// show the tilt.
TEST(Misalignment, IsLearnedFromTheOtherAxesWhereOneIsOfASingleUnit) {
  const Drive drive{.angle_rad = {0.008, -0.006, 0.007}};
  Misalignment misalignment;
  Random random(3);
  for (int n = 0; n < 30'000; ++n) {
    const double t_s = n / kRate_hz;
    AxisRates first = rate_at(drive, t_s);
    AxisRates second = second_at(drive, t_s);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first[axis] += random.normal(drive.noise_dps);
      second[axis] += random.normal(drive.noise_dps);
    }
    second[1] = first[1];
    misalignment.add(t_s, first, second, {true, false, true});
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double off = misalignment.angle_rad()[axis] - drive.angle_rad[axis];
    EXPECT_LT(std::abs(off), 4.0 * misalignment.sigma_rad()[axis]) << axis;
    EXPECT_LT(misalignment.sigma_rad()[axis] / kRadPerDeg, 0.05) << axis;
  }
}

TEST(Misalignment, TakesOffWhatUnitTwoReadsTooMuch) {
  const Drive drive{.angle_rad = {0.008, -0.006, 0.007}};
  Misalignment misalignment;
  play(drive, 600.0, misalignment);
  const AxisRates rate{3.0, -7.0, 40.0};
  const auto& a = drive.angle_rad;
  const AxisRates wanted{rate[1] * a[2] - rate[2] * a[1], rate[2] * a[0] - rate[0] * a[2],
                         rate[0] * a[1] - rate[1] * a[0]};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double sigma = std::sqrt(misalignment.cross_variance(axis, rate));
    EXPECT_NEAR(misalignment.cross_dps(axis, rate), wanted[axis], 4.0 * sigma) << axis;
    EXPECT_LT(sigma, 0.02) << axis;
  }
}

TEST(Misalignment, GoesOnFromWhatWasKept) {
  const Drive drive{.angle_rad = {0.008, -0.006, 0.007}};
  Misalignment first;
  play(drive, 600.0, first);
  Misalignment second;
  ASSERT_TRUE(second.resume(first.memory(), 3600.0));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(second.angle_rad()[axis], first.angle_rad()[axis]);
    EXPECT_GT(second.sigma_rad()[axis], first.sigma_rad()[axis]);
    EXPECT_LT(second.sigma_rad()[axis], first.sigma_rad()[axis] + 2e-4);
  }
  MisalignmentMemory wrong = first.memory();
  wrong.covariance[0] = -1.0;
  EXPECT_FALSE(second.resume(wrong, 0.0));
  wrong = first.memory();
  wrong.angle_rad[1] = NAN;
  EXPECT_FALSE(second.resume(wrong, 0.0));
  EXPECT_FALSE(second.resume(first.memory(), NAN));
}

// A bias step within a segment is not a rotation: one such segment must not spoil the estimate.
TEST(Misalignment, IsLittleMovedByAStepOfABias) {
  const Drive drive{.angle_rad = {0.008, -0.006, 0.007}};
  Misalignment misalignment;
  play(drive, 300.0, misalignment);
  const auto before = misalignment.angle_rad();
  Random random(9);
  for (int n = 0; n < 300; ++n) {
    const double t_s = 300.0 + n / kRate_hz;
    AxisRates first = rate_at(drive, t_s);
    AxisRates second = second_at(drive, t_s);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first[axis] += random.normal(drive.noise_dps);
      second[axis] += random.normal(drive.noise_dps) + (n > 120 ? 2.0 : 0.0);
    }
    misalignment.add(t_s, first, second);
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(misalignment.angle_rad()[axis], before[axis], 4.0 * misalignment.sigma_rad()[axis]);
}

}  // namespace
}  // namespace vgyro::fusion
