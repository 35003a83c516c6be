#include "fusion/least_squares.h"

#include <algorithm>
#include <cassert>

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace vgyro::fusion {

namespace {
// Samples must reach over this share of the window's width for its slope to mean anything.
constexpr double kCoverageMin = 0.5;
}  // namespace

LeastSquares::LeastSquares(int order, double from_s, double width_s)
    : order_(order),
      centre_s_(from_s + 0.5 * width_s),
      half_width_s_(0.5 * width_s),
      inverse_half_width_(2.0 / width_s) {
  assert(order >= 0 && order <= kOrderMax && width_s > 0.0);
}

std::optional<LeastSquares::Fit> LeastSquares::fit() const {
  const int size = order_ + 1;
  if (count_ < 2 * static_cast<std::uint64_t>(size)) return std::nullopt;
  if (x_max_ - x_min_ < 2.0 * kCoverageMin) return std::nullopt;
  using Matrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kOrderMax + 1, kOrderMax + 1>;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kOrderMax + 1, 1>;
  Matrix normal(size, size);
  Vector right(size);
  for (int i = 0; i < size; ++i) {
    right(i) = products_[static_cast<std::size_t>(i)];
    for (int j = 0; j < size; ++j) {
      normal(i, j) = moments_[static_cast<std::size_t>(i) + static_cast<std::size_t>(j)];
    }
  }
  const Vector solution = normal.ldlt().solve(right);
  Fit result;
  result.polynomial.centre_s = centre_s_;
  result.polynomial.half_width_s = half_width_s_;
  for (int i = 0; i < size; ++i) {
    result.polynomial.coefficient[static_cast<std::size_t>(i)] = solution(i);
  }
  const double residual = squares_ - solution.dot(right);
  result.residual_variance = std::max(residual, 0.0) / static_cast<double>(count_);
  return result;
}

}  // namespace vgyro::fusion
