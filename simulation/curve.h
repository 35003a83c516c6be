#pragma once

// A smooth curve through points of increasing time: value, slope and integral of the same pieces,
// so that a rate, its delayed copy and its angle agree to the last digits. Passes through every
// point. If the points are smooth and evenly spaced, a piece is the polynomial through the points
// on both sides of it; next to steps and kinks, where such a polynomial would ring, it is a
// monotone cubic. docs/simulate.md has the figures. Before the first point and after the last the
// value is constant.

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace vgyro::simulation {

class Curve {
 public:
  static constexpr std::size_t kPointsMax = 12;

  /// A curve that is 0 everywhere.
  Curve() = default;
  /// Each piece uses up to `piece_points` points, an even number up to kPointsMax. Precondition: as
  /// many values as times, at least one, finite, times increasing.
  Curve(std::span<const double> times_s, std::span<const double> values,
        std::size_t piece_points = kPointsMax);

  /// The sum of `part.first` times `part.second` over all parts. Precondition: all have the same
  /// points as `like`.
  static Curve mixed(const Curve& like, std::span<const std::pair<double, const Curve*>> parts);

  [[nodiscard]] double value(double t_s) const;
  [[nodiscard]] double slope(double t_s) const;
  /// Integral from the first point to t; negative before it.
  [[nodiscard]] double integral(double t_s) const;

  /// The ends of the pieces.
  [[nodiscard]] std::span<const double> times_s() const { return times_s_; }

 private:
  struct Place;

  void add_piece(std::size_t i, std::span<const double> values, std::span<const double> tangents,
                 std::size_t piece_points);
  [[nodiscard]] Place find(double t_s) const;

  std::vector<double> times_s_;
  double first_ = 0.0;
  double last_ = 0.0;
  // Piece i is a polynomial in x = (t - its middle) / its length, lowest power first.
  std::vector<double> coefficients_;
  std::vector<std::size_t> begins_;  ///< of each piece in coefficients_, and the end of the last
  std::vector<double> integrals_;    ///< from the first point to point i
};

}  // namespace vgyro::simulation
