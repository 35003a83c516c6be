#include "analysis/likeness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Dense>

namespace vgyro::analysis {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kLagMost_s = 0.6;  // of gateways and filters; slower ones are no use for a gyro
constexpr std::array kScales_s{0.1, 0.4, 1.6};  // from a hand's or a rotor's motion to a car's bend
constexpr std::size_t kGridMost = 150'000;
constexpr double kGapMost_s = 0.5;  // nothing is interpolated across more
constexpr double kSharedLeast_s = 4.0;
constexpr double kQuickStep_s = 0.05;
constexpr double kQuickStepMost_s = 0.5;
constexpr double kQuickPoints = 6000;  // points of a grid, before its step grows
constexpr std::size_t kQuickPointsMost = 30'000;
constexpr std::array<std::size_t, 2> kQuickSpans{8, 32};  // steps

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double median_interval(const StampedSignal& signal) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < signal.t_s.size(); ++i)
    intervals.push_back(signal.t_s[i] - signal.t_s[i - 1]);
  return quantile(std::move(intervals), 0.5);
}

struct Grid {
  double begin_s = 0.0;
  double step_s = 0.0;
  std::size_t size = 0;
};

/// Cumulative sums of the values and of their number, up to each place.
struct Sums {
  std::vector<double> value;
  std::vector<double> count;
};

Sums resample(const StampedSignal& signal, const Grid& grid) {
  Sums sums{std::vector<double>(grid.size + 1), std::vector<double>(grid.size + 1)};
  std::size_t next = 0;
  for (std::size_t k = 0; k < grid.size; ++k) {
    const double t_s = grid.begin_s + static_cast<double>(k) * grid.step_s;
    while (next < signal.t_s.size() && signal.t_s[next] <= t_s)
      ++next;
    const bool inside = next > 0 && next < signal.t_s.size() &&
                        signal.t_s[next] - signal.t_s[next - 1] <= kGapMost_s;
    double value = 0.0;
    if (inside) {
      const double span_s = signal.t_s[next] - signal.t_s[next - 1];
      const double share = (t_s - signal.t_s[next - 1]) / span_s;
      value = signal.value[next - 1] + share * (signal.value[next] - signal.value[next - 1]);
    }
    sums.value[k + 1] = sums.value[k] + value;
    sums.count[k + 1] = sums.count[k] + (inside ? 1.0 : 0.0);
  }
  return sums;
}

/// Mean of the next `span` places less the mean of the `span` before; NaN where some are missing.
/// Rare spikes are clipped to the range of the other changes.
std::vector<double> changes(const Sums& sums, std::size_t span) {
  const std::size_t size = sums.value.size() - 1;
  std::vector<double> result(size, kNone);
  std::vector<double> magnitudes;
  for (std::size_t k = span; k + span <= size; ++k) {
    if (sums.count[k + span] - sums.count[k - span] < 2.0 * static_cast<double>(span)) continue;
    const double sum = sums.value[k + span] - 2.0 * sums.value[k] + sums.value[k - span];
    result[k] = sum / static_cast<double>(span);
    magnitudes.push_back(std::abs(result[k]));
  }
  const double limit = 1.5 * quantile(std::move(magnitudes), 0.995);
  for (double& change : result)
    change = std::isnan(change) ? change : std::clamp(change, -limit, limit);
  return result;
}

struct Moments {
  double xx = 0.0;
  double yy = 0.0;
  double xy = 0.0;
  double count = 0.0;
  [[nodiscard]] double correlation() const {
    return xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : 0.0;
  }
};

template <class T>
Moments moments(const std::vector<T>& x, const std::vector<T>& y, long lag, std::size_t stride) {
  Moments sum;
  const long size = static_cast<long>(x.size());
  for (long k = std::max(0L, -lag); k < std::min(size, size - lag);
       k += static_cast<long>(stride)) {
    const auto a = static_cast<double>(x[static_cast<std::size_t>(k)]);
    const auto b = static_cast<double>(y[static_cast<std::size_t>(k + lag)]);
    if (std::isnan(a) || std::isnan(b)) continue;
    sum.xx += a * a;
    sum.yy += b * b;
    sum.xy += a * b;
    sum.count += 1.0;
  }
  return sum;
}

