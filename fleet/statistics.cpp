#include "fleet/statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace vgyro::fleet {

namespace {

// Of continued fractions: as good as doubles are.
constexpr int kTermsMax = 500;
constexpr double kSame = 1e-15;
constexpr double kTiny = 1e-300;

// Lentz's method, for the incomplete beta function.
double beta_fraction(double a, double b, double x) {
  const auto safe = [](double v) { return std::abs(v) < kTiny ? kTiny : v; };
  double c = 1.0;
  double d = 1.0 / safe(1.0 - (a + b) * x / (a + 1.0));
  double result = d;
  for (int m = 1; m < kTermsMax; ++m) {
    for (const bool even : {true, false}) {
      const double term = even ? m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
                               : -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
      d = 1.0 / safe(1.0 + term * d);
      c = safe(1.0 + term / c);
      result *= c * d;
      if (!even && std::abs(c * d - 1.0) < kSame) return result;
    }
  }
  return result;
}

double incomplete_beta(double a, double b, double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  const double front = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) +
                                a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1.0) / (a + b + 2.0)) return front * beta_fraction(a, b, x) / a;
  return 1.0 - front * beta_fraction(b, a, 1.0 - x) / b;
}

// Regularised upper incomplete gamma function.
double gamma_tail(double a, double x) {
  if (x <= 0.0) return 1.0;
  const double front = std::exp(a * std::log(x) - x - std::lgamma(a));
  if (x < a + 1.0) {
    double term = 1.0 / a;
    double sum = term;
    for (int n = 1; n < kTermsMax && term > sum * kSame; ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return std::max(0.0, 1.0 - front * sum);
  }
  double b = x + 1.0 - a;
  double c = 1.0 / kTiny;
  double d = 1.0 / b;
  double result = d;
  for (int n = 1; n < kTermsMax; ++n) {
    const double term = -n * (n - a);
    b += 2.0;
    d = 1.0 / (term * d + b);
    c = b + term / c;
    result *= c * d;
    if (std::abs(c * d - 1.0) < kSame) break;
  }
  return front * result;
}

double harmonic_number(double n) {
  // Exact to a millionth from 10 on, and never less.
  constexpr double kEuler = std::numbers::egamma;
  return std::log(n) + kEuler + 1.0 / (2.0 * n);
}

}  // namespace

double normal_tail(double z) {
  return std::erfc(std::abs(z) / std::numbers::sqrt2);
}

double student_tail(double t, double freedom) {
  return incomplete_beta(0.5 * freedom, 0.5, freedom / (freedom + t * t));
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
  return gamma_tail(0.5 * freedom, 0.5 * value);
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
