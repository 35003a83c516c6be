#include "fusion/difference_window.h"

#include <algorithm>
#include <cmath>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

namespace {

// A cell's rate or its derivative counts as a regressor when it is this far above its own noise,
// which would otherwise bias the fit.
constexpr double kExcited = 5.0;

// Within a cell the two gyros may see an acceleration at slightly different times.
constexpr double kTimingDoubt_s = 0.0005;

// Remainder of a turn: scale factors are not linear, and the effect of a skew is not quite a
// multiple of the derivative.
constexpr double kScaleLeft = 1e-4;
constexpr double kTimingLeft_s = 3e-4;

}  // namespace

void DifferenceWindow::clear() {
  normal_.setZero();
  right_.setZero();
  rate_squares_ = 0.0;
  slope_squares_ = 0.0;
  cells_ = 0.0;
}

double DifferenceWindow::motion_variance() const {
  if (cells_ == 0.0) return 0.0;
  return (squared(kScaleLeft) * rate_squares_ + squared(kTimingLeft_s) * slope_squares_) / cells_;
}

void DifferenceWindow::add(const RateCell& cell, const RateNoise& noise) {
  if (count_ == recent_.size()) {
    std::move(recent_.begin() + 1, recent_.end(), recent_.begin());
    --count_;
  }
  recent_[count_++] = cell;
  if (count_ == recent_.size()) regress(noise);
}

// Adds the middle one of the recent cells. Its neighbours give the mean of dΩ/dt over it, to fourth
// order: a skew of milliseconds shows in the smallest accelerations, and so would an error of the
// mean.
void DifferenceWindow::regress(const RateNoise& noise) {
  const auto& [first, before, cell, after, last] = recent_;
  const double span_s = 12.0 * cell.length_s;
  const double slope =
      (8.0 * (after.rate_dps - before.rate_dps) - (last.rate_dps - first.rate_dps)) / span_s;
  rate_squares_ += squared(cell.rate_dps);
  slope_squares_ += squared(slope);
  cells_ += 1.0;
  const double rate_variance = noise.rate_density / cell.length_s;
  const double slope_variance = 130.0 * rate_variance / squared(span_s);
  const bool turns = squared(cell.rate_dps) > squared(kExcited) * rate_variance;
  const bool accelerates = squared(slope) > squared(kExcited) * slope_variance;
  const Eigen::Vector3d regressor{1.0, turns ? cell.rate_dps : 0.0, accelerates ? slope : 0.0};
  const double variance =
      (noise.difference_density + noise.per_rate_square * squared(cell.rate_dps)) / cell.length_s +
      squared(kTimingDoubt_s * slope);
  normal_ += regressor * regressor.transpose() / variance;
  right_ += regressor * (cell.difference_dps / variance);
}

// Normal equations → rows of unit noise, by Cholesky. A regressor that was not excited has no row.
DriftMeasurement DifferenceWindow::measure() const {
  constexpr double kNothing = 1e-9;
  Eigen::Matrix3d lower = Eigen::Matrix3d::Zero();
  Eigen::Vector3d white = Eigen::Vector3d::Zero();
  std::array<int, 3> used{};
  int rows = 0;
  for (int j = 0; j < 3; ++j) {
    double pivot = normal_(j, j);
    double value = right_(j);
    for (int r = 0; r < rows; ++r) {
      const int k = used[static_cast<std::size_t>(r)];
      pivot -= lower(j, k) * lower(j, k);
      value -= lower(j, k) * white(k);
    }
    if (pivot <= kNothing * normal_(j, j)) continue;
    lower(j, j) = std::sqrt(pivot);
    white(j) = value / lower(j, j);
    for (int i = j + 1; i < 3; ++i) {
      double cross = normal_(i, j);
      for (int r = 0; r < rows; ++r) {
        const int k = used[static_cast<std::size_t>(r)];
        cross -= lower(i, k) * lower(j, k);
      }
      lower(i, j) = cross / lower(j, j);
    }
    used[static_cast<std::size_t>(rows++)] = j;
  }
  DriftMeasurement measurement(rows);
  for (int r = 0; r < rows; ++r) {
    const int j = used[static_cast<std::size_t>(r)];
    measurement.rows(r, kBias1) = lower(0, j);
    measurement.rows(r, kBias2) = -lower(0, j);
    measurement.rows(r, kScale) = lower(1, j);
    measurement.rows(r, kSkew) = lower(2, j);
    measurement.values(r) = white(j);
  }
  return measurement;
}

}  // namespace vgyro::fusion
