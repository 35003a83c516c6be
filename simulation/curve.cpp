#include "simulation/curve.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace vgyro::simulation {

namespace {

constexpr std::size_t kPointsMin = 6;
// A polynomial through much less even points swings between sparse ones.
constexpr double kUnevenMax = 1.5;
// How far the bulge of a polynomial through 6, 8, 10, 12 points may deviate from the curvature at
// both ends of its piece. The limits are just below the deviation at a kink (0.19, 0.27, 0.31,
// 0.34); a step has twice that, a sine of ten samples a period 0.08, of six 0.24.
constexpr std::array<double, 4> kOddMax{0.17, 0.24, 0.28, 0.30};

struct Polynomial {
  std::array<double, Curve::kPointsMax> c{};
  std::size_t size = 0;

  [[nodiscard]] std::span<const double> used() const { return {c.data(), size}; }
};

double evaluate(std::span<const double> c, double x) {
  double value = 0.0;
  for (std::size_t k = c.size(); k-- > 0;)
    value = value * x + c[k];
  return value;
}

double evaluate_slope(std::span<const double> c, double x) {
  double value = 0.0;
  for (std::size_t k = c.size(); k-- > 1;)
    value = value * x + static_cast<double>(k) * c[k];
  return value;
}

// Integral from -1/2, the beginning of the piece.
double evaluate_integral(std::span<const double> c, double x) {
  double here = 0.0;
  double begin = 0.0;
  for (std::size_t k = c.size(); k-- > 0;) {
    const double share = c[k] / static_cast<double>(k + 1);
    here = here * x + share;
    begin = begin * -0.5 + share;
  }
  return here * x + begin * 0.5;
}

// Newton's divided differences, expanded into powers.
Polynomial through(std::span<const double> x, std::span<const double> y) {
  const std::size_t n = x.size();
  std::array<double, Curve::kPointsMax> divided{};
  std::copy(y.begin(), y.end(), divided.begin());
  for (std::size_t level = 1; level < n; ++level) {
    for (std::size_t i = n; i-- > level;)
      divided[i] = (divided[i] - divided[i - 1]) / (x[i] - x[i - level]);
  }
  Polynomial p{.c = {}, .size = n};
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = n; k-- > 1;)
      p.c[k] = p.c[k - 1] - x[i] * p.c[k];
    p.c[0] = divided[i] - x[i] * p.c[0];
  }
  return p;
}

double chord(std::span<const double> t, std::span<const double> y, std::size_t i) {
  return (y[i + 1] - y[i]) / (t[i + 1] - t[i]);
}

// At an end: the slope of the parabola through three points, limited so that it does not turn back.
double end_tangent(double near_length, double far_length, double near, double far) {
  const double tangent =
      ((2.0 * near_length + far_length) * near - near_length * far) / (near_length + far_length);
  if (tangent * near <= 0.0) return 0.0;
  if (near * far <= 0.0 && std::abs(tangent) > 3.0 * std::abs(near)) return 3.0 * near;
  return tangent;
}

// Weighted harmonic means of the chords on both sides (Fritsch and Butland): no overshoot.
std::vector<double> monotone_tangents(std::span<const double> t, std::span<const double> y) {
  const std::size_t n = t.size();
  std::vector<double> tangents(n, 0.0);
  if (n == 2) tangents[0] = tangents[1] = chord(t, y, 0);
  if (n < 3) return tangents;
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double left = chord(t, y, i - 1);
    const double right = chord(t, y, i);
    if (left * right <= 0.0) continue;
    const double left_length = t[i] - t[i - 1];
    const double right_length = t[i + 1] - t[i];
    const double left_weight = 2.0 * right_length + left_length;
    const double right_weight = right_length + 2.0 * left_length;
    tangents[i] = (left_weight + right_weight) / (left_weight / left + right_weight / right);
  }
  tangents[0] = end_tangent(t[1] - t[0], t[2] - t[1], chord(t, y, 0), chord(t, y, 1));
  tangents[n - 1] =
      end_tangent(t[n - 1] - t[n - 2], t[n - 2] - t[n - 3], chord(t, y, n - 2), chord(t, y, n - 3));
  return tangents;
}

Polynomial monotone_piece(double length, double y0, double y1, double tangent0, double tangent1) {
  const double rise = y1 - y0;
  const double a = tangent0 * length;
  const double b = tangent1 * length;
  return {.c = {0.5 * (y0 + y1) + 0.125 * (a - b), 1.5 * rise - 0.25 * (a + b), 0.5 * (b - a),
                a + b - 2.0 * rise},
          .size = 4};
}

bool evenly_spaced(std::span<const double> t) {
  double shortest = t[1] - t[0];
  double longest = shortest;
  for (std::size_t i = 1; i + 1 < t.size(); ++i) {
    shortest = std::min(shortest, t[i + 1] - t[i]);
    longest = std::max(longest, t[i + 1] - t[i]);
  }
  return longest <= kUnevenMax * shortest;
}

double curvature(std::span<const double> t, std::span<const double> y, std::size_t i) {
  return 2.0 * (chord(t, y, i) - chord(t, y, i - 1)) / (t[i + 1] - t[i - 1]);
}

