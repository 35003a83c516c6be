#include "gap/curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

// Kaiser's window of 80 dB: with 32 points the sinc is flat up to 0.42 of the sampling rate.
constexpr double kKaiser = 8.0;
// Weights are kept for so many places between two samples, and are straight between these: an error
// of 5e-7.
constexpr std::size_t kPhases = 512;
// Polynomials up to the fifth degree pass unchanged: a turn is large and slow.
constexpr int kMoments = 6;
// A step that is further from the median than this share of it is uneven.
constexpr double kUneven = 0.02;
// So many intervals for each sample are few enough to have a place each: with longer gaps places
// are looked for.
constexpr double kPlacesMost = 20.0;

double bessel_i0(double x) {
  double sum = 1.0;
  double term = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= (0.5 * x / k) * (0.5 * x / k);
    sum += term;
  }
  return sum;
}

// sinc times window at `x` samples from the middle, and its slope.
std::array<double, 2> windowed_sinc(double x) {
  const auto value = [](double at) {
    const double share = at / static_cast<double>(SampledCurve::kReach);
    if (std::abs(share) >= 1.0) return 0.0;
    const double angle = std::numbers::pi * at;
    const double sinc = std::abs(angle) < 1e-8 ? 1.0 : std::sin(angle) / angle;
    return sinc * bessel_i0(kKaiser * std::sqrt(1.0 - share * share)) / bessel_i0(kKaiser);
  };
  constexpr double kStep = 1e-5;
  return {value(x), (value(x + kStep) - value(x - kStep)) / (2.0 * kStep)};
}

using Row = std::array<double, SampledCurve::kPointsMax>;

// The least change that makes Σ weight·place^k what it is for a polynomial: `moments`.
void correct(Row& row, double phase, const Eigen::Matrix<double, kMoments, 1>& moments) {
  constexpr auto kCount = static_cast<Eigen::Index>(SampledCurve::kPointsMax);
  Eigen::Matrix<double, kCount, kMoments> powers;
  for (Eigen::Index i = 0; i < kCount; ++i) {
    const double x = (static_cast<double>(i) - (SampledCurve::kReach - 1) - phase) /
                     static_cast<double>(SampledCurve::kReach);
    double power = 1.0;
    for (int k = 0; k < kMoments; ++k, power *= x)
      powers(i, k) = power;
  }
  Eigen::Map<Eigen::Matrix<double, kCount, 1>> weights(row.data());
  const Eigen::Matrix<double, kMoments, kMoments> gram = powers.transpose() * powers;
  weights += powers * gram.ldlt().solve(moments - powers.transpose() * weights);
}

struct Table {
  std::array<Row, kPhases + 1> value{};
  std::array<Row, kPhases + 1> slope{};
};

Table make_table() {
  Table table;
  for (std::size_t p = 0; p <= kPhases; ++p) {
    const double phase = static_cast<double>(p) / kPhases;
    for (std::size_t i = 0; i < SampledCurve::kPointsMax; ++i) {
      const double x = phase + (SampledCurve::kReach - 1) - static_cast<double>(i);
      const auto [value, slope] = windowed_sinc(x);
      table.value[p][i] = value;
      table.slope[p][i] = slope;
    }
    // About the place itself: 1 is 1 there, and of all powers only the first has a slope.
    Eigen::Matrix<double, kMoments, 1> moments = Eigen::Matrix<double, kMoments, 1>::Zero();
    moments[0] = 1.0;
    correct(table.value[p], phase, moments);
    moments[0] = 0.0;
    moments[1] = 1.0 / static_cast<double>(SampledCurve::kReach);
    correct(table.slope[p], phase, moments);
  }
  return table;
}

const Table& table() {
  static const Table kTable = make_table();
  return kTable;
}

// Lagrange's weights 1/Π (x_i − x_j) of the points at `x`.
std::array<double, SampledCurve::kPoints> lagrange_weights(
    const std::array<double, SampledCurve::kPoints>& x, std::size_t count) {
  std::array<double, SampledCurve::kPoints> weights{};
  for (std::size_t i = 0; i < count; ++i) {
    double product = 1.0;
    for (std::size_t j = 0; j < count; ++j)
      if (j != i) product *= x[j] - x[i];
    weights[i] = 1.0 / product;
  }
  return weights;
}

// Between two rows of the table.
struct Place {
  std::size_t row = 0;
  double share = 0.0;
};
Place place_of(double phase) {
  const double at = std::clamp(phase, 0.0, 1.0) * kPhases;
  const auto row = std::min(static_cast<std::size_t>(at), kPhases - 1);
  return {row, at - static_cast<double>(row)};
}

