#include "fusion/polynomial.h"

namespace vgyro::fusion {

double Polynomial::slope_at(double t_s) const {
  const double x = (t_s - centre_s) / half_width_s;
  return (coefficient[1] + x * (2.0 * coefficient[2] + x * 3.0 * coefficient[3])) / half_width_s;
}

}  // namespace vgyro::fusion
