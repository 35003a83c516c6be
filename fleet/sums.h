#pragma once

// Sums that are the same to the last bit in any order and grouping: each value is rounded once to a
// whole number of fixed steps, and whole numbers add exactly.

#include <cmath>
#include <cstdint>

namespace vgyro::fleet {

__extension__ typedef __int128 Whole;  // NOLINT(modernize-use-using): the extension needs it

/// Steps of 2^-20, for values in units of which 1 matters.
inline constexpr double kStepsPerUnit = 1048576.0;
/// A million million of these fit into a Whole; no drive has a value near this.
inline constexpr double kValueMost = 1e18;

/// Greatest number of steps that is converted in 64 bits.
inline constexpr double kShortMost = 9e18;

/// Precondition: |value| ≤ kValueMost.
inline Whole whole_of(double value) {
  const double steps = value * kStepsPerUnit;
  // The same number by one instruction; a conversion to 128 bits calls a function.
  if (std::abs(steps) < kShortMost) return std::llrint(steps);
  return static_cast<Whole>(std::nearbyint(steps));
}
inline double value_of(Whole sum) {
  const auto low = static_cast<std::int64_t>(sum);
  return (low == sum ? static_cast<double>(low) : static_cast<double>(sum)) / kStepsPerUnit;
}

/// Sums of a quantity x measured at times t, for its mean, its scatter and the line through it.
struct Moments {
  Whole count = 0;
  Whole x = 0;
  Whole xx = 0;
  Whole t = 0;
  Whole tt = 0;
  Whole xt = 0;

  void add(double value, double t_years) {
    count += 1;
    x += whole_of(value);
    xx += whole_of(value * value);
    t += whole_of(t_years);
    tt += whole_of(t_years * t_years);
    xt += whole_of(value * t_years);
  }
  void add(const Moments& more) {
    count += more.count;
    x += more.x;
    xx += more.xx;
    t += more.t;
    tt += more.tt;
    xt += more.xt;
  }
  [[nodiscard]] double n() const { return static_cast<double>(count); }
  [[nodiscard]] double mean() const { return value_of(x) / n(); }
  /// Variance of single values; 0 if there are fewer than two.
  [[nodiscard]] double variance() const {
    if (count < 2) return 0.0;
    const double square = value_of(xx) - mean() * value_of(x);
    return square > 0.0 ? square / (n() - 1.0) : 0.0;
  }
  [[nodiscard]] double time_square() const {
    return value_of(tt) - value_of(t) * value_of(t) / n();
  }
  /// Variance of single values about the line, and its degrees of freedom; about the mean if there
  /// is no line.
  [[nodiscard]] double variance_about_line() const;
  [[nodiscard]] double freedom_about_line() const { return n() - (has_line() ? 2.0 : 1.0); }
  /// Whether there are enough drives, and not all at one time.
  [[nodiscard]] bool has_line() const;
  /// Per year; 0 if there is no line.
  [[nodiscard]] double slope() const;
  /// 1σ of the slope, from the scatter about the line.
  [[nodiscard]] double slope_sigma() const;
};

}  // namespace vgyro::fleet
