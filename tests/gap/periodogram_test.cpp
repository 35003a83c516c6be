#include "gap/periodogram.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

constexpr double kSigmas = 4.0;
// Slower is drift, and no line; what is taken off reaches somewhat further up.
constexpr double kLineLow_hz = 0.02;
constexpr double kNoDrift_hz = 0.5;

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = 80.0;
  making.walk_dps_rts.fill(0.0);
  making.seed = seed;
  return making;
}

Making quiet(std::uint64_t seed) {
  Making making = making_of(seed);
  making.white_dps_rthz.fill(0.0);
  return making;
}

PairNoise white_noise() {
  return noise_of(noise_effects(making_of(0)));
}

double sample_variance_of(std::size_t gyro) {
  const Making making = making_of(0);
  return std::pow(making.white_dps_rthz[gyro], 2) / making.interval_s;
}

Periodogram periodogram_of(const Observations& data, Part part = Part::kAll) {
  return gap::periodogram_of(data, data.observed_dps, white_noise(), part);
}

double statistic(const Periodogram& periodogram, std::size_t place) {
  return 2.0 * periodogram.power[place] / periodogram.weight;
}

// Mean 2 and variance 4, each frequency by itself: every second place is independent.
TEST(Periodogram, OfWhiteNoiseIsChiSquareWithTwoDegreesOfFreedom) {
  for (const std::uint64_t seed : {141U, 142U, 143U}) {
    const Periodogram periodogram = periodogram_of(*observations_of_one(making_of(seed)));
    double sum = 0.0;
    double squares = 0.0;
    double count = 0.0;
    double above_six = 0.0;
    for (std::size_t i = 1; i < periodogram.power.size(); i += 3) {
      if (static_cast<double>(i) * periodogram.resolution_hz < kNoDrift_hz) continue;
      const double value = statistic(periodogram, i);
      sum += value;
      squares += value * value;
      above_six += value > 6.0 ? 1.0 : 0.0;
      count += 1.0;
    }
    EXPECT_NEAR(sum / count, 2.0, kSigmas * 2.0 / std::sqrt(count)) << "seed " << seed;
    // ⟨x²⟩ is 8, of standard deviation √(384 − 64).
    EXPECT_NEAR(squares / count, 8.0, kSigmas * std::sqrt(320.0 / count)) << "seed " << seed;
    const double tail = std::exp(-3.0);
    EXPECT_NEAR(above_six / count, tail, kSigmas * std::sqrt(tail / count)) << "seed " << seed;
  }
}

// |Σ w e exp|² · 2/Σw of A·sin on a frequency of the grid: A²·n/(2σ²).
TEST(Periodogram, OfASineIsItsSquareTimesTheSamplesOverTwiceTheVariance) {
  Making making = quiet(144);
  const double resolution_hz = periodogram_of(*observations_of_one(making)).resolution_hz;
  constexpr double kAmplitude_dps = 2e-3;
  for (const double about_hz : {1.0, 9.0, 33.0}) {
    const double place = std::round(about_hz / resolution_hz);
    const double frequency_hz = place * resolution_hz;
    making.error = [&](std::size_t, double t_s, double) {
      return kAmplitude_dps * std::sin(2.0 * kPi * frequency_hz * t_s + 0.4);
    };
    const auto data = observations_of_one(making);
    const Periodogram periodogram = periodogram_of(*data);
    const auto samples = static_cast<double>(data->size());
    const double truth = kAmplitude_dps * kAmplitude_dps * samples / (2.0 * sample_variance_of(0));
    // The running mean takes a hundredth at 1 Hz, and the ends of the recording no whole periods.
    EXPECT_NEAR(statistic(periodogram, static_cast<std::size_t>(place)) / truth, 1.0, 0.03)
        << about_hz;
    const auto peaks = highest_peaks(periodogram, 1);
    ASSERT_EQ(peaks.size(), 1U);
    EXPECT_NEAR(peaks[0].frequency_hz, frequency_hz, 1e-9);
    EXPECT_EQ(peaks[0].statistic, statistic(periodogram, static_cast<std::size_t>(place)));
  }
}

TEST(Periodogram, OfTwoSinesHasTwoPeaksTheHigherFirst) {
  Making making = making_of(145);
  making.error = [](std::size_t, double t_s, double) {
    return 2e-3 * std::sin(2.0 * kPi * 5.0 * t_s) + 3e-3 * std::sin(2.0 * kPi * 21.0 * t_s);
  };
  const Periodogram periodogram = periodogram_of(*observations_of_one(making));
  const auto peaks = highest_peaks(periodogram, 100);
  ASSERT_EQ(peaks.size(), 100U);
  EXPECT_NEAR(peaks[0].frequency_hz, 21.0, periodogram.resolution_hz);
  const auto at_five = std::find_if(peaks.begin(), peaks.end(), [](const auto& peak) {
    return std::abs(peak.frequency_hz - 5.0) < 0.02;
  });
  EXPECT_NE(at_five, peaks.end());
  for (std::size_t i = 1; i < peaks.size(); ++i)
    EXPECT_GE(peaks[i - 1].statistic, peaks[i].statistic);
  EXPECT_EQ(highest_peaks(periodogram, 1).size(), 1U);
  EXPECT_TRUE(highest_peaks(periodogram, 0).empty());
  EXPECT_TRUE(highest_peaks(Periodogram{}, 3).empty());
}

