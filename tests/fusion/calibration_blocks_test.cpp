// The error of a calibration whose platform sways.

#include "fusion/calibration_blocks.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kBlock_s = 0.5;
constexpr std::array<double, 2> kWhite{1e-3, 2e-3};  // deg/s/√Hz
constexpr Symmetric kDensity{1e-6, 0.0, 4e-6};

/// A rest of some seconds on a platform that sways, in blocks.
CalibrationBlocks rest(double seconds, double sway_dps, double period_s, Random& random,
                       double slope_dps_s = 0.0) {
  CalibrationBlocks blocks;
  const double omega = 2.0 * std::numbers::pi / period_s;
  const double phase = random.uniform(0.0, 2.0 * std::numbers::pi);
  for (double t = 0.0; t < seconds; t += kBlock_s) {
    CellBlock block;
    block.from_s = t;
    block.to_s = t + kBlock_s;
    block.count = 1;
    Cell& cell = block.cells[0];
    cell.length_s = kBlock_s;
    cell.count = 25.0;
    // The mean of a sine over the block.
    const double sway = sway_dps / (omega * kBlock_s) *
                        (std::cos(omega * t + phase) - std::cos(omega * (t + kBlock_s) + phase));
    for (std::size_t k = 0; k < 2; ++k)
      cell.mean_dps[k] =
          0.1 + slope_dps_s * t + sway + random.normal(kWhite[k] / std::sqrt(kBlock_s));
    blocks.add(block);
  }
  return blocks;
}

/// Gyro 1's mean over all blocks, less its bias.
double mean_error(const CalibrationBlocks& blocks) {
  double sum = 0.0;
  double length = 0.0;
  for (std::size_t i = 0; i < blocks.count(); ++i) {
    sum += (blocks[i].excess_dps[0] - 0.1) * blocks[i].length_s;
    length += blocks[i].length_s;
  }
  return sum / length;
}

// One calibration in a thousand may look like sway.
TEST(CalibrationBlocks, FindNoSwayInNoise) {
  constexpr std::uint64_t kRuns = 1000;
  for (const double seconds : {10.0, 60.0, 300.0}) {
    int swaying = 0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      Random random(seed);
      swaying += rest(seconds, 0.0, 1.0, random).sway_variance(kDensity) > 0.0 ? 1 : 0;
    }
    EXPECT_LE(swaying, 10) << "of " << kRuns << ", " << seconds << " s";
  }
}

// A slope is not sway, however steep.
TEST(CalibrationBlocks, FindNoSwayInASlope) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    EXPECT_EQ(rest(60.0, 0.0, 1.0, random, 0.01).sway_variance(kDensity), 0.0) << "seed " << seed;
  }
}

// If the sway is far above the noise, the stated variance of the blocks covers the error that it
// causes in the mean.
TEST(CalibrationBlocks, CoverWhatSwayDoesToTheMean) {
  constexpr std::uint64_t kRuns = 200;
  for (const double period_s : {1.3, 2.7, 4.1, 7.3, 11.0}) {
    for (const double seconds : {20.0, 60.0, 120.0}) {
      double error = 0.0;
      double told = 0.0;
      for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
        Random random(seed);
        const CalibrationBlocks blocks = rest(seconds, 0.05, period_s, random);
        error += squared(mean_error(blocks)) / kRuns;
        told += (blocks.sway_variance(kDensity) / static_cast<double>(blocks.count()) +
                 kDensity[0] / seconds) /
                kRuns;
      }
      EXPECT_LT(error, 1.2 * told)
          << "a period of " << period_s << " s, " << seconds << " s, seeds 1 to " << kRuns;
    }
  }
}

// When full, it merges neighbours and keeps the mean.
TEST(CalibrationBlocks, KeepTheMeanOfALongRest) {
  Random random(3);
  const CalibrationBlocks blocks = rest(3600.0, 0.0, 1.0, random);
  EXPECT_LE(blocks.count(), CalibrationBlocks::kBlocks);
  double length = 0.0;
  for (std::size_t i = 0; i < blocks.count(); ++i)
    length += blocks[i].length_s;
  EXPECT_NEAR(length, 3600.0, 1e-9);
  EXPECT_LT(std::abs(mean_error(blocks)), kSigmas * kWhite[0] / 60.0);
}

}  // namespace
}  // namespace vgyro::fusion