/// Best lag at one time scale.
Likeness at_scale(const Sums& first, const Sums& second, const Grid& grid, double scale_s) {
  const auto span = static_cast<std::size_t>(std::max(1.0, std::round(scale_s / grid.step_s)));
  const std::vector<double> x = changes(first, span);
  const std::vector<double> y = changes(second, span);
  const std::size_t stride = std::max<std::size_t>(1, span / 4);
  const long most = std::lround(kLagMost_s / grid.step_s);
  std::vector<double> curve;
  for (long lag = -most; lag <= most; ++lag)
    curve.push_back(moments(x, y, lag, stride).correlation());
  const auto peak = std::max_element(curve.begin(), curve.end(),
                                     [](double a, double b) { return std::abs(a) < std::abs(b); });
  const long lag = peak - curve.begin() - most;
  double offset = 0.0;
  if (peak != curve.begin() && peak + 1 != curve.end()) {
    const double bend = peak[-1] - 2.0 * peak[0] + peak[1];
    if (bend != 0.0) offset = std::clamp(0.5 * (peak[-1] - peak[1]) / bend, -0.5, 0.5);
  }
  const Moments best = moments(x, y, lag, stride);
  Likeness result;
  result.correlation = best.correlation();
  result.lag_s = (static_cast<double>(lag) + offset) * grid.step_s;
  result.scale_s = scale_s;
  if (best.xx > 0.0 && best.xy != 0.0)
    result.ratio = std::copysign(std::sqrt(best.yy / best.xx), best.xy);
  const double tilt = best.yy - best.xx;
  if (best.xy != 0.0) result.scale = (tilt + std::hypot(tilt, 2.0 * best.xy)) / (2.0 * best.xy);
  const double independent = best.count * static_cast<double>(stride) * grid.step_s / (2 * scale_s);
  const double magnitude = std::min(std::abs(result.correlation), 0.999999);
  result.significance = std::atanh(magnitude) * std::sqrt(std::max(0.0, independent - 3.0));
  return result;
}

// --- copies --------------------------------------------------------------------------------------

constexpr std::size_t kTaps = 32;
constexpr std::size_t kTapsAhead = 6;
constexpr std::size_t kRowsMost = 6000;
constexpr double kUnexplainedMost = 0.03;  // of the variance

struct Rows {
  Eigen::MatrixXd taps;
  Eigen::VectorXd value;
};

Rows make_rows(const StampedSignal& copy, const StampedSignal& source, double shift_s) {
  const std::size_t count = std::min(copy.t_s.size(), kRowsMost);
  std::vector<std::pair<std::size_t, std::size_t>> found;  // indices in copy and source
  for (std::size_t k = 0; k < count; ++k) {
    const auto at = std::upper_bound(source.t_s.begin(), source.t_s.end(), copy.t_s[k] + shift_s);
    const std::size_t newest = static_cast<std::size_t>(at - source.t_s.begin());
    if (newest < kTaps || at == source.t_s.end()) continue;
    found.emplace_back(k, newest - 1);
  }
  const auto rows = static_cast<Eigen::Index>(found.size());
  Rows result{Eigen::MatrixXd(rows, static_cast<Eigen::Index>(kTaps)), Eigen::VectorXd(rows)};
  for (Eigen::Index r = 0; r < rows; ++r) {
    const auto [k, newest] = found[static_cast<std::size_t>(r)];
    result.value(r) = copy.value[k];
    for (std::size_t j = 0; j < kTaps; ++j)
      result.taps(r, static_cast<Eigen::Index>(j)) = source.value[newest - j];
  }
  return result;
}

Rows differences(const Rows& rows) {
  const Eigen::Index n = rows.value.size() - 1;
  return {rows.taps.bottomRows(n) - rows.taps.topRows(n), rows.value.tail(n) - rows.value.head(n)};
}

struct Fit {
  double explained = 0.0;
  double residual = 0.0;
  double gain = 0.0;
  double bias = 0.0;
};

Fit fit(const Rows& rows) {
  const Eigen::RowVectorXd mean = rows.taps.colwise().mean();
  const double mean_value = rows.value.mean();
  const Eigen::MatrixXd taps = rows.taps.rowwise() - mean;
  const Eigen::VectorXd value = rows.value.array() - mean_value;
  Eigen::MatrixXd normal = taps.transpose() * taps;
  normal.diagonal().array() += 1e-10 * normal.trace() + 1e-300;
  const Eigen::VectorXd weights = normal.ldlt().solve(taps.transpose() * value);
  const double n = static_cast<double>(value.size());
  const double residual = (value - taps * weights).squaredNorm() / n;
  return {value.squaredNorm() / n - residual, residual, weights.sum(),
          mean_value - mean.dot(weights)};
}

/// Rounding of the copy and of the source, which may have another unit, in a difference of this
/// order.
double rounding(const StampedSignal& copy, const StampedSignal& source, double gain,
                std::size_t order) {
  constexpr std::array kGain{1.0, 2.0, 6.0};
  const double source_step = gain * source.step;
  const double steps = copy.step * copy.step + source_step * source_step;
  return kGain[order] * steps / 12.0;
}

