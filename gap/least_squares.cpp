#include "gap/least_squares.h"

#include <Eigen/Eigenvalues>

namespace vgyro::gap {

namespace {

// Of a matrix with ones on its diagonal: what is below is rounding of columns that are alike.
constexpr double kEigenvalueMin = 1e-9;

}  // namespace

Solution solve(const Eigen::MatrixXd& gram, const Eigen::VectorXd& right) {
  const Eigen::Index n = gram.rows();
  Solution solution{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n), 0.0};
  if (n == 0) return solution;
  Eigen::VectorXd scale = gram.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < n; ++i)
    scale[i] = scale[i] > 0.0 ? 1.0 / scale[i] : 0.0;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * gram * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  Eigen::VectorXd inverse = eigen.eigenvalues();
  for (Eigen::Index i = 0; i < n; ++i)
    inverse[i] = inverse[i] > kEigenvalueMin ? 1.0 / inverse[i] : 0.0;
  const Eigen::MatrixXd scaled_inverse =
      eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  solution.covariance = scale.asDiagonal() * scaled_inverse * scale.asDiagonal();
  solution.x = solution.covariance * right;
  solution.gain = right.dot(solution.x);
  return solution;
}

Solution explain_first(const Eigen::MatrixXd& gram) {
  const Eigen::Index n = gram.rows() - 1;
  return solve(gram.bottomRightCorner(n, n), gram.col(0).tail(n));
}

}  // namespace vgyro::gap