// The polynomial of piece i through as many points as are available; empty if they are too few or
// not smooth.
Polynomial smooth_piece(std::span<const double> t, std::span<const double> y, std::size_t i,
                        std::size_t points_max) {
  std::size_t half = std::min({points_max / 2, i + 1, t.size() - 1 - i});
  while (2 * half >= kPointsMin && !evenly_spaced(t.subspan(i + 1 - half, 2 * half)))
    --half;
  if (2 * half < kPointsMin) return {};
  const double length = t[i + 1] - t[i];
  const double middle = t[i] + 0.5 * length;
  std::array<double, Curve::kPointsMax> x{};
  for (std::size_t k = 0; k < 2 * half; ++k)
    x[k] = (t[i + 1 - half + k] - middle) / length;
  const Polynomial p = through({x.data(), 2 * half}, y.subspan(i + 1 - half, 2 * half));

  const double bulge = p.c[0] - 0.5 * (y[i] + y[i + 1]);
  const double before = curvature(t, y, i) * length * length / 16.0;
  const double after = curvature(t, y, i + 1) * length * length / 16.0;
  const double odd = std::abs(bulge + before + after);
  const double odd_max = kOddMax[half - kPointsMin / 2];
  return odd <= odd_max * (std::abs(before) + std::abs(after)) ? p : Polynomial{};
}

}  // namespace

struct Curve::Place {
  std::span<const double> coefficients;
  std::size_t piece;
  double length;
  double x;
};

Curve::Curve(std::span<const double> times_s, std::span<const double> values,
             std::size_t piece_points)
    : times_s_(times_s.begin(), times_s.end()), first_(values.front()), last_(values.back()) {
  assert(times_s.size() == values.size() && piece_points <= kPointsMax);
  const std::vector<double> tangents = monotone_tangents(times_s, values);
  begins_.push_back(0);
  integrals_.push_back(0.0);
  for (std::size_t i = 0; i + 1 < times_s_.size(); ++i)
    add_piece(i, values, tangents, piece_points);
}

void Curve::add_piece(std::size_t i, std::span<const double> values,
                      std::span<const double> tangents, std::size_t piece_points) {
  const double length = times_s_[i + 1] - times_s_[i];
  assert(length > 0.0);
  Polynomial piece = smooth_piece(times_s_, values, i, piece_points);
  if (piece.size == 0)
    piece = monotone_piece(length, values[i], values[i + 1], tangents[i], tangents[i + 1]);
  coefficients_.insert(coefficients_.end(), piece.used().begin(), piece.used().end());
  begins_.push_back(coefficients_.size());
  integrals_.push_back(integrals_.back() + length * evaluate_integral(piece.used(), 0.5));
}

// The sum of polynomials of a piece is a polynomial, so it is as exact as its parts.
Curve Curve::mixed(const Curve& like, std::span<const std::pair<double, const Curve*>> parts) {
  Curve sum;
  sum.times_s_ = like.times_s_;
  sum.begins_.push_back(0);
  sum.integrals_.push_back(0.0);
  for (const auto& [share, part] : parts) {
    assert(part->times_s_ == like.times_s_);
    sum.first_ += share * part->first_;
    sum.last_ += share * part->last_;
  }
  for (std::size_t i = 0; i + 1 < sum.times_s_.size(); ++i) {
    Polynomial piece{.c = {}, .size = 1};
    for (const auto& [share, part] : parts) {
      const std::size_t begin = part->begins_[i];
      piece.size = std::max(piece.size, part->begins_[i + 1] - begin);
      for (std::size_t k = 0; begin + k < part->begins_[i + 1]; ++k)
        piece.c[k] += share * part->coefficients_[begin + k];
    }
    sum.coefficients_.insert(sum.coefficients_.end(), piece.used().begin(), piece.used().end());
    sum.begins_.push_back(sum.coefficients_.size());
    const double length = sum.times_s_[i + 1] - sum.times_s_[i];
    sum.integrals_.push_back(sum.integrals_.back() + length * evaluate_integral(piece.used(), 0.5));
  }
  return sum;
}

// Precondition: first point <= t <= last point, and there are at least two points.
Curve::Place Curve::find(double t_s) const {
  const auto after = std::upper_bound(times_s_.begin() + 1, times_s_.end() - 1, t_s);
  const auto piece = static_cast<std::size_t>(after - times_s_.begin()) - 1;
  const double length = times_s_[piece + 1] - times_s_[piece];
  return {{coefficients_.data() + begins_[piece], begins_[piece + 1] - begins_[piece]},
          piece,
          length,
          (t_s - times_s_[piece]) / length - 0.5};
}

double Curve::value(double t_s) const {
  if (times_s_.empty() || t_s <= times_s_.front()) return first_;
  if (t_s >= times_s_.back()) return last_;
  const Place at = find(t_s);
  return evaluate(at.coefficients, at.x);
}

double Curve::slope(double t_s) const {
  const bool inside = times_s_.size() > 1 && t_s >= times_s_.front() && t_s <= times_s_.back();
  if (!inside) return 0.0;
  const Place at = find(t_s);
  return evaluate_slope(at.coefficients, at.x) / at.length;
}

double Curve::integral(double t_s) const {
  if (times_s_.empty()) return 0.0;
  if (t_s <= times_s_.front()) return first_ * (t_s - times_s_.front());
  if (t_s >= times_s_.back()) return integrals_.back() + last_ * (t_s - times_s_.back());
  const Place at = find(t_s);
  return integrals_[at.piece] + at.length * evaluate_integral(at.coefficients, at.x);
}

}  // namespace vgyro::simulation