double product(const Row& a, const Row& b, double share, const double* values) {
  using Points = Eigen::Array<double, SampledCurve::kPointsMax, 1>;
  const Eigen::Map<const Points> first(a.data());
  const Eigen::Map<const Points> second(b.data());
  return ((first + share * (second - first)) * Eigen::Map<const Points>(values)).sum();
}

}  // namespace

const std::shared_ptr<const SampledCurve::Times>& SampledCurve::no_times() {
  static const auto kNone = std::make_shared<const Times>();
  return kNone;
}

SampledCurve::SampledCurve(std::span<const double> t_s, std::span<const double> value) {
  auto times = std::make_shared<Times>();
  times->t_s.reserve(t_s.size());
  value_.reserve(t_s.size());
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    if (!times->t_s.empty() && t_s[i] <= times->t_s.back()) continue;
    times->t_s.push_back(t_s[i]);
    value_.push_back(value[i]);
  }
  if (value_.size() > 1) times->measure_steps();
  times_ = std::move(times);
}

SampledCurve SampledCurve::with_values(std::vector<double> value) const {
  SampledCurve other;
  other.times_ = times_;
  other.value_ = std::move(value);
  return other;
}

std::size_t SampledCurve::index_before(double t_s) const {
  const std::vector<double>& times_s = times_->t_s;
  if (t_s <= times_s.front()) return 0;
  if (t_s >= times_s.back()) return times_s.size() - 2;
  if (times_->places.empty()) {
    const auto after = std::upper_bound(times_s.begin(), times_s.end(), t_s);
    return static_cast<std::size_t>(after - times_s.begin()) - 1;
  }
  const double place = (t_s - times_s.front()) / times_->interval_s;
  const auto slot = std::min(static_cast<std::size_t>(place), times_->places.size() - 1);
  std::size_t i = times_->places[slot];
  while (times_s[i] > t_s)
    --i;
  while (times_s[i + 1] <= t_s)
    ++i;
  return i;
}

// A sample from which the one before an instant is a step or two away, after gaps too.
void SampledCurve::Times::set_places() {
  const double intervals = (t_s.back() - t_s.front()) / interval_s;
  if (intervals > kPlacesMost * static_cast<double>(t_s.size())) return;
  places.resize(static_cast<std::size_t>(intervals) + 1);
  std::size_t i = 0;
  for (std::size_t slot = 0; slot < places.size(); ++slot) {
    const double begins_s = t_s.front() + interval_s * static_cast<double>(slot);
    while (i + 2 < t_s.size() && t_s[i + 1] <= begins_s)
      ++i;
    places[slot] = static_cast<std::uint32_t>(i);
  }
}

// The first of the points about an instant.
std::size_t SampledCurve::first_about(double t_s) const {
  const std::size_t count = std::min(kPoints, times_->t_s.size());
  const std::size_t before = index_before(t_s);
  const std::size_t first = before + 1 > count / 2 ? before + 1 - count / 2 : 0;
  return std::min(first, times_->t_s.size() - count);
}

void SampledCurve::Times::measure_steps() {
  std::vector<double> steps_s(t_s.size() - 1);
  for (std::size_t i = 0; i + 1 < t_s.size(); ++i)
    steps_s[i] = t_s[i + 1] - t_s[i];
  interval_s = median_of(steps_s);
  even_steps.assign(t_s.size(), 0);
  for (std::size_t i = 1; i < t_s.size(); ++i) {
    const double step_s = t_s[i] - t_s[i - 1];
    const bool even = std::abs(step_s - interval_s) <= kUneven * interval_s;
    const int led = even_steps[i - 1] + 1;
    even_steps[i] = even ? static_cast<std::uint8_t>(std::min<int>(led, kPointsMax)) : 0;
  }
  set_places();
}

bool SampledCurve::is_even_about(std::size_t before) const {
  const std::size_t last = before + kReach;
  return before + 1 >= kReach && last < times_->t_s.size() &&
         times_->even_steps[last] >= kPointsMax - 1;
}

SampledCurve::Point SampledCurve::at(double t_s) const {
  if (t_s <= times_->t_s.front()) return {value_.front(), 0.0};
  if (t_s >= times_->t_s.back()) return {value_.back(), 0.0};
  const std::size_t before = index_before(t_s);
  if (!is_even_about(before)) return polynomial_at(t_s);
  const double step_s = times_->t_s[before + 1] - times_->t_s[before];
  const auto [row, share] = place_of((t_s - times_->t_s[before]) / step_s);
  const double* values = &value_[before + 1 - kReach];
  const Table& weights = table();
  return {product(weights.value[row], weights.value[row + 1], share, values),
          product(weights.slope[row], weights.slope[row + 1], share, values) / step_s};
}

