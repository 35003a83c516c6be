#include "gap/curve.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "gap/median.h"

namespace vgyro::gap {

SampledCurve::SampledCurve(std::span<const double> t_s, std::span<const double> value) {
  t_s_.reserve(t_s.size());
  value_.reserve(t_s.size());
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    if (!t_s_.empty() && t_s[i] <= t_s_.back()) continue;
    t_s_.push_back(t_s[i]);
    value_.push_back(value[i]);
  }
  if (t_s_.size() < 2) return;
  std::vector<double> steps_s(t_s_.size() - 1);
  for (std::size_t i = 0; i + 1 < t_s_.size(); ++i)
    steps_s[i] = t_s_[i + 1] - t_s_[i];
  interval_s_ = median_of(steps_s);
  set_weights();
}

std::size_t SampledCurve::index_before(double t_s) const {
  // Even sampling: the place is nearly known.
  const double place = (t_s - t_s_.front()) / interval_s_;
  auto i = static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(t_s_.size() - 2)));
  if (t_s_[i] <= t_s && t_s < t_s_[i + 1]) return i;
  const auto after = std::upper_bound(t_s_.begin(), t_s_.end(), t_s);
  const auto index = static_cast<std::size_t>(after - t_s_.begin());
  return std::clamp<std::size_t>(index, 1, t_s_.size() - 1) - 1;
}

// The first of the points about an instant.
std::size_t SampledCurve::first_about(double t_s) const {
  const std::size_t count = std::min(kPoints, t_s_.size());
  const std::size_t before = index_before(t_s);
  const std::size_t first = before + 1 > count / 2 ? before + 1 - count / 2 : 0;
  return std::min(first, t_s_.size() - count);
}

// Lagrange's polynomials; times in intervals keep the products small.
SampledCurve::Point SampledCurve::at(double t_s) const {
  if (t_s <= t_s_.front()) return {value_.front(), 0.0};
  if (t_s >= t_s_.back()) return {value_.back(), 0.0};
  const std::size_t count = std::min(kPoints, t_s_.size());
  const std::size_t first = first_about(t_s);
  std::array<double, kPoints> x{};
  for (std::size_t i = 0; i < count; ++i)
    x[i] = (t_s - t_s_[first + i]) / interval_s_;
  const double* weight = &weights_[kPoints * first];
  Point point{0.0, 0.0};
  for (std::size_t i = 0; i < count; ++i) {
    double product = weight[i];
    double slope = 0.0;
    for (std::size_t j = 0; j < count; ++j) {
      if (j == i) continue;
      slope = slope * x[j] + product;
      product *= x[j];
    }
    const double value = value_[first + i];
    point.value += product * value;
    point.slope += slope * value;
  }
  point.slope /= interval_s_;
  return point;
}

SampledCurve::Weights SampledCurve::weights_at(double t_s) const {
  Weights weights;
  const std::size_t count = std::min(kPoints, t_s_.size());
  if (t_s <= t_s_.front()) {
    weights.value[0] = 1.0;
    return weights;
  }
  if (t_s >= t_s_.back()) {
    weights.first = t_s_.size() - count;
    weights.value[count - 1] = 1.0;
    return weights;
  }
  weights.first = first_about(t_s);
  for (std::size_t i = 0; i < count; ++i) {
    weights.value[i] = weights_[kPoints * weights.first + i];
    for (std::size_t j = 0; j < count; ++j) {
      if (j != i) weights.value[i] *= (t_s - t_s_[weights.first + j]) / interval_s_;
    }
  }
  return weights;
}

// 1/Π (x_i − x_j) of the points from each place on.
void SampledCurve::set_weights() {
  const std::size_t count = std::min(kPoints, t_s_.size());
  const std::size_t places = t_s_.size() - count + 1;
  weights_.assign(kPoints * places, 0.0);
  for (std::size_t first = 0; first < places; ++first) {
    for (std::size_t i = 0; i < count; ++i) {
      double product = 1.0;
      for (std::size_t j = 0; j < count; ++j) {
        if (j != i) product *= (t_s_[first + i] - t_s_[first + j]) / interval_s_;
      }
      weights_[kPoints * first + i] = 1.0 / product;
    }
  }
}

double SampledCurve::linear(double t_s) const {
  if (t_s <= t_s_.front()) return value_.front();
  if (t_s >= t_s_.back()) return value_.back();
  const std::size_t i = index_before(t_s);
  const double share = (t_s - t_s_[i]) / (t_s_[i + 1] - t_s_[i]);
  return value_[i] + share * (value_[i + 1] - value_[i]);
}

bool SampledCurve::hole_at(double t_s, double reach_s) const {
  if (empty() || t_s < from_s() - reach_s || t_s > to_s() + reach_s) return true;
  if (t_s <= from_s() || t_s >= to_s()) return false;
  const std::size_t before = index_before(t_s);
  return t_s_[before + 1] - t_s_[before] > 2.0 * reach_s;
}

}  // namespace vgyro::gap
