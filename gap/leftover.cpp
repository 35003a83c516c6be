#include "gap/leftover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numeric>

#include <fmt/core.h>
#include <unsupported/Eigen/FFT>

#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Kind;

constexpr double kChunk_s = 10.0;
constexpr double kFastSigmas = 7.0;
constexpr double kSlowSigmas = 5.5;
constexpr double kColourSigmas = 6.5;
constexpr double kLowSigmas = 5.0;
constexpr double kHeavySigmas = 4.5;
constexpr double kSlopeSigmas = 4.0;
constexpr double kQuickDrift_s = 3.0;
constexpr double kSpikySigmas = 8.0;
constexpr double kSmallShare = 0.03;

// Blocks that are summed.
constexpr std::array<std::size_t, 4> kSpans{1, 5, 20, 60};

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
  if (n < 30.0 || second <= 0.0) return 0.0;
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

struct Judgement {
  double fast = 0.0;  ///< worst stretch's excess of scatter within blocks
  Where fast_at;
  double slow = 0.0;  ///< worst stretch's excess of the drift filter's innovations
  Where slow_at;
  double colour = 0.0;  ///< of neighbouring samples
  double spiky = 0.0;   ///< excess of the samples' fourth powers over a Gaussian's
  double heavy = 0.0;   ///< excess of fourth powers in sums of innovations over a Gaussian's
  double low = 0.0;     ///< excess of low frequencies in the innovations
  double slope = 0.0;   ///< of the innovations' spectrum there
};

bool concerns(Channel channel, std::size_t gyro) {
  return share_of(channel, gyro) != 0.0;
}

Judgement judge(const Study& study, const Problem& problem, std::size_t gyro,
                const std::vector<model::Effect>& effects) {
  Judgement verdict;
  const PairNoise noise = noise_of(effects);
  Matrix within = study.residual(problem, effects);
  Matrix means = block_means(within, problem.layout);
  whiten_within(within, problem.layout, noise, Part::kAll);
  whiten_means(means, problem.layout, noise, Part::kAll);
  const auto chunks = static_cast<std::size_t>(study.recording().seconds / kChunk_s) + 1;
  std::vector<double> fast(chunks, 0.0), fast_n(chunks, 0.0), slow(chunks, 0.0),
      slow_n(chunks, 0.0);
  std::vector<double> innovations;
  std::vector<double> samples;
  double product = 0.0;
  double expected = 0.0;
  double pairs = 0.0;
  for (std::size_t b = 0; b < problem.layout.blocks.size(); ++b) {
    const Block& block = problem.layout.blocks[b];
    if (!concerns(block.channel, gyro)) continue;
    const auto chunk =
        std::min(chunks - 1, static_cast<std::size_t>(std::max(0.0, block.t_s) / kChunk_s));
    const auto rows = within.col(0).segment(block.first, block.count);
    fast[chunk] += rows.squaredNorm();
    fast_n[chunk] += static_cast<double>(block.count - 1);
    const double innovation = means(static_cast<Eigen::Index>(b), 0);
    slow[chunk] += innovation * innovation;
    slow_n[chunk] += 1.0;
    innovations.push_back(innovation);
    // Interpolation colours a difference.
    if (block.channel == Channel::kDifference || block.count < 5) continue;
    for (const double value : rows)
      samples.push_back(value);
    const double scale = rows.squaredNorm() / static_cast<double>(block.count - 1);
    for (Eigen::Index i = 0; i + 1 < rows.size(); ++i)
      product += rows[i] * rows[i + 1];
    // Taking off the mean leaves −σ²/n in each product.
    expected -= static_cast<double>(block.count - 1) * scale / static_cast<double>(block.count);
    // Drift within a block is common to neighbours.
    expected += static_cast<double>(block.count - 1) * scale *
                (1.0 - sample_variance(block, noise, problem.layout) /
                           within_variance(block, noise, problem.layout)) *
                0.5;
    pairs += static_cast<double>(block.count - 1) * scale * scale;
  }
  for (std::size_t i = 0; i < chunks; ++i) {
    const Where where{kChunk_s * static_cast<double>(i),
                      std::min(study.recording().seconds, kChunk_s * static_cast<double>(i + 1)),
                      0.0, 0.0};
    const double fast_z = std::abs(sigmas(fast[i], fast_n[i]));
    if (fast_z > verdict.fast) verdict.fast = fast_z, verdict.fast_at = where;
    const double slow_z = std::abs(sigmas(slow[i], slow_n[i]));
    if (slow_z > verdict.slow) verdict.slow = slow_z, verdict.slow_at = where;
  }
  if (pairs > 0.0) verdict.colour = std::abs(product - expected) / std::sqrt(pairs);
  verdict.spiky = heaviness(samples);
  if (innovations.size() < 64) return verdict;
  // What comes and goes shows in sums over the time that it takes.
  for (const std::size_t span : kSpans) {
    std::vector<double> sums;
    for (std::size_t i = 0; i + span <= innovations.size(); i += span) {
      sums.push_back(std::accumulate(innovations.begin() + static_cast<std::ptrdiff_t>(i),
                                     innovations.begin() + static_cast<std::ptrdiff_t>(i + span),
                                     0.0));
    }
    verdict.heavy = std::max(verdict.heavy, heaviness(sums));
  }
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  std::size_t length = 1;
  while (2 * length <= innovations.size())
    length *= 2;
  innovations.resize(length);
  transform.fwd(spectrum, innovations);
  for (const std::size_t count : {std::size_t{6}, std::size_t{20}, std::size_t{60}, length / 4}) {
    double power = 0.0;
    const std::size_t most = std::min(count, length / 2 - 1);
    for (std::size_t i = 1; i <= most; ++i)
      power += 2.0 * std::norm(spectrum[i]) / static_cast<double>(length);
    verdict.low = std::max(verdict.low, std::abs(sigmas(power, 2.0 * static_cast<double>(most))));
  }
  std::vector<double> periodogram(length / 2);
  for (std::size_t i = 0; i < periodogram.size(); ++i)
    periodogram[i] = std::norm(spectrum[i]) / static_cast<double>(length);
  for (const std::size_t count : {std::size_t{15}, std::size_t{40}, std::size_t{120}}) {
    const double slope = slope_of(periodogram, std::min(count, periodogram.size() - 1));
    if (std::abs(slope) > std::abs(verdict.slope)) verdict.slope = slope;
  }
  return verdict;
}

