#include "gap/signals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr std::array kTemperatureReach_s{1.0, 2.0, 4.0, 8.0};
// Where a temperature comes in steps these follow it too, over means of cells. What steps scatter
// about a curve that follows is a twelfth of their square, and some more where they are few.
constexpr std::array kSteppedReach_s{16.0, 32.0};
constexpr double kSteppedCell_s = 0.25;
constexpr double kSteppedScatter = 1.5 / 12.0;
// How much more than usual a temperature may scatter about a parabola that follows it.
constexpr double kFollows = 1.2;
constexpr double kGridStep_s = 0.25;

constexpr std::size_t kQuarters = SampledCurve::kQuarters;
// Steps that differ by less than this share have exponentials that follow from each other: they are
// right to half its square.
constexpr double kSameStep = 1e-6;
// A pair's gyros have a low-pass each, and a search tries others beside them.
constexpr std::size_t kFilteredMax = 4;

// First-order low-pass with a real or a complex pole, exact for a rate that is a parabola in each
// half of an interval.
template <class Number>
std::vector<Number> behind_pole(const SampledCurve& curve, const std::vector<double>& quarters,
                                Number pole) {
  const std::span<const double> t_s = curve.times_s();
  std::vector<Number> value(t_s.size());
  Number state = curve.values().front();
  value[0] = state;
  // An exponential is dear, and most steps are as long as the last but for a stamp's rounding.
  double last_s = 0.0;
  Number last_decay = 1.0;
  const Number memory = 1.0 / pole;
  for (std::size_t i = 0; i + 1 < t_s.size(); ++i) {
    const double half_s = 0.5 * (t_s[i + 1] - t_s[i]);
    if (std::abs(half_s - last_s) > kSameStep * half_s) {
      last_s = half_s;
      last_decay = std::exp(-pole * half_s);
    }
    const Number decay = last_decay * (1.0 - pole * (half_s - last_s));
    for (std::size_t half = 0; half < 2; ++half) {
      const double* u = &quarters[kQuarters * i + 2 * half];
      const double bend = 2.0 * (u[0] - 2.0 * u[1] + u[2]) / (half_s * half_s);
      const double slope = (u[2] - u[0]) / half_s - bend * half_s;
      // y' = pole·(u − y) is met by a parabola and what decays.
      const double c = bend;
      const Number b = slope - 2.0 * c * memory;
      const Number a = u[0] - b * memory;
      state = a + (b + c * half_s) * half_s + (state - a) * decay;
    }
    value[i + 1] = state;
  }
  return value;
}

SampledCurve low_pass(const SampledCurve& curve, const std::vector<double>& quarters,
                      double cutoff_hz) {
  return curve.with_values(behind_pole(curve, quarters, 2.0 * std::numbers::pi * cutoff_hz));
}

// Two of first order, one behind the other, as a weighted sum of both side by side.
SampledCurve low_pass(const SampledCurve& curve, const std::vector<double>& quarters,
                      const model::SecondOrder& second) {
  const auto [a, b] = second.poles();
  std::vector<double> value(curve.values().size());
  if (a.imag() != 0.0) {
    // What comes of the other is its conjugate.
    const std::vector<std::complex<double>> of_a = behind_pole(curve, quarters, a);
    const std::complex<double> weight = b / (b - a);
    for (std::size_t i = 0; i < value.size(); ++i)
      value[i] = 2.0 * std::real(weight * of_a[i]);
    return curve.with_values(std::move(value));
  }
  const std::vector<double> of_a = behind_pole(curve, quarters, a.real());
  const std::vector<double> of_b = behind_pole(curve, quarters, b.real());
  for (std::size_t i = 0; i < value.size(); ++i)
    value[i] = (b.real() * of_a[i] - a.real() * of_b[i]) / (b.real() - a.real());
  return curve.with_values(std::move(value));
}

struct Parabola {
  double value = 0.0;
  double slope = 0.0;
  double scatter = 0.0;  ///< mean square about it
};

