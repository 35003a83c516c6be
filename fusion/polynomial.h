#pragma once

// A drift as a polynomial of time. The argument is centred and scaled, x = (t − centre) / half
// width, so that on the window it was fitted to |x| ≤ 1 and no coefficient loses digits.

#include <array>
#include <cstddef>

namespace vgyro::fusion {

inline constexpr int kOrderMax = 3;

struct Polynomial {
  double centre_s = 0.0;
  double half_width_s = 1.0;
  std::array<double, kOrderMax + 1> coefficient{};  ///< of x⁰, x¹, x², x³

  [[nodiscard]] double at(double t_s) const {
    const double x = (t_s - centre_s) / half_width_s;
    return coefficient[0] + x * (coefficient[1] + x * (coefficient[2] + x * coefficient[3]));
  }
  /// Derivative, in the polynomial's unit per second.
  [[nodiscard]] double slope_at(double t_s) const;
};

}  // namespace vgyro::fusion
