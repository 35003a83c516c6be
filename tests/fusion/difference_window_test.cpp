// Compares the regression of the two gyros' difference with plain least squares over all cells.

#include "fusion/difference_window.h"

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "fusion/quadratic.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kCell_s = 0.1;
constexpr RateNoise kNoise{
    .rate_density = 1e-6, .difference_density = 5e-6, .per_rate_square = 1e-9};

struct Truth {
  double bias_dps = 0.15;
  double scale = 0.004;
  double skew_s = 0.003;
};

/// Cells of a motion whose derivative is known.
template <class Rate, class Slope>
std::vector<RateCell> cells_of(int count, Rate&& rate, Slope&& slope, const Truth& truth,
                               Random& random) {
  std::vector<RateCell> cells;
  for (int i = 0; i < count; ++i) {
    const double t = (i + 0.5) * kCell_s;
    const double noise = random.normal(std::sqrt(
        (kNoise.difference_density + kNoise.per_rate_square * squared(rate(t))) / kCell_s));
    cells.push_back({rate(t) + random.normal(std::sqrt(kNoise.rate_density / kCell_s)),
                     truth.bias_dps + truth.scale * rate(t) + truth.skew_s * slope(t) + noise,
                     kCell_s});
  }
  return cells;
}

/// The estimate of (b₁ − b₂, s, τ) from all cells, by hand: a row for each cell, its regressors
/// from a polynomial through five cells, noise weighted. A regressor counts if it exceeds five
/// times its own noise; the gyros may have seen an acceleration half a millisecond apart.
struct Plain {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();

  explicit Plain(const std::vector<RateCell>& cells) {
    Eigen::Matrix<double, 5, 5> powers;
    for (int i = 0; i < 5; ++i) {
      for (int j = 0; j < 5; ++j)
        powers(i, j) = std::pow((i - 2) * kCell_s, j);
    }
    const Eigen::Matrix<double, 5, 5> inverse = powers.inverse();
    const double slope_sigma = inverse.row(1).norm() * std::sqrt(kNoise.rate_density / kCell_s);
    for (std::size_t i = 2; i + 2 < cells.size(); ++i) {
      Eigen::Matrix<double, 5, 1> near;
      for (int j = 0; j < 5; ++j)
        near(j) = cells[i + static_cast<std::size_t>(j) - 2].rate_dps;
      const double slope = inverse.row(1).dot(near);
      const double rate = cells[i].rate_dps;
      Eigen::Vector3d row(1.0, 0.0, 0.0);
      if (std::abs(rate) > 5.0 * std::sqrt(kNoise.rate_density / kCell_s)) row(1) = rate;
      if (std::abs(slope) > 5.0 * slope_sigma) row(2) = slope;
      const double variance =
          (kNoise.difference_density + kNoise.per_rate_square * rate * rate) / kCell_s +
          std::pow(5e-4 * slope, 2.0);
      information += row * row.transpose() / variance;
      right += row * cells[i].difference_dps / variance;
    }
  }
};

Eigen::Matrix3d information_of(const DriftMeasurement& one) {
  Eigen::MatrixXd rows(one.rows.rows(), 3);
  for (int i = 0; i < rows.rows(); ++i)
    rows.row(i) << one.rows(i, kBias1), one.rows(i, kScale), one.rows(i, kSkew);
  return rows.transpose() * one.noise.inverse() * rows;
}
Eigen::Vector3d right_of(const DriftMeasurement& one) {
  Eigen::MatrixXd rows(one.rows.rows(), 3);
  for (int i = 0; i < rows.rows(); ++i)
    rows.row(i) << one.rows(i, kBias1), one.rows(i, kScale), one.rows(i, kSkew);
  return rows.transpose() * one.noise.inverse() * one.values;
}

DriftMeasurement measured(const std::vector<RateCell>& cells) {
  DifferenceWindow window;
  for (const RateCell& cell : cells)
    window.add(cell, kNoise);
  return window.measure();
}

void expect_same(const DriftMeasurement& found, const Plain& plain) {
  const Eigen::Matrix3d information = information_of(found);
  const Eigen::Vector3d right = right_of(found);
  for (int i = 0; i < 3; ++i) {
    const double unit = std::sqrt(plain.information(i, i));
    EXPECT_NEAR(right(i), plain.right(i), 1e-7 * plain.right.norm()) << i;
    for (int j = 0; j < 3; ++j) {
      EXPECT_NEAR(information(i, j), plain.information(i, j),
                  1e-7 * unit * std::sqrt(plain.information(j, j)))
          << i << ", " << j;
    }
  }
  for (int row = 0; row < found.rows.rows(); ++row)
    EXPECT_EQ(found.rows(row, kBias2), -found.rows(row, kBias1)) << "only the difference is seen";
}

