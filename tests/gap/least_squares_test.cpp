#include "gap/least_squares.h"

#include <cmath>
#include <random>

#include <Eigen/LU>
#include <Eigen/QR>
#include <gtest/gtest.h>

namespace vgyro::gap {
namespace {

// Normal equations square the condition of the columns, which is some hundreds here.
constexpr double kRounding = 1e-9;

struct Problem {
  Eigen::MatrixXd columns;
  Eigen::VectorXd right;

  [[nodiscard]] Solution solved() const {
    return solve(columns.transpose() * columns, columns.transpose() * right);
  }
  [[nodiscard]] double lost(const Eigen::VectorXd& x) const {
    return right.squaredNorm() - (right - columns * x).squaredNorm();
  }
};

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index cols, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd matrix(rows, cols);
  for (double& value : matrix.reshaped())
    value = normal(random);
  return matrix;
}

// Columns of sizes that are a million apart, as those of a cube and of a bias are.
Problem some_problem(std::uint64_t seed, Eigen::Index cols = 5) {
  std::mt19937_64 random(seed);
  Problem problem{random_matrix(60, cols, random), random_matrix(60, 1, random)};
  for (Eigen::Index i = 0; i < cols; ++i)
    problem.columns.col(i) *= std::pow(10.0, static_cast<double>(i % 4) * 2.0 - 3.0);
  problem.right += problem.columns.rowwise().sum();
  return problem;
}

TEST(LeastSquares, AgreesWithTheQrDecomposition) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Problem problem = some_problem(seed);
    const Solution ours = problem.solved();
    const Eigen::VectorXd theirs = problem.columns.colPivHouseholderQr().solve(problem.right);
    for (Eigen::Index i = 0; i < theirs.size(); ++i)
      EXPECT_NEAR(ours.x[i] / theirs[i], 1.0, kRounding) << "seed " << seed << ", " << i;
    // (AᵀA)⁻¹ by the triangle of QR, which never forms AᵀA.
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(problem.columns);
    const Eigen::MatrixXd triangle =
        qr.matrixQR().topRows(theirs.size()).triangularView<Eigen::Upper>();
    const Eigen::MatrixXd inverse = triangle.inverse();
    const Eigen::MatrixXd covariance = inverse * inverse.transpose();
    for (Eigen::Index i = 0; i < theirs.size(); ++i) {
      for (Eigen::Index j = 0; j < theirs.size(); ++j) {
        const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
        EXPECT_NEAR(ours.covariance(i, j), covariance(i, j), kRounding * scale) << "seed " << seed;
      }
    }
  }
}

TEST(LeastSquares, GainIsWhatTheSumOfSquaresLoses) {
  for (const std::uint64_t seed : {4U, 5U, 6U}) {
    const Problem problem = some_problem(seed);
    const Solution solution = problem.solved();
    const double lost = problem.lost(solution.x);
    EXPECT_NEAR(solution.gain / lost, 1.0, kRounding) << "seed " << seed;
    // No other x loses more.
    std::mt19937_64 random(seed);
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::VectorXd other =
          solution.x + (solution.x.array() * random_matrix(5, 1, random).array() * 0.01).matrix();
      EXPECT_LT(problem.lost(other), lost) << "seed " << seed;
    }
  }
}

TEST(LeastSquares, PassesOverColumnsThatAreAlike) {
  Problem problem = some_problem(7);
  problem.columns.conservativeResize(Eigen::NoChange, 7);
  problem.columns.col(5) = -3.0 * problem.columns.col(1);
  problem.columns.col(6) = problem.columns.col(0) + problem.columns.col(2);
  const Solution solution = problem.solved();
  EXPECT_TRUE(solution.x.allFinite());
  EXPECT_TRUE(solution.covariance.allFinite());
  // What the seven say is what the five do.
  const Solution five = some_problem(7).solved();
  const Eigen::VectorXd fitted = problem.columns * solution.x;
  const Eigen::VectorXd fitted_by_five = some_problem(7).columns * five.x;
  EXPECT_LT((fitted - fitted_by_five).norm(), 1e-6 * fitted_by_five.norm());
  EXPECT_NEAR(solution.gain / five.gain, 1.0, 1e-6);
}

TEST(LeastSquares, ColumnOfZerosHasNoPart) {
  Problem problem = some_problem(8);
  problem.columns.col(2).setZero();
  const Solution solution = problem.solved();
  EXPECT_EQ(solution.x[2], 0.0);
  EXPECT_EQ(solution.covariance.row(2).norm(), 0.0);
  EXPECT_EQ(solution.covariance.col(2).norm(), 0.0);
  EXPECT_GT(solution.covariance(1, 1), 0.0);
  Problem nothing = problem;
  nothing.columns.setZero();
  const Solution zero = nothing.solved();
  EXPECT_EQ(zero.x.norm(), 0.0);
  EXPECT_EQ(zero.covariance.norm(), 0.0);
  EXPECT_EQ(zero.gain, 0.0);
}

TEST(LeastSquares, OfNothingIsNothing) {
  const Solution solution = solve(Eigen::MatrixXd(0, 0), Eigen::VectorXd(0));
  EXPECT_EQ(solution.x.size(), 0);
  EXPECT_EQ(solution.gain, 0.0);
  const Solution alone = explain_first(Eigen::MatrixXd::Constant(1, 1, 4.0));
  EXPECT_EQ(alone.x.size(), 0);
  EXPECT_EQ(alone.gain, 0.0);
}

TEST(LeastSquares, ExplainsTheFirstColumnByTheOthers) {
  const Problem problem = some_problem(9);
  Eigen::MatrixXd all(60, 6);
  all.col(0) = problem.right;
  all.rightCols(5) = problem.columns;
  const Solution explained = explain_first(all.transpose() * all);
  const Solution direct = problem.solved();
  EXPECT_TRUE(explained.x.isApprox(direct.x, kRounding));
  EXPECT_NEAR(explained.gain / direct.gain, 1.0, kRounding);
}

// In units of the noise the covariance is that of x, over many draws.
TEST(LeastSquares, ErrorsScatterAsTheCovarianceSays) {
  constexpr int kDraws = 2000;
  constexpr double kSigmas = 4.0;
  Problem problem = some_problem(10, 3);
  const Eigen::Vector3d truth(1.0, -2.0, 0.5);
  std::mt19937_64 random(10);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd covariance;
  for (int draw = 0; draw < kDraws; ++draw) {
    problem.right = problem.columns * truth + random_matrix(60, 1, random);
    const Solution solution = problem.solved();
    covariance = solution.covariance;
    const Eigen::Vector3d error = solution.x - truth;
    scatter += error * error.transpose() / kDraws;
  }
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) {
      const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
      EXPECT_NEAR(scatter(i, j), covariance(i, j), kSigmas * std::sqrt(2.0 / kDraws) * scale)
          << "seed 10";
    }
  }
}

}  // namespace
}  // namespace vgyro::gap