Parabola fit_parabola(std::span<const double> t_s, std::span<const double> y, double at_s,
                      double reach_s) {
  const auto first = std::lower_bound(t_s.begin(), t_s.end(), at_s - reach_s) - t_s.begin();
  const auto last = std::upper_bound(t_s.begin(), t_s.end(), at_s + reach_s) - t_s.begin();
  Eigen::Matrix3d gram = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double squares = 0.0;
  double origin = std::nan("");
  for (auto i = first; i < last; ++i) {
    const auto place = static_cast<std::size_t>(i);
    if (std::isnan(y[place])) continue;
    if (std::isnan(origin)) origin = y[place];
    const double x = (t_s[place] - at_s) / reach_s;
    const Eigen::Vector3d powers(1.0, x, x * x);
    gram += powers * powers.transpose();
    right += powers * (y[place] - origin);
    squares += (y[place] - origin) * (y[place] - origin);
  }
  const double count = gram(0, 0);
  if (count < 1.0) return {std::nan(""), std::nan(""), 0.0};
  if (count < 4.0 || gram.determinant() < 1e-9 * count * count * count)
    return {origin + right[0] / count, 0.0, 0.0};
  const Eigen::Vector3d solution = gram.ldlt().solve(right);
  return {origin + solution[0], solution[1] / reach_s,
          std::max(0.0, squares - solution.dot(right)) / count};
}

// Of the parabolas about an instant the widest that scatters no more than sensor and frame do.
Parabola widest_parabola(std::span<const double> t_s, std::span<const double> y, double at_s,
                         double scatter_most) {
  for (auto reach_s = kTemperatureReach_s.rbegin(); reach_s != kTemperatureReach_s.rend();
       ++reach_s) {
    const Parabola parabola = fit_parabola(t_s, y, at_s, *reach_s);
    if (parabola.scatter <= scatter_most) return parabola;
  }
  return fit_parabola(t_s, y, at_s, kTemperatureReach_s.front());
}

double usual_scatter(std::span<const double> t_s, std::span<const double> y) {
  std::vector<double> scatter;
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter): a time
  for (double at_s = t_s.front(); at_s < t_s.back(); at_s += kTemperatureReach_s.front())
    scatter.push_back(fit_parabola(t_s, y, at_s, kTemperatureReach_s.front()).scatter);
  return median_of(scatter);
}

SampledCurve known_of(const std::vector<double>& t_s, const std::vector<double>& value) {
  std::vector<double> known_s;
  std::vector<double> known;
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (std::isnan(value[i])) continue;
    known_s.push_back(t_s[i]);
    known.push_back(value[i]);
  }
  return {known_s, known};
}

}  // namespace

const std::vector<double>& Motion::quarters() const {
  if (!quarters_) quarters_ = std::make_shared<const std::vector<double>>(rate_dps_.quarters());
  return *quarters_;
}

// Simpson's rule over each interval, from time 0.
const std::vector<double>& Motion::angle_deg() const {
  if (angle_deg_) return *angle_deg_;
  const std::span<const double> t_s = rate_dps_.times_s();
  const std::span<const double> rate = rate_dps_.values();
  std::vector<double> angle_deg(t_s.size());
  if (!t_s.empty()) angle_deg[0] = rate[0] * t_s[0];
  for (std::size_t i = 1; i < t_s.size(); ++i) {
    const double middle = quarters()[kQuarters * (i - 1) + kQuarters / 2];
    angle_deg[i] =
        angle_deg[i - 1] + (t_s[i] - t_s[i - 1]) * (rate[i - 1] + 4.0 * middle + rate[i]) / 6.0;
  }
  angle_deg_ = std::make_shared<const std::vector<double>>(std::move(angle_deg));
  return *angle_deg_;
}

double Motion::angle_rad(double t_s) const {
  const std::span<const double> times_s = rate_dps_.times_s();
  if (t_s < times_s.front()) {
    return kDegree * (angle_deg().front() + rate_dps_.values().front() * (t_s - times_s.front()));
  }
  const std::size_t i = t_s < times_s.back() ? rate_dps_.index_before(t_s) : times_s.size() - 1;
  const double step_s = t_s - times_s[i];
  return kDegree * (angle_deg()[i] + rate_dps_.value_at(times_s[i] + 0.5 * step_s) * step_s);
}

template <class Filter>
std::shared_ptr<const Motion> Motion::remembered(double cutoff_hz, double damping,
                                                 const Filter& filter) const {
  for (const Filtered& one : filtered_)
    if (one.cutoff_hz == cutoff_hz && one.damping == damping) return one.motion;
  if (filtered_.size() == kFilteredMax) filtered_.erase(filtered_.begin());
  filtered_.push_back({cutoff_hz, damping, std::make_shared<const Motion>(filter())});
  return filtered_.back().motion;
}

