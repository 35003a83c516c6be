#include "gap/wiener.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::gap {
namespace {

constexpr double kInterval_s = 0.01;
constexpr std::size_t kSamples = 12000;
constexpr double kMotion_hz = 1.5;
constexpr std::uint64_t kSeed = 71;

double motion_dps(double t_s) {
  return std::sin(2.0 * std::numbers::pi * kMotion_hz * t_s);
}

// One motion, read with white noise of `sigma_dps`.
SampledCurve reading(double sigma_dps, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, sigma_dps);
  std::vector<double> t_s;
  std::vector<double> rate_dps;
  for (std::size_t i = 0; i < kSamples; ++i) {
    t_s.push_back(kInterval_s * static_cast<double>(i));
    rate_dps.push_back(motion_dps(t_s.back()) + normal(random));
  }
  return {t_s, rate_dps};
}

// Mean square about the motion, so long behind each sample, away from the ends.
double error_of(const SampledCurve& curve, double behind_s) {
  double sum = 0.0;
  constexpr std::size_t kEdge = 500;
  for (std::size_t i = kEdge; i < kSamples - kEdge; ++i) {
    const double t_s = kInterval_s * static_cast<double>(i) + behind_s;
    sum += std::pow(curve.value_at(t_s) - motion_dps(t_s), 2);
  }
  return sum / static_cast<double>(kSamples - 2 * kEdge);
}

TEST(WhereItMoves, KeepsMotionAndNoiseOfItsFrequenciesAndNothingElse) {
  constexpr double kSigma_dps = 0.05;
  constexpr double kJudge_dps = 0.02;
  constexpr double kLeast = 2.0 * kJudge_dps * kJudge_dps;
  const SampledCurve curve =
      where_it_moves(reading(kSigma_dps, kSeed), reading(kJudge_dps, kSeed + 1), kLeast);
  const double at_samples = error_of(curve, 0.0);
  // A line leaks into some frequencies on either side of it: eight of the 128 below half the rate.
  constexpr double kShare = 8.0 / 128.0;
  EXPECT_LT(at_samples, 1.5 * kShare * kSigma_dps * kSigma_dps) << "seed " << kSeed;
  EXPECT_GT(at_samples, 0.3 * kShare * kSigma_dps * kSigma_dps) << "seed " << kSeed;
  // Between the samples it scatters as at them: no lateness makes its noise less.
  EXPECT_NEAR(error_of(curve, 0.5 * kInterval_s) / at_samples, 1.0, 0.01);
}

TEST(WhereItMoves, IsTheReadingWhereAllFrequenciesMove) {
  constexpr double kSigma_dps = 0.05;
  const SampledCurve read = reading(kSigma_dps, kSeed);
  const SampledCurve curve = where_it_moves(read, read, 0.0);
  double sum = 0.0;
  for (const double t_s : read.times_s())
    sum += std::pow(curve.value_at(t_s) - read.value_at(t_s), 2);
  // But for what lies on half the sampling rate itself, one frequency of 129.
  EXPECT_LT(sum / kSamples, 2.0 / 129.0 * kSigma_dps * kSigma_dps);
}

TEST(WithoutNoise, LeavesTheMotion) {
  constexpr double kSigma_dps = 0.05;
  const SampledCurve curve = without_noise(reading(kSigma_dps, kSeed), kSigma_dps * kSigma_dps);
  EXPECT_LT(error_of(curve, 0.0), 0.25 * kSigma_dps * kSigma_dps) << "seed " << kSeed;
}

TEST(WithoutNoise, OfNoCurveIsNone) {
  EXPECT_TRUE(without_noise({}, 1.0).empty());
  EXPECT_TRUE(where_it_moves({}, {}, 1.0).empty());
}

}  // namespace
}  // namespace vgyro::gap
