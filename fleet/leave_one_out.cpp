#include "fleet/leave_one_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace vgyro::fleet {

namespace {

// If a unit has a larger share of a sum than this, the others are summed anew, because subtracting
// it from the sum would lose digits. For each sum, at most 1/share units have so much.
constexpr double kShareMost = 0.01;

/// Sums over units of weights and weighted values, with the weight 1/(σ² + between²).
struct Sums {
  double w = 0.0;
  double ww = 0.0;
  double wy = 0.0;
  double wyy = 0.0;

  void add(double weight, double value) {
    w += weight;
    ww += weight * weight;
    wy += weight * value;
    wyy += weight * value * value;
  }
  /// Nothing if the unit's share is too large.
  [[nodiscard]] std::optional<Sums> without(double weight, double value) const {
    const double square = weight * value * value;
    if (weight > kShareMost * w || weight * weight > kShareMost * ww || square > kShareMost * wyy)
      return std::nullopt;
    return Sums{w - weight, ww - weight * weight, wy - weight * value, wyy - square};
  }
  [[nodiscard]] double scatter() const { return wyy - wy * wy / w; }
};

/// Interpolates the sums as functions of between², from their values at the Chebyshev points of
/// log(between² + least σ²). As functions of that logarithm, their poles are at least π away from
/// the real axis, so the number of points for full precision follows from the range alone.
class SumsCurve {
 public:
  SumsCurve(const std::vector<Estimate>& centred, double low, double high)
      : least_(least_variance(centred)) {
    middle_ = 0.5 * (log_of(high) + log_of(low));
    half_ = 0.5 * (log_of(high) - log_of(low));
    const std::size_t count = points_for(half_);
    for (std::size_t k = 0; k < count; ++k) {
      const double angle =
          (static_cast<double>(k) + 0.5) * std::numbers::pi / static_cast<double>(count);
      x_.push_back(std::cos(angle));
      weight_.push_back((k % 2 == 0 ? 1.0 : -1.0) * std::sin(angle));
      const double between = std::exp(middle_ + half_ * x_.back()) - least_;
      Sums& sums = at_.emplace_back();
      for (const Estimate& unit : centred)
        sums.add(1.0 / (unit.sigma * unit.sigma + between), unit.value);
    }
  }

  [[nodiscard]] Sums at(double between) const {
    const double x = half_ > 0.0 ? (log_of(between) - middle_) / half_ : 0.0;
    Sums sum;
    double whole = 0.0;
    for (std::size_t k = 0; k < x_.size(); ++k) {
      if (x == x_[k]) return at_[k];
      const double share = weight_[k] / (x - x_[k]);
      whole += share;
      sum.w += share * at_[k].w;
      sum.ww += share * at_[k].ww;
      sum.wy += share * at_[k].wy;
      sum.wyy += share * at_[k].wyy;
    }
    return {sum.w / whole, sum.ww / whole, sum.wy / whole, sum.wyy / whole};
  }

 private:
  static double least_variance(const std::vector<Estimate>& units) {
    double least = std::numeric_limits<double>::infinity();
    for (const Estimate& unit : units)
      least = std::min(least, unit.sigma * unit.sigma);
    return least;
  }
  [[nodiscard]] double log_of(double between) const { return std::log(between + least_); }
  // The error falls as a power of the sum of the half axes of the largest ellipse without a pole.
  static std::size_t points_for(double half) {
    constexpr double kOfPole = 0.75;  // stays away from the pole, where the sums are large
    constexpr double kError = 1e-16;
    constexpr double kMore = 2.0;
    const double axis = kOfPole * std::numbers::pi / std::max(half, 1e-9);
    return static_cast<std::size_t>(
        std::ceil(-std::log(kError) / std::log(axis + std::hypot(1.0, axis))) + kMore);
  }

  double least_;
  double middle_ = 0.0;
  double half_ = 0.0;
  std::vector<double> x_;
  std::vector<double> weight_;
  std::vector<Sums> at_;
};

RandomEffects summed_anew(const std::vector<Estimate>& units, std::size_t without) {
  std::vector<Estimate> others;
  others.reserve(units.size());
  for (std::size_t i = 0; i < units.size(); ++i)
    if (i != without) others.push_back(units[i]);
  return random_effects(others);
}

/// Values relative to `centre`, the mean weighted by 1/σ²: their sums are small, so differences of
/// squares lose no digits.
std::vector<Estimate> centred(const std::vector<Estimate>& units, double centre) {
  std::vector<Estimate> moved = units;
  for (Estimate& unit : moved)
    unit.value -= centre;
  return moved;
}

double mean_of(const std::vector<Estimate>& units) {
  Sums sums;
  for (const Estimate& unit : units)
    sums.add(1.0 / (unit.sigma * unit.sigma), unit.value);
  return sums.wy / sums.w;
}

/// Spread of all units but one.
struct Others {
  double between2 = 0.0;
  double q = 0.0;
  bool anew = false;
};

// DerSimonian and Laird's spread of all units but one, for each unit in turn.
std::vector<Others> spreads_of_others(const std::vector<Estimate>& units, double freedom) {
  Sums all;
  for (const Estimate& unit : units)
    all.add(1.0 / (unit.sigma * unit.sigma), unit.value);
  std::vector<Others> others(units.size());
  for (std::size_t i = 0; i < units.size(); ++i) {
    const auto left = all.without(1.0 / (units[i].sigma * units[i].sigma), units[i].value);
    others[i].anew = !left;
    if (!left) continue;
    const double share = left->w - left->ww / left->w;
    others[i].q = left->scatter();
    if (share > 0.0) others[i].between2 = std::max(0.0, (others[i].q - freedom) / share);
  }
  return others;
}

}  // namespace

std::vector<RandomEffects> random_effects_of_others(const std::vector<Estimate>& units) {
  std::vector<RandomEffects> result(units.size());
  std::vector<Others> others(units.size(), {0.0, 0.0, true});
  const double freedom = static_cast<double>(units.size()) - 2.0;
  std::optional<SumsCurve> curve;
  std::vector<Estimate> moved;
  double centre = 0.0;
  if (units.size() > kDirectMost) {
    centre = mean_of(units);
    moved = centred(units, centre);
    others = spreads_of_others(moved, freedom);
    double low = std::numeric_limits<double>::infinity();
    double high = 0.0;
    for (const Others& one : others) {
      if (one.anew) continue;
      low = std::min(low, one.between2);
      high = std::max(high, one.between2);
    }
    if (low <= high) curve.emplace(moved, low, high);
  }
  for (std::size_t i = 0; i < units.size(); ++i) {
    std::optional<Sums> left;
    if (!others[i].anew) {
      left = curve->at(others[i].between2)
                 .without(1.0 / (moved[i].sigma * moved[i].sigma + others[i].between2),
                          moved[i].value);
    }
    if (!left) {
      result[i] = summed_anew(units, i);
      continue;
    }
    const double knapp_hartung = std::max(1.0, left->scatter() / freedom);
    result[i].mean = centre + left->wy / left->w;
    result[i].sigma = std::sqrt(knapp_hartung / left->w);
    result[i].between = std::sqrt(others[i].between2);
    result[i].between_sigma = std::sqrt((freedom + 1.0) / left->w / (2.0 * freedom));
    result[i].freedom = freedom;
    result[i].q = others[i].q;
  }
  return result;
}

}  // namespace vgyro::fleet
