#include "gap/whiteness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numeric>

#include <unsupported/Eigen/FFT>

namespace vgyro::gap {

namespace {

constexpr double kChunk_s = 10.0;
// Beyond what chance reaches over all that is looked at: many stretches, one sum.
constexpr double kFastSigmas = 7.0;
constexpr double kSlowSigmas = 5.5;
constexpr double kColourSigmas = 6.5;
constexpr double kLowSigmas = 5.0;
constexpr double kHeavySigmas = 4.5;
constexpr double kSlopeSigmas = 4.0;
constexpr double kSpikySigmas = 8.0;
constexpr double kQuickDriftFactor = 2.0;
// Blocks that are summed: what comes and goes shows in sums over the time that it takes.
constexpr std::array<std::size_t, 4> kSpans{1, 5, 20, 60};
// Lowest frequencies that are summed, and those whose slope is taken; the quarter of all besides.
constexpr std::array<std::size_t, 3> kLowest{6, 20, 60};
constexpr std::array<std::size_t, 3> kSlopes{15, 40, 120};
constexpr std::size_t kInnovationsMin = 64;
constexpr double kFourthPowersMin = 30.0;
// Road noise is louder and quieter within a second: where motion between the samples is more than
// this share of a mean's variance, fourth powers are its own.
constexpr double kUnseenShare = 0.1;
// A block with fewer samples tells little of neighbours.
constexpr std::uint32_t kNeighboursMin = 5;

// (χ² − n) in standard deviations, by Wilson and Hilferty's cube root.
double sigmas(double chi_square, double freedom) {
  if (freedom < 1.0) return 0.0;
  const double spread = 2.0 / (9.0 * freedom);
  return (std::cbrt(chi_square / freedom) - (1.0 - spread)) / std::sqrt(spread);
}

// Excess of fourth powers over a Gaussian's, in standard deviations, by Anscombe and Glynn.
double heaviness(const std::vector<double>& values) {
  const double n = static_cast<double>(values.size());
  double second = 0.0;
  double fourth = 0.0;
  for (const double value : values) {
    const double square = value * value;
    second += square;
    fourth += square * square;
  }
  if (n < kFourthPowersMin || second <= 0.0) return 0.0;
  const double kurtosis = n * fourth / (second * second);
  const double mean = 3.0 * (n - 1.0) / (n + 1.0);
  const double variance =
      24.0 * n * (n - 2.0) * (n - 3.0) / ((n + 1.0) * (n + 1.0) * (n + 3.0) * (n + 5.0));
  const double skew = 6.0 * (n * n - 5.0 * n + 2.0) / ((n + 7.0) * (n + 9.0)) *
                      std::sqrt(6.0 * (n + 3.0) * (n + 5.0) / (n * (n - 2.0) * (n - 3.0)));
  const double a = 6.0 + 8.0 / skew * (2.0 / skew + std::sqrt(1.0 + 4.0 / (skew * skew)));
  const double x = (kurtosis - mean) / std::sqrt(variance);
  const double root = 1.0 + x * std::sqrt(2.0 / (a - 4.0));
  if (root <= 0.0) return -kHeavySigmas;
  return (1.0 - 2.0 / (9.0 * a) - std::cbrt((1.0 - 2.0 / a) / root)) / std::sqrt(2.0 / (9.0 * a));
}

// Of white innovations, whose spectrum should not fall or rise: how far its lowest `count`
// frequencies do, in standard deviations; negative where it falls.
double slope_of(const std::vector<double>& power, std::size_t count) {
  double mean = 0.0;
  for (std::size_t i = 1; i <= count; ++i)
    mean += std::log(static_cast<double>(i)) / static_cast<double>(count);
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 1; i <= count; ++i) {
    const double weight = std::log(static_cast<double>(i)) - mean;
    sum += weight * (power[i] - 1.0);
    squares += weight * weight;
  }
  return sum / std::sqrt(squares);
}

// What blocks bring, summed by stretches of time and over all.
struct Sums {
  struct Stretch {
    double fast = 0.0;
    double fast_freedom = 0.0;
    double slow = 0.0;
    double slow_freedom = 0.0;
  };
  std::vector<Stretch> stretches;
  std::vector<double> innovations;
  std::vector<double> steady;  ///< of these, where hardly any motion is unseen
  std::vector<double> samples;
  double product = 0.0;  ///< of neighbours
  double expected = 0.0;
  double pairs = 0.0;
};

// Neighbours' products. Taking off the mean leaves −σ²/n in each; drift within a block is common
// to neighbours.
template <class Rows>
void add_neighbours(const Block& block, const Rows& rows, double white_share, Sums& sums) {
  for (const double value : rows)
    sums.samples.push_back(value);
  const double freedom = block.count - 1.0;
  const double scale = rows.squaredNorm() / freedom;
  for (Eigen::Index i = 0; i + 1 < rows.size(); ++i)
    sums.product += rows[i] * rows[i + 1];
  sums.expected -= freedom * scale / static_cast<double>(block.count);
  sums.expected += freedom * scale * (1.0 - white_share) * 0.5;
  sums.pairs += freedom * scale * scale;
}

Sums sums_of(const Observations& data, std::size_t gyro, const Effects& effects) {
  const PairNoise noise = noise_of(effects);
  Matrix within = data.residual(effects);
  Matrix means = block_means(within, data.layout);
  whiten_within(within, data.layout, noise, Part::kAll);
  whiten_means(means, data.layout, noise, Part::kAll);
  Sums sums;
  sums.stretches.resize(static_cast<std::size_t>(data.about.seconds / kChunk_s) + 1);
  for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
    const Block& block = data.layout.blocks[b];
    if (share_of(block.channel, gyro) == 0.0) continue;
    const auto chunk = std::min(sums.stretches.size() - 1,
                                static_cast<std::size_t>(std::max(0.0, block.t_s) / kChunk_s));
    Sums::Stretch& stretch = sums.stretches[chunk];
    const auto rows = within.col(0).segment(block.first, block.count);
    stretch.fast += rows.squaredNorm();
    stretch.fast_freedom += block.kept;
    const double innovation = means(static_cast<Eigen::Index>(b), 0);
    stretch.slow += innovation * innovation;
    stretch.slow_freedom += 1.0;
    sums.innovations.push_back(innovation);
    const double unseen = data.layout.unseen.mean * block.motion_power;
    if (unseen <= kUnseenShare * mean_variance(block, noise, data.layout))
      sums.steady.push_back(innovation);
    // Interpolation colours a difference.
    if (block.channel == Channel::kDifference || block.count < kNeighboursMin) continue;
    if (block.motion_power > 0.0) continue;  // its rows are no samples
    add_neighbours(
        block, rows,
        sample_variance(block, noise, data.layout) / within_variance(block, noise, data.layout),
        sums);
  }
  return sums;
}

