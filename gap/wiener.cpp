#include "gap/wiener.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include <unsupported/Eigen/FFT>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

// Motion comes and goes: each stretch of so many samples has a spectrum of its own. They overlap
// fourfold, so that a window that keeps great motion from leaking into other frequencies may stand
// before the transform and behind it: the squares of four add up to 3/2, and of each the mean is
// 3/8.
constexpr std::size_t kStretch = 256;
constexpr std::size_t kHop = kStretch / 4;
constexpr double kWindows = 1.5;
constexpr double kWindowSquare = 0.375;
// Neighbouring frequencies that tell the power at one; and how far it must stand above the noise,
// three standard errors of their mean.
constexpr std::size_t kReach = 10;
constexpr double kAbove = 1.5;
constexpr double kLine = 20.0;
// Of a step: an instant of the even grid is a sample's.
constexpr double kSameInstant = 2e-4;

// The curve on an even grid, in the middle of stretches. At either end it goes on as its own image
// in the end point, as far as it reaches: level and slope go on.
std::vector<double> on_grid(const SampledCurve& curve, const std::vector<double>& t_s) {
  const std::size_t n = t_s.size();
  std::vector<double> value((n / kHop + 1) * kHop + 2 * kStretch);
  for (std::size_t i = 0; i < n; ++i) {
    const bool sampled = i < curve.times_s().size() &&
                         std::abs(curve.times_s()[i] - t_s[i]) < kSameInstant * curve.interval_s();
    value[kStretch + i] = sampled ? curve.values()[i] : curve.value_at(t_s[i]);
  }
  const std::size_t last = kStretch + n - 1;
  for (std::size_t k = 1; k <= kStretch; ++k)
    value[kStretch - k] = 2.0 * value[kStretch] - value[kStretch + std::min(k, n - 1)];
  for (std::size_t k = 1; last + k < value.size(); ++k)
    value[last + k] = 2.0 * value[last] - value[last - std::min(k, n - 1)];
  return value;
}

struct Line {
  double middle = 0.0;
  double slope = 0.0;

  [[nodiscard]] double at(std::size_t i) const {
    return middle + slope * (static_cast<double>(i) - 0.5 * (kStretch - 1.0));
  }
};

Line line_through(const double* value) {
  Line line;
  double products = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < kStretch; ++i) {
    const double x = static_cast<double>(i) - 0.5 * (kStretch - 1.0);
    line.middle += value[i] / kStretch;
    products += x * value[i];
    squares += x * x;
  }
  line.slope = products / squares;
  return line;
}

// Frequencies weighed by how far they stand above the noise.
void weigh(std::vector<std::complex<double>>& spectrum, double white_power) {
  const std::size_t half = spectrum.size() - 1;
  std::vector<double> power(half + 1);
  for (std::size_t i = 0; i <= half; ++i)
    power[i] = std::norm(spectrum[i]);
  std::vector<double> upper(power.begin() + static_cast<std::ptrdiff_t>(half / 2), power.end());
  const double noise = kAbove * std::min(median_of(upper) / std::numbers::ln2, white_power);
  double sum = 0.0;
  std::size_t count = std::min(kReach, half + 1);
  for (std::size_t i = 0; i < count; ++i)
    sum += power[i];
  for (std::size_t i = 0; i <= half; ++i) {
    if (i + kReach <= half) sum += power[i + kReach], ++count;
    if (i > kReach) sum -= power[i - kReach - 1], --count;
    const double mean = sum / static_cast<double>(count);
    // A line stands far above its neighbours, and is all motion.
    const double level = power[i] > kLine * noise ? power[i] : mean;
    spectrum[i] *= level > noise ? 1.0 - noise / level : 0.0;
  }
}

}  // namespace

SampledCurve without_noise(const SampledCurve& curve, double noise_variance) {
  if (curve.empty()) return curve;
  const double step_s = curve.interval_s();
  const auto n = static_cast<std::size_t>((curve.to_s() - curve.from_s()) / step_s) + 1;
  std::vector<double> t_s(n);
  for (std::size_t i = 0; i < n; ++i)
    t_s[i] = curve.from_s() + step_s * static_cast<double>(i);
  const std::vector<double> value = on_grid(curve, t_s);
  std::vector<double> window(kStretch);
  for (std::size_t i = 0; i < kStretch; ++i)
    window[i] = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * (static_cast<double>(i) + 0.5) /
                                     static_cast<double>(kStretch));
  const double white_power = noise_variance * kWindowSquare * kStretch;
  Eigen::FFT<double> transform;
  transform.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<double> sum(value.size(), 0.0);
  std::vector<double> part(kStretch);
  std::vector<std::complex<double>> spectrum;
  for (std::size_t from = 0; from + kStretch <= value.size(); from += kHop) {
    const Line line = line_through(&value[from]);
    for (std::size_t i = 0; i < kStretch; ++i)
      part[i] = window[i] * (value[from + i] - line.at(i));
    transform.fwd(spectrum, part);
    weigh(spectrum, white_power);
    transform.inv(part, spectrum, static_cast<Eigen::Index>(kStretch));
    for (std::size_t i = 0; i < kStretch; ++i)
      sum[from + i] += window[i] * (part[i] + window[i] * line.at(i)) / kWindows;
  }
  return {t_s, std::span(sum).subspan(kStretch, n)};
}

}  // namespace vgyro::gap
