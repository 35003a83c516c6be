#pragma once

// Normal equations of a fleet for the sizes of all shapes, of each type or of one unit, and what is
// left of them once some sizes are fitted.

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vgyro::fleet {

/// What is left of one shape once others are fitted.
struct Left {
  double score = 0.0;
  double information = 0.0;  ///< 0: the fitted ones build it
  [[nodiscard]] double size() const { return information > 0.0 ? score / information : 0.0; }
  [[nodiscard]] double gain() const { return size() * score; }
};

struct System {
  explicit System(std::size_t columns = 0);

  Eigen::VectorXd score;
  Eigen::MatrixXd information;
  Eigen::VectorXd drives;      ///< number of drives that could show it
  Eigen::VectorXd dispersion;  ///< variance of a score over its information, at least 1

  /// Sizes of the columns in `fitted`.
  [[nodiscard]] Eigen::VectorXd solve(const std::vector<std::size_t>& fitted) const;
  [[nodiscard]] Eigen::MatrixXd covariance(const std::vector<std::size_t>& fitted) const;
  /// What is left of every column once `fitted` is fitted; a column of `fitted` has nothing left.
  [[nodiscard]] std::vector<Left> beside(const std::vector<std::size_t>& fitted) const;
  /// Variance of the column's size over 1/information: the scatter between drives, and the method's
  /// own error, which all drives share and no number of them averages out.
  [[nodiscard]] double doubt(std::size_t column) const;
};

}  // namespace vgyro::fleet
