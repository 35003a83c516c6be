#pragma once

// Least-squares fit of a polynomial to samples that are seen once and not stored: each sample adds
// to 3·order + 2 sums, the fit solves one small system. Error of a fitted value at the window's
// centre in white noise σ over n samples: σ/√n (order 0 and 1).

#include <array>
#include <cstdint>
#include <optional>

#include "fusion/polynomial.h"

namespace vgyro::fusion {

class LeastSquares {
 public:
  /// Order 0…kOrderMax; the window is [from_s, from_s + width_s), width_s > 0.
  LeastSquares(int order, double from_s, double width_s);

  void add(double t_s, double value) {
    const double x = (t_s - centre_s_) * inverse_half_width_;
    if (count_ == 0 || x < x_min_) x_min_ = x;
    if (count_ == 0 || x > x_max_) x_max_ = x;
    ++count_;
    double power = 1.0;
    for (int i = 0; i <= order_; ++i) {
      moments_[static_cast<std::size_t>(i)] += power;
      products_[static_cast<std::size_t>(i)] += power * value;
      power *= x;
    }
    for (int i = order_ + 1; i <= 2 * order_; ++i) {
      moments_[static_cast<std::size_t>(i)] += power;
      power *= x;
    }
    squares_ += value * value;
  }

  [[nodiscard]] std::uint64_t count() const { return count_; }

  struct Fit {
    Polynomial polynomial;
    double residual_variance = 0.0;  ///< of the samples about the fit
  };
  /// Nothing when the samples cannot carry the order: fewer than twice its coefficients, or
  /// covering less than half of the window.
  [[nodiscard]] std::optional<Fit> fit() const;

 private:
  int order_;
  double centre_s_;
  double half_width_s_;
  double inverse_half_width_;
  std::uint64_t count_ = 0;
  double x_min_ = 0.0;
  double x_max_ = 0.0;
  double squares_ = 0.0;
  std::array<double, 2 * kOrderMax + 1> moments_{};  ///< Σ xⁱ
  std::array<double, kOrderMax + 1> products_{};     ///< Σ xⁱ·value
};

}  // namespace vgyro::fusion
