#include "fleet/sums.h"

namespace vgyro::fleet {

namespace {

// Years squared: drives of one day tell no trend.
constexpr double kTimeSquareMin = 1e-5;

double cross(const Moments& m) {
  return value_of(m.xt) - m.mean() * value_of(m.t);
}

}  // namespace

double Moments::slope() const {
  return count < 3 || time_square() < kTimeSquareMin ? 0.0 : cross(*this) / time_square();
}

double Moments::slope_sigma() const {
  if (count < 3 || time_square() < kTimeSquareMin) return 0.0;
  const double about_line = variance() * (n() - 1.0) - slope() * cross(*this);
  return about_line > 0.0 ? std::sqrt(about_line / (n() - 2.0) / time_square()) : 0.0;
}

}  // namespace vgyro::fleet
