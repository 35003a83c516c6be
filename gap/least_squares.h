#pragma once

#include <Eigen/Core>

namespace vgyro::gap {

/// Normal equations solved; directions without information are passed over, and their part of x and
/// of the covariance is 0.
struct Solution {
  Eigen::VectorXd x;
  Eigen::MatrixXd covariance;  ///< of x, where columns and right side are in units of the noise
  double gain = 0.0;           ///< what the sum of squares loses
};
Solution solve(const Eigen::MatrixXd& gram, const Eigen::VectorXd& right);

/// Of a gram matrix whose first row and column are the residual's: the others as its explanation.
Solution explain_first(const Eigen::MatrixXd& gram);

}  // namespace vgyro::gap