TEST(Periodogram, DriftIsNoPeak) {
  Making making = making_of(146);
  making.seconds = 160.0;
  making.error = [](std::size_t, double t_s, double) {
    return 0.5 + 0.02 * std::sin(2.0 * kPi * 0.008 * t_s);
  };
  const Periodogram periodogram = periodogram_of(*observations_of_one(making));
  // Of eight thousand frequencies of noise one reaches 2·log of their number and some.
  const double chance = 2.0 * std::log(periodogram.frequencies) + 12.0;
  for (const auto& peak : highest_peaks(periodogram, 20)) {
    EXPECT_GT(peak.frequency_hz, kLineLow_hz);
    EXPECT_LT(peak.statistic, chance) << peak.frequency_hz;
  }
}

// Twice as many frequencies as are independent, at the least, up to half the sampling rate.
TEST(Periodogram, ResolvesWhatTheRecordingDoes) {
  const Making making = making_of(147);
  const auto data = observations_of_one(making);
  const Periodogram periodogram = periodogram_of(*data);
  EXPECT_LE(periodogram.resolution_hz, 0.5 / making.seconds + 1e-12);
  EXPECT_NEAR(static_cast<double>(periodogram.power.size()) * periodogram.resolution_hz,
              0.5 / making.interval_s, periodogram.resolution_hz);
  EXPECT_NEAR(periodogram.frequencies, 0.5 * making.seconds / making.interval_s, 1e-6);
  const auto samples = static_cast<double>(data->size());
  EXPECT_NEAR(periodogram.weight / (samples / sample_variance_of(0)), 1.0, 1e-9);
}

// What is set aside counts nothing, and what is left to be fitted is the rest.
TEST(Periodogram, LooksAtItsPartAlone) {
  const auto data = observations_of_one(making_of(148));
  const double all = periodogram_of(*data).weight;
  const double fit = periodogram_of(*data, Part::kFit).weight;
  const double held_out = periodogram_of(*data, Part::kHeldOut).weight;
  EXPECT_NEAR(fit + held_out, all, 1e-9 * all);
  EXPECT_LT(held_out, 0.5 * all);
  auto loud = std::make_shared<Observations>(*data);
  for (const Block& block : loud->layout.blocks) {
    if (block.held_out) loud->observed_dps.segment(block.first, block.count).setConstant(100.0);
  }
  EXPECT_EQ(periodogram_of(*loud, Part::kFit).power, periodogram_of(*data, Part::kFit).power);
}

// At rest the second gyro shows what the difference shows with the other sign: a line of it goes on
// through both.
TEST(Periodogram, LineOfTheSecondGyroGoesOnFromRestIntoTheDifference) {
  Making making = quiet(149);
  making.rest_s = 40.0;
  constexpr double kAmplitude_dps = 2e-3;
  const double frequency_hz =
      std::round(9.0 / periodogram_of(*observations_of_two(making)).resolution_hz) *
      periodogram_of(*observations_of_two(making)).resolution_hz;
  making.error = [&](std::size_t gyro, double t_s, double) {
    return gyro == 1 ? kAmplitude_dps * std::sin(2.0 * kPi * frequency_hz * t_s) : 0.0;
  };
  const Periodogram periodogram = periodogram_of(*observations_of_two(making));
  // Weights: at rest each gyro's variance, elsewhere the sum of both; the quiet gyro 1 dilutes.
  const double half = 0.5 * making.seconds / making.interval_s;
  const double rest = half / sample_variance_of(1);
  const double moving = half / (sample_variance_of(0) + sample_variance_of(1));
  const double amplitude = 0.5 * kAmplitude_dps * (rest + moving);
  const double truth = 2.0 * amplitude * amplitude / (rest + moving + half / sample_variance_of(0));
  const auto peaks = highest_peaks(periodogram, 1);
  ASSERT_EQ(peaks.size(), 1U);
  EXPECT_NEAR(peaks[0].frequency_hz, frequency_hz, 1e-9);
  EXPECT_NEAR(peaks[0].statistic / truth, 1.0, 0.05);
}

}  // namespace
}  // namespace vgyro::gap
