#include "analysis/pair_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "analysis/resolution.h"
#include "analysis/spectrum.h"

namespace vgyro::analysis {

namespace {

// Interpolation does not change the common part of the two noises up to this share of the pairs'
// rate.
constexpr double kShareOfRate = 0.1;
// If white noise is this much stronger than all other noise, the correlation is that of white
// noise.
constexpr double kWhiteOverOther = 10.0;
constexpr double kCoefficientsForCorrelation = 50.0;
constexpr std::size_t kPiece = std::size_t{1} << 17U;
constexpr std::size_t kValuesMin = 64;

SeriesNoise judge(const Series& series, double interpolation_gain, bool fit) {
  SeriesNoise noise;
  noise.interval_s = series.interval_s;
  noise.seconds = series.seconds();
  noise.parts = series.parts.size();
  noise.filled_share = series.filled_share;
  const auto size = static_cast<double>(series.size());
  for (const Part& part : series.parts) {
    for (const double rate : part.rate_dps)
      noise.mean_dps += rate / size;
  }
  if (fit) {
    noise.fit = fit_noise(step_spectrum(series), {.measured_share = 1.0 - series.filled_share,
                                                  .interpolation_gain = interpolation_gain,
                                                  .interval_s = series.interval_s});
  }
  noise.allan = allan_deviation(series, [&](double tau_s) {
    return noise.fit ? noise.fit->dominant(tau_s) : NoiseKind::kWhite;
  });
  return noise;
}

SeriesNoise judge_gyro(const Series& series, double step_dps, bool rests) {
  SeriesNoise noise = judge(series, 1.0, rests);
  if (!rests) return noise;
  noise.hidden_by_step = step_hides_noise(series, step_dps);
  if (noise.hidden_by_step) {
    noise.fit = bounded_by_step(noise.fit, step_dps, series);
  } else if (noise.fit) {
    noise.fit = without_rounding(*noise.fit, step_dps, series.interval_s);
  }
  return noise;
}

// Frequency above which only white noise matters. Precondition: white noise is resolved.
double white_from_hz(const NoiseFit& fit) {
  const double white = fit.white_dps_rthz.value * fit.white_dps_rthz.value / kWhiteOverOther;
  const double walk = fit.markov ? fit.markov->walk_dps_rts() : fit.walk_dps_rts.value;
  const double walk_hz = walk / (2.0 * std::numbers::pi * std::sqrt(white));
  const double flicker_hz =
      fit.flicker_dps.value * fit.flicker_dps.value / (2.0 * std::numbers::pi * white);
  return std::max(walk_hz, flicker_hz);
}

struct Products {
  double first = 0.0;
  double second = 0.0;
  double cross = 0.0;
  double count = 0.0;
};

// Steps of white noise grow with the frequency, so every coefficient is divided by that gain.
void add_products(std::span<const double> y1, std::span<const double> y2, double interval_s,
                  double from_hz, double to_hz, Products& sum) {
  const std::vector<double> z1 = step_sine_transform(y1);
  const std::vector<double> z2 = step_sine_transform(y2);
  const double spacing_hz = 0.5 / (static_cast<double>(y1.size()) * interval_s);
  for (std::size_t i = 0; i < z1.size(); ++i) {
    const double frequency_hz = spacing_hz * static_cast<double>(i + 1);
    if (frequency_hz < from_hz || frequency_hz > to_hz) continue;
    const double half = std::sin(std::numbers::pi * frequency_hz * interval_s);
    const double gain = 1.0 / (half * half);
    sum.first += gain * z1[i] * z1[i];
    sum.second += gain * z2[i] * z2[i];
    sum.cross += gain * z1[i] * z2[i];
    sum.count += 1.0;
  }
}

std::optional<Correlation> correlate(const std::array<Series, 2>& paired, double from_hz,
                                     double to_hz) {
  Products sum;
  for (std::size_t p = 0; p < paired[0].parts.size(); ++p) {
    const std::span<const double> y1 = paired[0].parts[p].rate_dps;
    const std::span<const double> y2 = paired[1].parts[p].rate_dps;
    for (std::size_t begin = 0; begin + kValuesMin <= y1.size(); begin += kPiece) {
      const std::size_t size = smooth_size(std::min(kPiece, y1.size() - begin));
      add_products(y1.subspan(begin, size), y2.subspan(begin, size), paired[0].interval_s, from_hz,
                   to_hz, sum);
    }
  }
  if (sum.count < kCoefficientsForCorrelation || sum.first <= 0.0 || sum.second <= 0.0) return {};
  const double value = sum.cross / std::sqrt(sum.first * sum.second);
  return Correlation{value, (1.0 - value * value) / std::sqrt(sum.count)};
}

std::optional<Correlation> white_correlation(const PairNoise& noise,
                                             const std::array<Series, 2>& paired) {
  for (const SeriesNoise& gyro : noise.gyros) {
    if (!gyro.fit || gyro.hidden_by_step) return {};
  }
  double from_hz = 0.0;
  double to_hz = kShareOfRate / paired[0].interval_s;
  for (const SeriesNoise& gyro : noise.gyros) {
    from_hz = std::max(from_hz, white_from_hz(*gyro.fit));
    to_hz = std::min(to_hz, gyro.fit->frequency_max_hz);
  }
  return correlate(paired, from_hz, to_hz);
}

}  // namespace

PairNoise judge_pair(const PairRecording& recording) {
  PairNoise noise;
  noise.motion = find_motion(recording.paired, recording.step_dps);
  const auto resting = [&](const Series& series) {
    const bool partly = noise.motion.rest && !noise.motion.at_rest;
    return partly ? slice(series, noise.motion.rest->from_s, noise.motion.rest->to_s) : series;
  };
  for (std::size_t i = 0; i < 2; ++i) {
    noise.step_dps[i] = recording.step_dps[i];
    noise.gyros[i] =
        judge_gyro(resting(recording.own[i]), noise.step_dps[i], noise.motion.rest.has_value());
  }
  const Difference judged = difference(recording.paired, noise.motion);
  noise.removed = judged.removed;
  noise.difference = judge(judged.series, recording.interpolation_gain, true);
  if (noise.motion.rest) {
    noise.correlation =
        white_correlation(noise, {resting(recording.paired[0]), resting(recording.paired[1])});
  }
  return noise;
}

}  // namespace vgyro::analysis
