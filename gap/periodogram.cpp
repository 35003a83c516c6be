#include "gap/periodogram.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <unsupported/Eigen/FFT>

namespace vgyro::gap {

namespace {

// What is slower is drift and not a line.
constexpr double kLineLow_hz = 0.02;
// Of each block's mean in the running one, which is taken off: some five seconds.
constexpr double kDriftShare = 0.02;
// Twice as many frequencies as are independent: a peak between two of them loses little.
constexpr double kOversampling = 2.0;

double interval_s(const Observations& data) {
  return data.holds[0] ? data.layout.interval_s[0] : data.layout.interval_s[1];
}

// Weighted samples on an even grid; a gyro 2 stands in differences with the other sign.
struct Even {
  std::vector<double> value;
  double weight = 0.0;
};
Even even_grid(const Observations& data, const Eigen::VectorXd& residual, const PairNoise& noise,
               Part part, std::size_t length) {
  Even even{std::vector<double>(length, 0.0), 0.0};
  double drift_dps = 0.0;
  for (const Block& block : data.layout.blocks) {
    if (!counts(block, part)) continue;
    const double variance = sample_variance(block, noise, data.layout);
    const double sign = block.channel == Channel::kGyro2 && data.holds[0] ? -1.0 : 1.0;
    const auto values = residual.segment(block.first, block.count);
    const double mean_dps = sign * values.mean();
    if (even.weight == 0.0) drift_dps = mean_dps;
    drift_dps += kDriftShare * (mean_dps - drift_dps);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const auto place = static_cast<std::size_t>(
          std::lround(std::max(0.0, data.t_s[block.first + i]) / interval_s(data)));
      if (place >= length) continue;
      even.value[place] += (sign * values[static_cast<Eigen::Index>(i)] - drift_dps) / variance;
      even.weight += 1.0 / variance;
    }
  }
  return even;
}

}  // namespace

Periodogram periodogram_of(const Observations& data, const Eigen::VectorXd& residual,
                           const PairNoise& noise, Part part) {
  const double samples = data.about.seconds / interval_s(data);
  const auto length =
      static_cast<std::size_t>(std::pow(2.0, std::ceil(std::log2(kOversampling * samples))));
  const Even even = even_grid(data, residual, noise, part, length);
  Periodogram periodogram;
  periodogram.weight = even.weight;
  periodogram.resolution_hz = 1.0 / (static_cast<double>(length) * interval_s(data));
  periodogram.frequencies = 0.5 * samples;
  if (even.weight <= 0.0) return periodogram;
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, even.value);
  periodogram.power.resize(length / 2);
  for (std::size_t i = 0; i < periodogram.power.size(); ++i)
    periodogram.power[i] = std::norm(spectrum[i]);
  return periodogram;
}

std::vector<Periodogram::Peak> highest_peaks(const Periodogram& periodogram, std::size_t most) {
  const std::vector<double>& power = periodogram.power;
  std::vector<Periodogram::Peak> peaks;
  const auto first = std::max<std::size_t>(
      1, static_cast<std::size_t>(kLineLow_hz / periodogram.resolution_hz) + 1);
  for (std::size_t i = first; i + 1 < power.size(); ++i) {
    if (power[i] < power[i - 1] || power[i] < power[i + 1]) continue;
    peaks.push_back(
        {static_cast<double>(i) * periodogram.resolution_hz, 2.0 * power[i] / periodogram.weight});
  }
  const std::size_t kept = std::min(most, peaks.size());
  std::partial_sort(peaks.begin(), peaks.begin() + static_cast<std::ptrdiff_t>(kept), peaks.end(),
                    [](const Periodogram::Peak& a, const Periodogram::Peak& b) {
                      return a.statistic > b.statistic;
                    });
  peaks.resize(kept);
  return peaks;
}

}  // namespace vgyro::gap