TEST(DifferenceWindow, IsTheLeastSquaresOverItsCells) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const auto rate = [](double t) { return 10.0 * std::sin(0.7 * t) + 5.0; };
    const auto slope = [](double t) { return 7.0 * std::cos(0.7 * t); };
    const auto cells = cells_of(150, rate, slope, {}, random);
    const DriftMeasurement found = measured(cells);
    ASSERT_EQ(found.values.size(), 3);
    expect_same(found, Plain(cells));
  }
}

// A regressor that was not excited has no row: the scale factor at rest, the skew in a steady turn.
TEST(DifferenceWindow, SaysNothingOfWhatWasNotExcited) {
  Random random(11);
  const auto none = [](double /*t*/) { return 0.0; };
  const auto rest = cells_of(100, none, none, {}, random);
  EXPECT_EQ(measured(rest).values.size(), 1);
  expect_same(measured(rest), Plain(rest));
  const auto turn = cells_of(
      100, [](double t) { return 20.0 + 1e-3 * t; }, none, {}, random);
  const DriftMeasurement turning = measured(turn);
  // At a constant rate, bias and scale factor differ only by the rate's noise.
  ASSERT_GE(turning.values.size(), 1);
  EXPECT_EQ(information_of(turning)(2, 2), 0.0);
  expect_same(turning, Plain(turn));
  EXPECT_EQ(measured({}).values.size(), 0);
}

// Errors in units of the rows' own σ, over many windows.
TEST(DifferenceWindow, KnowsHowFarItIsOff) {
  constexpr int kRuns = 300;
  constexpr std::uint64_t kSeed = 12;
  Random random(kSeed);
  const Truth truth;
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    const double phase = random.uniform(0.0, 6.28);
    const auto rate = [phase](double t) { return 3.0 * std::sin(0.7 * t + phase) + 2.0; };
    const auto slope = [phase](double t) { return 2.1 * std::cos(0.7 * t + phase); };
    const DriftMeasurement found = measured(cells_of(150, rate, slope, truth, random));
    ASSERT_EQ(found.values.size(), 3);
    const Eigen::Matrix3d covariance = information_of(found).inverse();
    const Eigen::Vector3d away =
        covariance * right_of(found) - Eigen::Vector3d(truth.bias_dps, truth.scale, truth.skew_s);
    square += away.cwiseProduct(away).cwiseQuotient(covariance.diagonal()) / kRuns;
  }
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(square(i), 1.0, kSigmas * std::sqrt(2.0 / kRuns)) << i << ", seed " << kSeed;
}

// A window continues the cells of the one before; nothing is differentiated across a gap.
TEST(DifferenceWindow, KeepsTheLastCellsButNotAcrossAGap) {
  Random random(13);
  const auto rate = [](double t) { return 10.0 * std::sin(0.7 * t) + 5.0; };
  const auto slope = [](double t) { return 7.0 * std::cos(0.7 * t); };
  const auto cells = cells_of(104, rate, slope, {}, random);
  DifferenceWindow window;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    window.add(cells[i], kNoise);
    if (i % 26 != 25) continue;
    sum += information_of(window.measure());
    window.clear();
    EXPECT_EQ(window.measure().values.size(), 0);
  }
  const Plain plain(cells);
  EXPECT_LT((sum - plain.information).norm(), 1e-9 * plain.information.norm());

  // Two halves with a jump of the rate between them: each by itself.
  DifferenceWindow broken;
  std::vector<RateCell> first(cells.begin(), cells.begin() + 50);
  std::vector<RateCell> second(cells.begin() + 70, cells.end());
  for (const RateCell& cell : first)
    broken.add(cell, kNoise);
  broken.break_off();
  for (const RateCell& cell : second)
    broken.add(cell, kNoise);
  const Eigen::Matrix3d halves = Plain(first).information + Plain(second).information;
  EXPECT_LT((information_of(broken.measure()) - halves).norm(), 1e-9 * halves.norm());
}

}  // namespace
}  // namespace vgyro::fusion
