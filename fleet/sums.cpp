#include "fleet/sums.h"

namespace vgyro::fleet {

namespace {

// In years²: drives of one day show no trend.
constexpr double kTimeSquareMin = 1e-5;

double cross(const Moments& m) {
  return value_of(m.xt) - m.mean() * value_of(m.t);
}

}  // namespace

bool Moments::has_line() const {
  return count >= 3 && time_square() >= kTimeSquareMin;
}

double Moments::variance_about_line() const {
  if (!has_line()) return variance();
  const double about_line = variance() * (n() - 1.0) - slope() * cross(*this);
  return about_line > 0.0 ? about_line / (n() - 2.0) : 0.0;
}

double Moments::slope() const {
  return has_line() ? cross(*this) / time_square() : 0.0;
}

double Moments::slope_sigma() const {
  return has_line() ? std::sqrt(variance_about_line() / time_square()) : 0.0;
}

}  // namespace vgyro::fleet
