#pragma once

// The response of low-passes in series to a curve, exact: quadrature over pieces so short that its
// error is that of the arithmetic. Before the curve's first point the input is constant.

#include <complex>
#include <span>
#include <vector>

#include "model/equation.h"
#include "simulation/curve.h"

namespace vgyro::simulation {

class LowPass {
 public:
  /// Number of low-passes in series; one of second order counts as two. More cannot be separated in
  /// double precision.
  static constexpr std::size_t kStagesMax = 3;
  static std::size_t stages_of(const model::Equation& equation);

  /// Uses the low-passes of the equation; without any, returns the curve itself. Preconditions: at
  /// most kStagesMax stages; the curve outlives this object.
  LowPass(const Curve& input, const model::Equation& equation);

  /// Precondition: t never decreases.
  double at(double t_s);

 private:
  template <class Number>
  struct Stage {
    Number rate_rad_s;
    Number weight;
    Number output;
  };
  template <class Number>
  void begin(std::vector<Number> rates, std::vector<Stage<Number>>& stages);
  template <class Number>
  void advance(Stage<Number>& stage, double from_s, double to_s) const;
  template <class Number>
  double at(double t_s, std::vector<Stage<Number>>& stages);

  const Curve* input_;
  std::vector<Stage<double>> stages_;
  std::vector<Stage<std::complex<double>>> complex_;  ///< used instead if any low-pass is of second
                                                      ///< order
  double at_s_ = 0.0;
};

}  // namespace vgyro::simulation
