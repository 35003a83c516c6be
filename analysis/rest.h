#pragma once

// Was the platform still? Noise and drift belong to each gyro alone, motion to both: at rest the
// sum of the two rates varies like their difference, in motion it varies far more. A steady turn
// cannot be told from two equal biases, so a common rate beyond kTurning_dps counts as turning.

#include <array>
#include <optional>

#include "analysis/series.h"

namespace vgyro::analysis {

struct Stretch {
  double from_s = 0.0;
  double to_s = 0.0;
  [[nodiscard]] double seconds() const { return to_s - from_s; }
};

struct MotionSummary {
  static constexpr double kTurning_dps = 2.0;
  static constexpr double kRestMin_s = 30.0;

  bool at_rest = false;           ///< throughout
  double turned_up_to_dps = 0.0;  ///< fastest second, off the median
  std::optional<Stretch> rest;    ///< the longest, where it is at least kRestMin_s
};

/// `paired`: both gyros' rates at common instants.
MotionSummary find_motion(const std::array<Series, 2>& paired);

/// How much of the difference y₁ − y₂ follows the rotation.
struct Mismatch {
  double scale = 0.0;  ///< per unit of rate: gyro 1 reads more, where positive
  double lag_s = 0.0;  ///< gyro 1 is ahead of gyro 2, where positive
};

struct Difference {
  Series series;
  std::optional<Mismatch> removed;  ///< by least squares, where the platform moved
};

Difference difference(const std::array<Series, 2>& paired, const MotionSummary& motion);

}  // namespace vgyro::analysis