double SampledCurve::value_at(double t_s) const {
  if (t_s <= times_->t_s.front()) return value_.front();
  if (t_s >= times_->t_s.back()) return value_.back();
  const std::size_t before = index_before(t_s);
  if (!is_even_about(before)) return polynomial_at(t_s).value;
  const auto [row, share] =
      place_of((t_s - times_->t_s[before]) / (times_->t_s[before + 1] - times_->t_s[before]));
  const Table& weights = table();
  return product(weights.value[row], weights.value[row + 1], share, &value_[before + 1 - kReach]);
}

std::vector<double> SampledCurve::quarters() const {
  using Points = Eigen::Array<double, kPointsMax, 1>;
  std::vector<double> values;
  values.reserve(kQuarters * times_->t_s.size());
  for (std::size_t i = 0; i + 1 < times_->t_s.size(); ++i) {
    values.push_back(value_[i]);
    const bool even = is_even_about(i);
    for (std::size_t part = 1; part < kQuarters; ++part) {
      if (!even) {
        const double share = static_cast<double>(part) / kQuarters;
        values.push_back(
            polynomial_at(times_->t_s[i] + share * (times_->t_s[i + 1] - times_->t_s[i])).value);
        continue;
      }
      const Row& row = table().value[part * kPhases / kQuarters];
      const Eigen::Map<const Points> about(&value_[i + 1 - kReach]);
      values.push_back((Eigen::Map<const Points>(row.data()) * about).sum());
    }
  }
  if (!value_.empty()) values.push_back(value_.back());
  return values;
}

SampledCurve::Point SampledCurve::nearby(double t_s) const {
  if (t_s <= times_->t_s.front()) return {value_.front(), 0.0};
  if (t_s >= times_->t_s.back()) return {value_.back(), 0.0};
  return polynomial_at(t_s);
}

// Lagrange's polynomials; times in intervals keep the products small.
SampledCurve::Point SampledCurve::polynomial_at(double t_s) const {
  const std::size_t count = std::min(kPoints, times_->t_s.size());
  const std::size_t first = first_about(t_s);
  std::array<double, kPoints> x{};
  for (std::size_t i = 0; i < count; ++i)
    x[i] = (t_s - times_->t_s[first + i]) / times_->interval_s;
  const auto weight = lagrange_weights(x, count);
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
  point.slope /= times_->interval_s;
  return point;
}

SampledCurve::Weights SampledCurve::weights_at(double t_s) const {
  Weights weights;
  const std::size_t count = std::min(kPoints, times_->t_s.size());
  weights.count = count;
  if (t_s <= times_->t_s.front()) {
    weights.value[0] = 1.0;
    return weights;
  }
  if (t_s >= times_->t_s.back()) {
    weights.first = times_->t_s.size() - count;
    weights.value[count - 1] = 1.0;
    return weights;
  }
  const std::size_t before = index_before(t_s);
  if (is_even_about(before)) {
    weights.first = before + 1 - kReach;
    weights.count = kPointsMax;
    const auto [row, share] =
        place_of((t_s - times_->t_s[before]) / (times_->t_s[before + 1] - times_->t_s[before]));
    for (std::size_t i = 0; i < kPointsMax; ++i)
      weights.value[i] = std::lerp(table().value[row][i], table().value[row + 1][i], share);
    return weights;
  }
  weights.first = first_about(t_s);
  std::array<double, kPoints> x{};
  for (std::size_t i = 0; i < count; ++i)
    x[i] = (t_s - times_->t_s[weights.first + i]) / times_->interval_s;
  const auto polynomial = lagrange_weights(x, count);
  for (std::size_t i = 0; i < count; ++i) {
    weights.value[i] = polynomial[i];
    for (std::size_t j = 0; j < count; ++j) {
      if (j != i) weights.value[i] *= x[j];
    }
  }
  return weights;
}

double SampledCurve::linear(double t_s) const {
  if (t_s <= times_->t_s.front()) return value_.front();
  if (t_s >= times_->t_s.back()) return value_.back();
  const std::size_t i = index_before(t_s);
  const double share = (t_s - times_->t_s[i]) / (times_->t_s[i + 1] - times_->t_s[i]);
  return value_[i] + share * (value_[i + 1] - value_[i]);
}

bool SampledCurve::hole_at(double t_s, double reach_s) const {
  if (empty() || t_s < from_s() - reach_s || t_s > to_s() + reach_s) return true;
  if (t_s <= from_s() || t_s >= to_s()) return false;
  const std::size_t before = index_before(t_s);
  return times_->t_s[before + 1] - times_->t_s[before] > 2.0 * reach_s;
}

}  // namespace vgyro::gap
