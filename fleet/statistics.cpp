#include "fleet/statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <unsupported/Eigen/SpecialFunctions>

namespace vgyro::fleet {

namespace {

double harmonic_number(double n) {
  // Never too small; from 10 on, too large by less than 1e-3.
  constexpr double kEuler = std::numbers::egamma;
  return std::log(n) + kEuler + 1.0 / (2.0 * n);
}

}  // namespace

double normal_tail(double z) {
  return std::erfc(std::abs(z) / std::numbers::sqrt2);
}

double student_tail(double t, double freedom) {
  return Eigen::numext::betainc(0.5 * freedom, 0.5, freedom / (freedom + t * t));
}

double student_quantile(double tail, double freedom) {
  double low = 0.0;
  double high = 1.0;
  while (student_tail(high, freedom) > tail)
    high *= 2.0;
  constexpr int kHalvings = 60;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (student_tail(middle, freedom) > tail ? low : high) = middle;
  }
  return high;
}

double chi_square_tail(double value, double freedom) {
  return Eigen::numext::igammac(0.5 * freedom, 0.5 * value);
}

double binomial_tail(std::size_t successes, std::size_t trials, double share) {
  if (successes == 0) return 1.0;
  const auto k = static_cast<double>(successes);
  return Eigen::numext::betainc(k, static_cast<double>(trials) - k + 1.0, share);
}

double threshold_of(std::size_t rank, double tests, double rate) {
  return rate * static_cast<double>(rank) / (tests * harmonic_number(std::max(tests, 1.0)));
}

std::vector<bool> named_of(const std::vector<double>& p, double tests, double rate) {
  std::vector<std::size_t> order(p.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return p[a] < p[b]; });
  std::size_t names = 0;
  for (std::size_t rank = 1; rank <= order.size(); ++rank) {
    if (p[order[rank - 1]] <= threshold_of(rank, tests, rate)) names = rank;
  }
  std::vector<bool> named(p.size(), false);
  for (std::size_t i = 0; i < names; ++i)
    named[order[i]] = true;
  return named;
}

double RandomEffects::half_width95() const {
  constexpr double kTail = 0.05;
  constexpr double kNormal95 = 1.959964;
  return sigma * (freedom > 0.0 ? student_quantile(kTail, freedom) : kNormal95);
}

RandomEffects random_effects(const std::vector<Estimate>& units) {
  RandomEffects result;
  double w = 0.0;
  double ww = 0.0;
  double wy = 0.0;
  for (const Estimate& unit : units) {
    const double weight = 1.0 / (unit.sigma * unit.sigma);
    w += weight;
    ww += weight * weight;
    wy += weight * unit.value;
  }
  if (units.empty()) return result;
  const double fixed = wy / w;
  const double freedom = static_cast<double>(units.size()) - 1.0;
  for (const Estimate& unit : units)
    result.q += std::pow((unit.value - fixed) / unit.sigma, 2);
  const double share = w - ww / w;
  const double between = share > 0.0 ? std::max(0.0, (result.q - freedom) / share) : 0.0;
  double v = 0.0;
  double vy = 0.0;
  for (const Estimate& unit : units) {
    const double weight = 1.0 / (unit.sigma * unit.sigma + between);
    v += weight;
    vy += weight * unit.value;
  }
  result.mean = vy / v;
  double scatter = 0.0;
  for (const Estimate& unit : units)
    scatter += std::pow(unit.value - result.mean, 2) / (unit.sigma * unit.sigma + between);
  const double knapp_hartung = freedom > 0.0 ? std::max(1.0, scatter / freedom) : 1.0;
  result.sigma = std::sqrt(knapp_hartung / v);
  result.between = std::sqrt(between);
  if (freedom > 0.0) {
    const double unit_variance = static_cast<double>(units.size()) / v;
    result.between_sigma = std::sqrt(unit_variance / (2.0 * freedom));
  }
  result.freedom = freedom;
  return result;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

}  // namespace vgyro::fleet