std::string_view signature_of(Kind kind) {
  switch (kind) {
    case Kind::kLine:
      return "line";
    case Kind::kBiasStep:
      return "steps";
    case Kind::kScaleFactor:
    case Kind::kScaleFactorAsymmetry:
    case Kind::kScaleFactorQuadratic:
    case Kind::kScaleFactorCubic:
    case Kind::kScaleFactorTemperature:
    case Kind::kDelay:
    case Kind::kBandwidth:
    case Kind::kClockSkew:
    case Kind::kAngleHarmonic:
      return "rate";
    case Kind::kTemperatureBias:
    case Kind::kTemperatureBiasQuadratic:
    case Kind::kTemperatureRateBias:
      return "temperature";
    case Kind::kGSensitivity:
    case Kind::kVibrationRectification:
      return "acceleration";
    default:
      return "slow";
  }
}

Unexplained resembling(const Found& one, double seconds) {
  const model::Effect& effect = one.term.effect;
  Unexplained left;
  left.signature = signature_of(effect.kind);
  left.gyro = effect.gyro;
  left.to_s = seconds;
  if (effect.kind == Kind::kLine) {
    left.frequency_hz = effect.parameters[0];
    left.amplitude_dps = std::abs(effect.parameters[1]);
    left.text = fmt::format("line near {:.4g} Hz, {:.2g} deg/s, not steady", effect.parameters[0],
                            std::abs(effect.parameters[1]));
  } else {
    left.text = fmt::format("resembles {} ({}), but does not keep its size through the recording",
                            model::info(effect.kind).name, model::parameters_text(effect));
    if (effect.kind == Kind::kBiasStep) {
      left.from_s = effect.parameters[1];
      left.amplitude_dps = std::abs(effect.parameters[0]);
      left.text = fmt::format("one of several steps: {:.3g} deg/s at {:.1f} s",
                              effect.parameters[0], effect.parameters[1]);
    }
  }
  return left;
}

}  // namespace