std::shared_ptr<const Motion> Motion::low_passed(double cutoff_hz) const {
  return remembered(cutoff_hz, 0.0,
                    [&] { return Motion(low_pass(rate_dps_, quarters(), cutoff_hz)); });
}

std::shared_ptr<const Motion> Motion::low_passed(const model::SecondOrder& second) const {
  return remembered(second.cutoff_hz, second.damping,
                    [&] { return Motion(low_pass(rate_dps_, quarters(), second)); });
}

namespace {

// Of the last sample before: between two it goes on straight. Nothing where no past is kept.
const model::TemperaturePast* past_at(const SampledCurve& temperature_c,
                                      const std::vector<model::TemperaturePast>& past, double t_s) {
  if (past.empty()) return nullptr;
  const std::span<const double> times_s = temperature_c.times_s();
  const auto after = std::upper_bound(times_s.begin(), times_s.end(), t_s) - times_s.begin();
  return &past[static_cast<std::size_t>(std::max<std::ptrdiff_t>(after - 1, 0))];
}

}  // namespace

model::Surroundings Signals::at(double t_s) const {
  model::Surroundings s = without_motion_at(t_s);
  s.angle_rad = motion.angle_rad(t_s);
  return s;
}

model::Surroundings Signals::without_motion_at(double t_s) const {
  model::Surroundings s;
  s.t_s = t_s;
  if (!temperature_c.empty()) {
    s.temperature_c = temperature_c.linear(t_s);
    s.temperature_slope_c_s = temperature_slope_c_s.linear(t_s);
    s.temperature_past = past_at(temperature_c, temperature_past, t_s);
  }
  if (!vibration_g2.empty()) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      s.acceleration_g[axis] = acceleration_g[axis].linear(t_s);
    }
    s.vibration_g2 = vibration_g2.linear(t_s);
  }
  if (!supply_v.empty()) s.supply_v = supply_v.linear(t_s);
  for (std::size_t axis = 0; axis < other_rate_dps.size(); ++axis) {
    if (!other_rate_dps[axis].empty()) s.other_rate_dps[axis] = other_rate_dps[axis].value_at(t_s);
  }
  return s;
}

namespace {

// The least distance of two values that follow each other, 0 where they never differ.
double step_of(std::span<const double> values) {
  double step = 0.0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double apart = std::abs(values[i] - values[i - 1]);
    if (apart > 0.0 && (step == 0.0 || apart < step)) step = apart;
  }
  return step;
}

// A temperature, smoothed as far as it allows.
class SmoothTemperature {
 public:
  explicit SmoothTemperature(const GyroSeries& gyro) : t_s_(gyro.t_s), value_(gyro.temperature_c) {
    const double step = step_of(value_);
    scatter_most_ = std::max(kFollows * usual_scatter(t_s_, value_), kSteppedScatter * step * step);
    if (step < Signals::kCoarseTemperature_c) return;
    for (std::size_t i = 0; i < t_s_.size(); ++i) {
      if (std::isnan(value_[i])) continue;
      const double cell = std::floor(t_s_[i] / kSteppedCell_s);
      if (cell_s_.empty() || cell != cell_) {
        cell_ = cell;
        count_ = 0.0;
        cell_s_.push_back(0.0);
        cell_value_.push_back(0.0);
      }
      count_ += 1.0;
      cell_s_.back() += (t_s_[i] - cell_s_.back()) / count_;
      cell_value_.back() += (value_[i] - cell_value_.back()) / count_;
    }
  }

  [[nodiscard]] Parabola at(double t_s) const {
    if (!cell_s_.empty()) {
      for (auto reach_s = kSteppedReach_s.rbegin(); reach_s != kSteppedReach_s.rend(); ++reach_s) {
        const Parabola parabola = fit_parabola(cell_s_, cell_value_, t_s, *reach_s);
        if (parabola.scatter <= scatter_most_) return parabola;
      }
    }
    return widest_parabola(t_s_, value_, t_s, scatter_most_);
  }

 private:
  std::span<const double> t_s_;
  std::span<const double> value_;
  double scatter_most_ = 0.0;
  std::vector<double> cell_s_;  ///< only of a coarse temperature
  std::vector<double> cell_value_;
  double cell_ = 0.0;
  double count_ = 0.0;
};

}  // namespace