bool all_explained(const StampedSignal& copy, const StampedSignal& source, double shift_s) {
  Rows rows = make_rows(copy, source, shift_s);
  if (rows.value.size() < static_cast<Eigen::Index>(8 * kTaps)) return false;
  const Fit level = fit(rows);
  bool noise_seen = false;
  for (std::size_t order = 0; order < 3; ++order) {
    if (order > 0) rows = differences(rows);
    const Fit now = order == 0 ? level : fit(rows);
    const double rounded = rounding(copy, source, level.gain, order);
    const double unexplained = std::max(0.0, now.residual - 1.5 * rounded);
    if (unexplained > kUnexplainedMost * now.explained + 0.2 * rounded) return false;
    noise_seen = order == 2 && now.explained > 2.0 * rounded;
  }
  if (noise_seen) return true;
  // Rounding hides the noise of both signals: only a copy has the same zero (or, truncated, half a
  // step less) and the same scale.
  const double zero = std::abs(level.bias) / std::max(copy.step, 1e-300);
  const bool same_zero = zero < 0.05 || std::abs(zero - 0.5) < 0.05;
  return same_zero && std::abs(std::abs(level.gain) - 1.0) < 0.005;
}

}  // namespace

SignalFigures signal_figures(const StampedSignal& signal) {
  SignalFigures figures;
  figures.interval_s = median_interval(signal);
  figures.median = quantile(signal.value, 0.5);
  std::vector<double> off;
  for (const double value : signal.value)
    off.push_back(std::abs(value - figures.median));
  figures.peak = quantile(off, 0.995);
  figures.changes = std::any_of(off.begin(), off.end(), [](double value) { return value > 0; });
  constexpr std::size_t kBlock = 64;
  std::vector<double> powers;
  for (std::size_t i = 0; i + kBlock < signal.value.size(); i += kBlock) {
    double sum = 0.0;
    for (std::size_t k = i; k < i + kBlock; ++k)
      sum += std::pow(signal.value[k + 1] - signal.value[k], 2);
    powers.push_back(sum / static_cast<double>(kBlock));
  }
  figures.noise = std::sqrt(0.5 * quantile(std::move(powers), 0.1));
  return figures;
}

std::optional<Likeness> likeness(const StampedSignal& first, const StampedSignal& second) {
  if (first.t_s.size() < 16 || second.t_s.size() < 16) return std::nullopt;
  Grid grid;
  grid.begin_s = std::max(first.t_s.front(), second.t_s.front());
  const double shared_s = std::min(first.t_s.back(), second.t_s.back()) - grid.begin_s;
  if (shared_s < kSharedLeast_s) return std::nullopt;
  const double interval_s = std::max(median_interval(first), median_interval(second));
  grid.step_s = std::clamp(0.5 * interval_s, 0.0025, 0.05);
  grid.size = std::min(kGridMost, static_cast<std::size_t>(shared_s / grid.step_s));
  const Sums x = resample(first, grid);
  const Sums y = resample(second, grid);
  std::optional<Likeness> best;
  for (const double scale_s : kScales_s) {
    if (scale_s < interval_s) continue;
    const Likeness here = at_scale(x, y, grid, scale_s);
    if (!best || here.significance > best->significance) best = here;
  }
  return best;
}

double Likeness::scale_error() const {
  const double magnitude = std::min(std::abs(correlation), 0.999999);
  if (magnitude <= 0.0 || significance <= 0.0) return 1.0;
  const double independent = std::pow(significance / std::atanh(magnitude), 2);
  return std::sqrt((1.0 / (magnitude * magnitude) - 1.0) / independent);
}

ChangeShape change_shape(const StampedSignal& signal, double begin_s, double seconds) {
  ChangeShape shape;
  shape.step_s = std::clamp(seconds / kQuickPoints, kQuickStep_s, kQuickStepMost_s);
  const double points = std::min(seconds / shape.step_s, static_cast<double>(kQuickPointsMost));
  const Sums sums = resample(signal, {begin_s, shape.step_s, static_cast<std::size_t>(points)});
  for (std::size_t i = 0; i < shape.changes.size(); ++i) {
    const std::vector<double> all = changes(sums, kQuickSpans[i]);
    shape.changes[i].assign(all.begin(), all.end());
  }
  return shape;
}

double quick_correlation(const ChangeShape& first, const ChangeShape& second) {
  const long most = std::max(1L, std::lround(kLagMost_s / first.step_s));
  constexpr double kShared = 80;  // quarters of a span: some twenty independent changes
  double best = 0.0;
  for (std::size_t i = 0; i < kQuickSpans.size(); ++i) {
    const std::size_t stride = kQuickSpans[i] / 4;
    for (long lag = -most; lag <= most; lag += std::min<long>(most, static_cast<long>(stride))) {
      const Moments sum = moments(first.changes[i], second.changes[i], lag, stride);
      if (sum.count >= kShared) best = std::max(best, std::abs(sum.correlation()));
    }
  }
  return best;
}

bool is_made_of(const StampedSignal& copy, const StampedSignal& source, double lag_s) {
  const double interval_s = median_interval(source);
  for (const double part : {0.0, 0.25, 0.5, 0.75}) {
    const double ahead = static_cast<double>(kTapsAhead) + part;
    if (all_explained(copy, source, ahead * interval_s - lag_s)) return true;
  }
  return false;
}

}  // namespace vgyro::analysis
