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
// Neighbouring frequencies that tell the power at one; and how far it must stand above the noise,
// three standard errors of their mean.
constexpr std::size_t kReach = 16;
constexpr double kAbove = 1.5;
constexpr double kLine = 20.0;
// The transform closes a circle. At either end the curve goes on as its own image in the end point,
// so that level and slope go on, and a ramp joins the two images.
constexpr double kImage_s = 20.0;
constexpr double kBridge_s = 20.0;

// `value` holds the curve in its first `n` places; the rest of the circle is filled.
void close_circle(std::vector<double>& value, std::size_t n, double step_s) {
  const std::size_t length = value.size();
  const auto image = std::min(n - 1, static_cast<std::size_t>(kImage_s / step_s));
  for (std::size_t k = 1; k <= image; ++k) {
    value[n - 1 + k] = 2.0 * value[n - 1] - value[n - 1 - k];
    value[length - k] = 2.0 * value[0] - value[k];
  }
  const std::size_t from = n - 1 + image;
  const std::size_t to = length - image;
  const double last = value[to % length];
  for (std::size_t i = from + 1; i < to; ++i) {
    const double share = static_cast<double>(i - from) / static_cast<double>(to - from);
    value[i] = value[from] + share * (last - value[from]);
  }
}
}  // namespace

SampledCurve without_noise(const SampledCurve& curve, double noise_variance) {
  if (curve.empty()) return curve;
  const double step_s = curve.interval_s();
  const auto n = static_cast<std::size_t>((curve.to_s() - curve.from_s()) / step_s) + 1;
  std::size_t length = 256;
  while (static_cast<double>(length) <
         static_cast<double>(n) + (2.0 * kImage_s + kBridge_s) / step_s)
    length *= 2;
  std::vector<double> t_s(n);
  std::vector<double> value(length);
  for (std::size_t i = 0; i < n; ++i) {
    t_s[i] = curve.from_s() + step_s * static_cast<double>(i);
    value[i] = curve.at(t_s[i]).value;
  }
  close_circle(value, n, step_s);
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, value);
  const std::size_t half = length / 2;
  std::vector<double> power(half + 1);
  for (std::size_t i = 0; i <= half; ++i)
    power[i] = std::norm(spectrum[i]);
  std::vector<double> upper(power.begin() + static_cast<std::ptrdiff_t>(half / 2), power.end());
  const double noise = kAbove * std::min(median_of(upper) / std::numbers::ln2,
                                         noise_variance * static_cast<double>(n));
  double sum = 0.0;
  for (std::size_t i = 0; i < std::min(kReach, half + 1); ++i)
    sum += power[i];
  std::size_t count = std::min(kReach, half + 1);
  for (std::size_t i = 0; i <= half; ++i) {
    if (i + kReach <= half) sum += power[i + kReach], ++count;
    if (i > kReach) sum -= power[i - kReach - 1], --count;
    const double mean = sum / static_cast<double>(count);
    // A line stands far above its neighbours, and is all motion.
    const double level = power[i] > kLine * noise ? power[i] : mean;
    const double weight = level > noise ? 1.0 - noise / level : 0.0;
    spectrum[i] *= weight;
    if (i > 0 && i < half) spectrum[length - i] *= weight;
  }
  transform.inv(value, spectrum);
  value.resize(n);
  return {t_s, value};
}

}  // namespace vgyro::gap