void find_worst_stretches(const Sums& sums, double seconds, Whiteness& whiteness) {
  for (std::size_t i = 0; i < sums.stretches.size(); ++i) {
    const Sums::Stretch& stretch = sums.stretches[i];
    const Where where{kChunk_s * static_cast<double>(i),
                      std::min(seconds, kChunk_s * static_cast<double>(i + 1)), 0.0, 0.0};
    const double fast = std::abs(sigmas(stretch.fast, stretch.fast_freedom));
    if (fast > whiteness.fast) whiteness.fast = fast, whiteness.fast_at = where;
    const double slow = std::abs(sigmas(stretch.slow, stretch.slow_freedom));
    if (slow > whiteness.slow) whiteness.slow = slow, whiteness.slow_at = where;
  }
}

double heaviest_sums(const std::vector<double>& innovations) {
  double heaviest = 0.0;
  for (const std::size_t span : kSpans) {
    std::vector<double> sums;
    for (std::size_t i = 0; i + span <= innovations.size(); i += span) {
      sums.push_back(std::accumulate(innovations.begin() + static_cast<std::ptrdiff_t>(i),
                                     innovations.begin() + static_cast<std::ptrdiff_t>(i + span),
                                     0.0));
    }
    heaviest = std::max(heaviest, heaviness(sums));
  }
  return heaviest;
}

// Power of each frequency, 1 for white innovations of variance 1; over the longest even beginning.
std::vector<double> spectrum_of(std::vector<double> innovations) {
  std::size_t length = 1;
  while (2 * length <= innovations.size())
    length *= 2;
  innovations.resize(length);
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, innovations);
  std::vector<double> power(length / 2);
  for (std::size_t i = 0; i < power.size(); ++i)
    power[i] = std::norm(spectrum[i]) / static_cast<double>(length);
  return power;
}

double low_excess(const std::vector<double>& power, std::size_t count) {
  const std::size_t most = std::min(count, power.size() - 1);
  double sum = 0.0;
  for (std::size_t i = 1; i <= most; ++i)
    sum += 2.0 * power[i];
  return std::abs(sigmas(sum, 2.0 * static_cast<double>(most)));
}

}  // namespace

Whiteness whiteness_of(const Observations& data, std::size_t gyro, const Effects& effects) {
  const Sums sums = sums_of(data, gyro, effects);
  Whiteness whiteness;
  find_worst_stretches(sums, data.about.seconds, whiteness);
  whiteness.soft = sums.product > sums.expected;
  if (sums.pairs > 0.0)
    whiteness.colour = std::abs(sums.product - sums.expected) / std::sqrt(sums.pairs);
  whiteness.spiky = heaviness(sums.samples);
  if (sums.innovations.size() < kInnovationsMin) return whiteness;
  whiteness.heavy = heaviest_sums(sums.steady);
  const std::vector<double> power = spectrum_of(sums.innovations);
  for (const std::size_t count : kLowest)
    whiteness.low = std::max(whiteness.low, low_excess(power, count));
  whiteness.low = std::max(whiteness.low, low_excess(power, power.size() / 2));
  for (const std::size_t count : kSlopes) {
    const double slope = slope_of(power, std::min(count, power.size() - 1));
    if (std::abs(slope) > std::abs(whiteness.slope)) whiteness.slope = slope;
  }
  return whiteness;
}

Flaws flaws_of(const Whiteness& whiteness, bool quick_drift) {
  Flaws flaws;
  flaws.coloured = whiteness.colour > (quick_drift ? kQuickDriftFactor : 1.0) * kColourSigmas;
  flaws.spiky = whiteness.spiky > kSpikySigmas;
  flaws.uneven = whiteness.fast > kFastSigmas;
  flaws.moves_too_much = whiteness.slow > kSlowSigmas;
  flaws.bursts = whiteness.slow > kSlowSigmas || whiteness.heavy > kHeavySigmas;
  flaws.wanders = whiteness.low > kLowSigmas || std::abs(whiteness.slope) > kSlopeSigmas;
  return flaws;
}

}  // namespace vgyro::gap
