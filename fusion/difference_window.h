#pragma once

// Measurement of one window of the two gyros' difference: its regression on (1, Ω, dΩ/dt), cell by
// cell, kept as normal equations. Ω is the gyros' own virtual rate, so a cell's rate or its
// derivative counts only where it is far above its noise. Holds no drift and no time.

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "fusion/drift_filter.h"

namespace vgyro::fusion {

/// A cell, as input of the regression.
struct RateCell {
  double rate_dps = 0.0;        ///< virtual rate
  double difference_dps = 0.0;  ///< y₁ − y₂
  double length_s = 0.0;
};

/// Variances of a cell of one second.
struct RateNoise {
  double rate_density = 0.0;        ///< of the virtual rate
  double difference_density = 0.0;  ///< of y₁ − y₂
  double per_rate_square = 0.0;     ///< of y₁ − y₂, in addition, per (deg/s)² of rate
};

class DifferenceWindow {
 public:
  /// The next cell, without a gap to the one before. The middle one of the last five is regressed.
  void add(const RateCell& cell, const RateNoise& noise);
  /// A gap, or one gyro is missing: the next cell does not continue the last one.
  void break_off() { count_ = 0; }
  /// A new window; the last cells are kept.
  void clear();
  /// Rows of unit noise; no row for a regressor that was not excited.
  [[nodiscard]] DriftMeasurement measure() const;
  /// Variance that turning alone may leave in the difference beyond scale factor and skew,
  /// (deg/s)².
  [[nodiscard]] double motion_variance() const;
  /// Information about scale factor and skew: 1/variance.
  [[nodiscard]] double scale_information() const { return normal_(1, 1); }
  [[nodiscard]] double skew_information() const { return normal_(2, 2); }

 private:
  void regress(const RateNoise& noise);

  std::array<RateCell, 5> recent_;
  std::size_t count_ = 0;
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
  double rate_squares_ = 0.0;   ///< of the window's cells
  double slope_squares_ = 0.0;  ///< the same of dΩ/dt
  double cells_ = 0.0;
};

}  // namespace vgyro::fusion