void smooth_temperature(const GyroSeries& gyro, Signals& signals) {
  if (gyro.temperature_c.empty()) return;
  const double end_s = gyro.t_s.back();
  const SmoothTemperature smooth(gyro);
  std::vector<double> t_s;
  std::vector<double> value;
  std::vector<double> slope;
  model::TemperaturePast past;
  signals.temperature_past.clear();
  signals.temperature_step_c = step_of(gyro.temperature_c);
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter): a time
  for (double t = gyro.t_s.front(); t <= end_s + kGridStep_s; t += kGridStep_s) {
    const Parabola parabola = smooth.at(std::min(t, end_s));
    if (std::isnan(parabola.value)) continue;
    past.add(parabola.value);
    signals.temperature_past.push_back(past);
    t_s.push_back(t);
    value.push_back(parabola.value);
    slope.push_back(parabola.slope);
  }
  signals.temperature_c = SampledCurve(t_s, value);
  signals.temperature_slope_c_s = SampledCurve(t_s, slope);
}

void set_supply(const GyroSeries& gyro, Signals& signals) {
  signals.supply_v = known_of(gyro.t_s, gyro.supply_v);
}

void set_other_rates(const GyroSeries& gyro, Signals& signals) {
  for (std::size_t axis = 0; axis < signals.other_rate_dps.size(); ++axis)
    signals.other_rate_dps[axis] = known_of(gyro.t_s, gyro.other_rate_dps[axis]);
}

void set_acceleration(const AccelerationSeries& acceleration, Signals& signals) {
  if (acceleration.t_s.size() < 2) return;
  const std::size_t n = acceleration.t_s.size();
  for (std::size_t axis = 0; axis < 3; ++axis)
    signals.acceleration_g[axis] = SampledCurve(acceleration.t_s, acceleration.g[axis]);
  // Variance of |a| over the last second.
  std::vector<double> size(n);
  for (std::size_t i = 0; i < n; ++i) {
    size[i] = std::sqrt(acceleration.g[0][i] * acceleration.g[0][i] +
                        acceleration.g[1][i] * acceleration.g[1][i] +
                        acceleration.g[2][i] * acceleration.g[2][i]);
  }
  std::vector<double> variance(n);
  std::size_t first = 0;
  double sum = 0.0;
  double squares = 0.0;
  const double pivot = size[0];
  for (std::size_t i = 0; i < n; ++i) {
    sum += size[i] - pivot;
    squares += (size[i] - pivot) * (size[i] - pivot);
    while (acceleration.t_s[i] - acceleration.t_s[first] >= 1.0) {
      sum -= size[first] - pivot;
      squares -= (size[first] - pivot) * (size[first] - pivot);
      ++first;
    }
    const double count = static_cast<double>(i - first + 1);
    variance[i] = std::max(0.0, squares / count - (sum / count) * (sum / count));
  }
  signals.vibration_g2 = SampledCurve(acceleration.t_s, variance);
}

void set_circumstances(const GyroSeries& gyro, const AccelerationSeries& acceleration,
                       Signals& signals) {
  smooth_temperature(gyro, signals);
  set_supply(gyro, signals);
  set_other_rates(gyro, signals);
  set_acceleration(acceleration, signals);
}

Prediction::Prediction(std::span<const model::Effect> effects, const Signals& signals)
    : equation_(effects), signals_(signals) {
  const auto pass = [&](const auto& filter) {
    low_passed_ = (low_passed_ ? *low_passed_ : on_time()).low_passed(filter);
  };
  for (const double cutoff_hz : equation_.cutoffs_hz())
    pass(cutoff_hz);
  for (const model::SecondOrder& second : equation_.second_orders())
    pass(second);
}

double Prediction::late_dps(double t_s) const {
  return late_dps(t_s, (low_passed_ ? *low_passed_ : on_time()).curve());
}

double Prediction::late_dps(double t_s, const SampledCurve& felt_dps) const {
  return equation_.late_rate_dps([&](double felt_at_s) { return felt_dps.value_at(felt_at_s); },
                                 equation_.true_time_s(t_s));
}

double Prediction::at(double t_s) const {
  const double late_dps = this->late_dps(t_s);
  if (!equation_.adds()) return late_dps;
  return equation_.reading_dps(late_dps, signals_.at(equation_.true_time_s(t_s)));
}

}  // namespace vgyro::gap
