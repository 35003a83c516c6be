#pragma once

// What low-passes, one behind the other, make of a curve: the exact response, by quadrature over
// pieces so short that it is as good as the arithmetic. Before the curve's first point the input
// stood still.

#include <complex>
#include <span>
#include <vector>

#include "model/equation.h"
#include "simulation/curve.h"

namespace vgyro::simulation {

class LowPass {
 public:
  /// One behind the other, of second order for two; more would not be told apart in double
  /// precision.
  static constexpr std::size_t kStagesMax = 3;
  static std::size_t stages_of(const model::Equation& equation);

  /// Those of the equation; without any the curve itself. Precondition: at most kStagesMax stages.
  /// The curve outlives this.
  LowPass(const Curve& input, const model::Equation& equation);

  /// Precondition: t never goes back.
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
  std::vector<Stage<std::complex<double>>> complex_;  ///< instead, where any is of second order
  double at_s_ = 0.0;
};

}  // namespace vgyro::simulation
