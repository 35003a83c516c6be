#include "simulation/low_pass.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <utility>

namespace vgyro::simulation {

namespace {

// Equal stages are moved apart by this for the partial fractions.
constexpr double kApart = 1e-3;
// Older input has decayed below double precision.
constexpr double kMemory = 40.0;

struct Node {
  double x;  ///< in [-1, 1]
  double weight;
};
// Gauss-Legendre, eight points: exact for polynomials of degree 15.
constexpr std::array<Node, 4> kHalfRule{{{0.1834346424956498, 0.3626837833783620},
                                         {0.5255324099163290, 0.3137066458778873},
                                         {0.7966664774136267, 0.2223810344533745},
                                         {0.9602898564975363, 0.1012285362903763}}};

}  // namespace

std::size_t LowPass::stages_of(const model::Equation& equation) {
  return equation.cutoffs_hz().size() + 2 * equation.second_orders().size();
}

LowPass::LowPass(const Curve& input, const model::Equation& equation) : input_(&input) {
  assert(stages_of(equation) <= kStagesMax);
  if (!input.times_s().empty()) at_s_ = input.times_s().front();
  std::vector<double> rates;
  for (const double cutoff_hz : equation.cutoffs_hz())
    rates.push_back(2.0 * std::numbers::pi * cutoff_hz);
  if (equation.second_orders().empty()) {
    begin(std::move(rates), stages_);
    return;
  }
  std::vector<std::complex<double>> complex_rates(rates.begin(), rates.end());
  for (const model::SecondOrder& second : equation.second_orders()) {
    for (const std::complex<double> pole : second.poles())
      complex_rates.push_back(pole);
  }
  begin(std::move(complex_rates), complex_);
}

// A cascade equals a weighted sum of its stages in parallel.
template <class Number>
void LowPass::begin(std::vector<Number> rates, std::vector<Stage<Number>>& stages) {
  std::sort(rates.begin(), rates.end(), [](const Number& a, const Number& b) {
    return std::pair(std::real(a), std::imag(a)) < std::pair(std::real(b), std::imag(b));
  });
  for (std::size_t i = 1; i < rates.size(); ++i) {
    const Number apart = rates[i - 1] * (1.0 + kApart);
    if (std::imag(rates[i]) == std::imag(rates[i - 1]) && std::real(rates[i]) < std::real(apart))
      rates[i] = apart;
  }
  for (const Number rate : rates) {
    Number weight = 1.0;
    for (const Number other : rates)
      weight *= other == rate ? Number(1.0) : other / (other - rate);
    stages.push_back({rate, weight, input_->value(at_s_)});
  }
}

// Integrates between points of the curve, where the input is smooth.
template <class Number>
void LowPass::advance(Stage<Number>& stage, double from_s, double to_s) const {
  const double begin_s = std::max(from_s, to_s - kMemory / std::real(stage.rate_rad_s));
  const auto times_s = input_->times_s();
  auto next = std::upper_bound(times_s.begin(), times_s.end(), begin_s);
  for (double t_s = begin_s; t_s < to_s;) {
    double end_s = std::min(to_s, t_s + 1.0 / std::abs(stage.rate_rad_s));
    if (next != times_s.end() && *next <= end_s) end_s = *next++;
    const double half_s = 0.5 * (end_s - t_s);
    const double middle_s = t_s + half_s;
    Number sum = 0.0;
    for (const Node& node : kHalfRule) {
      for (const double x : {-node.x, node.x}) {
        sum += node.weight * std::exp(-stage.rate_rad_s * half_s * (1.0 - x)) *
               input_->value(middle_s + half_s * x);
      }
    }
    stage.output =
        stage.output * std::exp(-2.0 * stage.rate_rad_s * half_s) + stage.rate_rad_s * half_s * sum;
    t_s = end_s;
  }
}

template <class Number>
double LowPass::at(double t_s, std::vector<Stage<Number>>& stages) {
  double value = 0.0;
  for (Stage<Number>& stage : stages) {
    if (t_s > at_s_) advance(stage, at_s_, t_s);
    value += std::real(stage.weight * stage.output);
  }
  at_s_ = std::max(at_s_, t_s);
  return value;
}

double LowPass::at(double t_s) {
  if (!stages_.empty()) return at(t_s, stages_);
  return complex_.empty() ? input_->value(t_s) : at(t_s, complex_);
}

}  // namespace vgyro::simulation
