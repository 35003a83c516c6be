#include "analysis/spectrum.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <numbers>

#include <unsupported/Eigen/FFT>

namespace vgyro::analysis {

namespace {

constexpr std::size_t kValuesMin = 16;
constexpr std::size_t kWholeMax = std::size_t{1} << 18U;
constexpr std::size_t kPieceMin = std::size_t{1} << 17U;
// In a long record, the means are used up to this share of their own highest frequency; the pieces
// are used from this many half periods in a piece.
constexpr double kShareOfMeans = 0.1;
constexpr std::size_t kHalfPeriodsMin = 128;
// The first coefficients have a bin each; later bins are so narrow that the power changes by 3 %
// within one.
constexpr std::size_t kAlone = 128;
constexpr std::size_t kBinsPerRatio = 64;

struct Band {
  double from_hz;
  double to_hz;
};

void add_bins(std::span<const double> values, double interval_s, Band band,
              std::vector<PowerBin>& bins) {
  const std::size_t n = values.size();
  const auto size = static_cast<double>(n);
  const std::vector<double> z = step_sine_transform(values);
  const auto frequency = [&](double j) { return j / (2.0 * size * interval_s); };
  for (std::size_t j = 1; j < n;) {
    const std::size_t width = j < kAlone ? 1 : j / kBinsPerRatio;
    const std::size_t end = std::min(n, j + width);
    const double middle = 0.5 * static_cast<double>(j + end - 1);
    PowerBin bin{frequency(middle), interval_s};
    const double half_angle = 0.5 * std::numbers::pi * middle / size;
    bin.step_gain = 4.0 * std::sin(half_angle) * std::sin(half_angle);
    bin.half_periods = middle;
    for (; j < end; ++j) {
      // Σ sin(πjk/n) over k is cot(πj/2n) for odd j and 0 for even j.
      const double angle = 0.5 * std::numbers::pi * static_cast<double>(j) / size;
      const double h = j % 2 == 0 ? 0.0 : interval_s * std::sqrt(2.0 / size) / std::tan(angle);
      bin.count += 1.0;
      bin.power += z[j - 1] * z[j - 1];
      bin.ramp_power += h * h;
      bin.cross += z[j - 1] * h;
    }
    if (bin.frequency_hz >= band.from_hz && bin.frequency_hz < band.to_hz) bins.push_back(bin);
  }
}

std::vector<double> means(const std::vector<double>& values, std::size_t of) {
  std::vector<double> result(values.size() / of);
  for (std::size_t i = 0; i < result.size(); ++i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < of; ++k)
      sum += values[i * of + k];
    result[i] = sum / static_cast<double>(of);
  }
  return result;
}

void add_long_part(const std::vector<double>& values, double interval_s,
                   std::vector<PowerBin>& bins) {
  const std::size_t of = (values.size() + kPieceMin - 1) / kPieceMin;
  const std::vector<double> slow = means(values, of);
  const double slow_s = interval_s * static_cast<double>(of);
  const double border_hz = kShareOfMeans * 0.5 / slow_s;
  add_bins(std::span(slow).first(smooth_size(slow.size())), slow_s, {0.0, border_hz}, bins);
  const auto least =
      static_cast<std::size_t>(static_cast<double>(kHalfPeriodsMin * of) / kShareOfMeans);
  const std::size_t piece = smooth_size(std::max(kPieceMin, least));
  for (std::size_t begin = 0; begin + piece <= values.size(); begin += piece) {
    add_bins(std::span(values).subspan(begin, piece), interval_s, {border_hz, 1.0 / interval_s},
             bins);
  }
}

}  // namespace

std::size_t smooth_size(std::size_t n) {
  std::size_t best = 1;
  for (std::size_t five = 1; five <= n; five *= 5) {
    for (std::size_t three = five; three <= n; three *= 3) {
      std::size_t two = three;
      while (two <= n / 2)
        two *= 2;
      best = std::max(best, two);
    }
  }
  return best;
}

std::vector<double> step_sine_transform(std::span<const double> values) {
  const std::size_t n = values.size();
  assert(n >= 4);
  std::vector<double> odd(2 * n, 0.0);
  for (std::size_t k = 1; k < n; ++k) {
    odd[k] = values[k] - values[k - 1];
    odd[2 * n - k] = -odd[k];
  }
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<std::complex<double>> transformed;
  fft.fwd(transformed, odd);
  std::vector<double> z(n - 1);
  const double scale = -0.5 * std::sqrt(2.0 / static_cast<double>(n));
  for (std::size_t j = 1; j < n; ++j)
    z[j - 1] = scale * transformed[j].imag();
  return z;
}

std::vector<PowerBin> step_spectrum(const Series& series) {
  std::vector<PowerBin> bins;
  for (const Part& part : series.parts) {
    if (part.rate_dps.size() < kValuesMin) continue;
    if (part.rate_dps.size() > kWholeMax) {
      add_long_part(part.rate_dps, series.interval_s, bins);
    } else {
      const std::size_t size = smooth_size(part.rate_dps.size());
      add_bins(std::span(part.rate_dps).first(size), series.interval_s,
               {0.0, 1.0 / series.interval_s}, bins);
    }
  }
  return bins;
}

}  // namespace vgyro::analysis
