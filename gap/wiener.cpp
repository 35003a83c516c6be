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
// What a ramp from the end back to the beginning takes.
constexpr double kBridge_s = 20.0;
}  // namespace

SampledCurve without_noise(const SampledCurve& curve) {
  if (curve.empty()) return curve;
  const double step_s = curve.interval_s();
  const auto n = static_cast<std::size_t>((curve.to_s() - curve.from_s()) / step_s) + 1;
  std::size_t length = 256;
  while (static_cast<double>(length) < static_cast<double>(n) + kBridge_s / step_s)
    length *= 2;
  std::vector<double> t_s(n);
  std::vector<double> value(length);
  for (std::size_t i = 0; i < n; ++i) {
    t_s[i] = curve.from_s() + step_s * static_cast<double>(i);
    value[i] = curve.at(t_s[i]).value;
  }
  for (std::size_t i = n; i < length; ++i) {
    const double share = static_cast<double>(i - n + 1) / static_cast<double>(length - n + 1);
    value[i] = value[n - 1] + share * (value[0] - value[n - 1]);
  }
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, value);
  const std::size_t half = length / 2;
  std::vector<double> power(half + 1);
  for (std::size_t i = 0; i <= half; ++i)
    power[i] = std::norm(spectrum[i]);
  std::vector<double> upper(power.begin() + static_cast<std::ptrdiff_t>(half / 2), power.end());
  const double noise = kAbove * median_of(upper) / std::numbers::ln2;
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