std::vector<Unexplained> leftovers(const Study& study, const Search& search,
                                   std::vector<Found>& found) {
  std::vector<Unexplained> list;
  const double seconds = study.recording().seconds;
  for (const Found& one : search.rejected())
    list.push_back(resembling(one, seconds));
  // Noise that was named must leave innovations that are white and alike throughout.
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    // The rounding of slow readings is neither white nor alike throughout.
    if (study.is_coarse(gyro)) continue;
    const Problem& problem = study.problems()[study.problem_of(gyro)];
    std::vector<model::Effect> effects = search.effects();
    const Judgement verdict = judge(study, problem, gyro, effects);
    const auto is_noise = [&](const Found& one, bool fast) {
      const Kind kind = one.term.effect.kind;
      if (one.term.effect.gyro != gyro) return false;
      return fast ? kind == Kind::kWhiteNoise || kind == Kind::kRateNoise
                  : kind == Kind::kRateRandomWalk || kind == Kind::kGaussMarkov;
    };
    const auto drop = [&](bool fast) {
      const auto end = std::stable_partition(
          found.begin(), found.end(), [&](const Found& one) { return !is_noise(one, fast); });
      double weight = 0.0;
      for (auto one = end; one != found.end(); ++one)
        weight += one->statistic;
      found.erase(end, found.end());
      // What is small beside something unknown may be a part of it.
      const auto small = std::stable_partition(found.begin(), found.end(), [&](const Found& one) {
        return one.term.effect.gyro != gyro || one.statistic > kSmallShare * weight;
      });
      for (auto one = small; one != found.end(); ++one)
        list.push_back(resembling(*one, seconds));
      found.erase(small, found.end());
    };
    // A drift of about a second's memory colours samples; its own variance within blocks says how
    // much only to a tenth or so.
    const bool quick_drift = std::any_of(found.begin(), found.end(), [&](const Found& one) {
      return one.term.effect.gyro == gyro && one.term.effect.kind == Kind::kGaussMarkov &&
             one.term.effect.parameters[1] < kQuickDrift_s;
    });
    const bool coloured = verdict.colour > (quick_drift ? 2.0 : 1.0) * kColourSigmas;
    if (verdict.fast > kFastSigmas || coloured || verdict.spiky > kSpikySigmas) {
      drop(true);
      Unexplained left;
      left.signature = "noise";
      left.gyro = gyro;
      if (coloured) {
        left.to_s = seconds;
        left.text = fmt::format(
            "neighbouring samples hang together, by {:.0f} standard errors: the "
            "noise is not white",
            verdict.colour);
        // Coloured fast noise is no drift either.
        drop(false);
      } else if (verdict.spiky > kSpikySigmas) {
        left.to_s = seconds;
        left.signature = "outliers";
        left.text = fmt::format(
            "single samples stand out of the noise, by {:.0f} standard errors of their fourth "
            "power",
            verdict.spiky);
      } else {
        left.from_s = verdict.fast_at.from_s;
        left.to_s = verdict.fast_at.to_s;
        left.text = fmt::format(
            "the noise is another one from {:.0f} to {:.0f} s, by {:.0f} standard errors",
            left.from_s, left.to_s, verdict.fast);
      }
      list.push_back(std::move(left));
    }
    if (verdict.slow > kSlowSigmas || verdict.low > kLowSigmas || verdict.heavy > kHeavySigmas ||
        std::abs(verdict.slope) > kSlopeSigmas) {
      drop(false);
      Unexplained left;
      const bool bursts = verdict.slow > kSlowSigmas || verdict.heavy > kHeavySigmas;
      left.signature = bursts ? "bursts" : "slow";
      left.gyro = gyro;
      left.from_s = bursts ? verdict.slow_at.from_s : 0.0;
      left.to_s = bursts ? verdict.slow_at.to_s : seconds;
      left.text =
          verdict.slow > kSlowSigmas
              ? fmt::format(
                    "the drift moves more than its noise allows, most from {:.0f} to {:.0f} s",
                    left.from_s, left.to_s)
              : std::string(
                    "a slow drift that no random walk and none of the recorded "
                    "quantities follows");
      list.push_back(std::move(left));
    }
  }
  return list;
}

}  // namespace vgyro::gap
