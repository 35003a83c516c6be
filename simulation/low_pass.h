#pragma once

// What first-order low-passes, one behind the other, make of a curve: the exact response, by
// quadrature over pieces so short that it is as good as the arithmetic. Before the curve's first
// point the input stood still.

#include <span>
#include <vector>

#include "simulation/curve.h"

namespace vgyro::simulation {

class LowPass {
 public:
  /// One behind the other; more would not be told apart in double precision.
  static constexpr std::size_t kStagesMax = 3;

  /// Without cutoffs the curve itself. Precondition: at most kStagesMax, each above 0. The curve
  /// outlives this.
  LowPass(const Curve& input, std::span<const double> cutoffs_hz);

  /// Precondition: t never goes back.
  double at(double t_s);

 private:
  struct Stage {
    double rate_rad_s;
    double weight;
    double output;
  };
  void advance(Stage& stage, double from_s, double to_s) const;

  const Curve* input_;
  std::vector<Stage> stages_;
  double at_s_ = 0.0;
};

}  // namespace vgyro::simulation
