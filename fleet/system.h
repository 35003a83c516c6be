#pragma once

// Normal equations of a fleet: the sizes of all shapes, of each type or of one unit, and what is
// left of them once some sizes are fitted.

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vgyro::fleet {

/// What one shape has beside others that are fitted.
struct Left {
  double score = 0.0;
  double information = 0.0;  ///< 0: the others build it
  [[nodiscard]] double size() const { return information > 0.0 ? score / information : 0.0; }
  [[nodiscard]] double gain() const { return size() * score; }
};

struct System {
  explicit System(std::size_t columns = 0);

  Eigen::VectorXd score;
  Eigen::MatrixXd information;
  Eigen::VectorXd drives;      ///< that could show it
  Eigen::VectorXd dispersion;  ///< variance of a score over its information, 1 at the least

  /// Sizes of the columns in `fitted`.
  [[nodiscard]] Eigen::VectorXd solve(const std::vector<std::size_t>& fitted) const;
  [[nodiscard]] Eigen::MatrixXd covariance(const std::vector<std::size_t>& fitted) const;
  /// Every column beside `fitted`.
  [[nodiscard]] std::vector<Left> beside(const std::vector<std::size_t>& fitted) const;
  /// Variance of column's size over 1/information: what drives scatter by, and the method's own
  /// error, which all drives have in common and no number of them averages out.
  [[nodiscard]] double doubt(std::size_t column) const;
};

}  // namespace vgyro::fleet
