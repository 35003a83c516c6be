#include "tests/fusion/paper_steps.h"

#include <algorithm>
#include <cmath>

namespace vgyro::fusion {

using Real = PaperSteps::Real;

Real PaperSteps::Drift::at(Real t_s) const {
  const Real x = (t_s - centre_s) / half_width_s;
  Real value = 0;
  for (auto c = coefficient.rbegin(); c != coefficient.rend(); ++c)
    value = value * x + *c;
  return value;
}

// Projection onto polynomials that are orthogonal over these samples, to avoid a badly conditioned
// matrix.
PaperSteps::Drift PaperSteps::fit(Real from_s, Real width_s,
                                  const std::vector<PaperSample>& samples,
                                  const std::vector<Real>& values) const {
  Drift result{from_s + width_s / 2, width_s / 2, {}};
  const auto size = static_cast<std::size_t>(order_) + 1;
  result.coefficient.assign(size, 0);
  std::vector<std::vector<Real>> basis;         // values at the samples
  std::vector<std::vector<Real>> coefficients;  // the same as powers of x
  std::vector<Real> rest = values;
  for (std::size_t i = 0; i < size; ++i) {
    std::vector<Real> at_samples;
    for (const PaperSample& sample : samples) {
      const Real x = (static_cast<Real>(sample.t_s) - result.centre_s) / result.half_width_s;
      at_samples.push_back(std::pow(x, static_cast<Real>(i)));
    }
    std::vector<Real> powers(size, 0);
    powers[i] = 1;
    const auto product = [](const std::vector<Real>& a, const std::vector<Real>& b) {
      Real sum = 0;
      for (std::size_t n = 0; n < a.size(); ++n)
        sum += a[n] * b[n];
      return sum;
    };
    for (int twice = 0; twice < 2; ++twice) {
      for (std::size_t j = 0; j < basis.size(); ++j) {
        const Real share = product(at_samples, basis[j]);
        for (std::size_t n = 0; n < samples.size(); ++n)
          at_samples[n] -= share * basis[j][n];
        for (std::size_t n = 0; n < size; ++n)
          powers[n] -= share * coefficients[j][n];
      }
    }
    const Real norm = std::sqrt(product(at_samples, at_samples));
    for (Real& value : at_samples)
      value /= norm;
    for (Real& power : powers)
      power /= norm;
    const Real share = product(rest, at_samples);
    for (std::size_t n = 0; n < samples.size(); ++n)
      rest[n] -= share * at_samples[n];
    for (std::size_t n = 0; n < size; ++n)
      result.coefficient[n] += share * powers[n];
    basis.push_back(std::move(at_samples));
    coefficients.push_back(std::move(powers));
  }
  return result;
}

PaperSteps::Window PaperSteps::window(double from_s, double width_s,
                                      const std::vector<PaperSample>& samples) {
  Window result;
  result.predicted = drift_;
  std::array<std::vector<Real>, 2> cross;
  for (const PaperSample& sample : samples) {
    const Real y1 = sample.rate_dps[0];
    const Real y2 = sample.rate_dps[1];
    const Real p1 = drift_[0].at(sample.t_s);
    const Real p2 = drift_[1].at(sample.t_s);
    const Real corrected1 = y1 - p1;
    const Real corrected2 = y2 - p2;
    const Real d1 = y1 - corrected2;
    const Real d2 = y2 - corrected1;
    cross[0].push_back(d1);
    cross[1].push_back(d2);
    const Real c1 = (p1 + d1) / 2;
    const Real c2 = (p2 + d2) / 2;
    result.virtual_dps.push_back(((y1 - c1) + (y2 - c2)) / 2);
    for (const Real value : {y1, y2, p1, p2, d1, d2})
      result.largest_dps = std::max(result.largest_dps, std::abs(value));
  }
  for (const std::size_t k : {0U, 1U})
    drift_[k] = fit(from_s, width_s, samples, cross[k]);
  result.renewed = drift_;
  return result;
}

}  // namespace vgyro::fusion
