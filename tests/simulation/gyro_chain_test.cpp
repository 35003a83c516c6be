#include "simulation/gyro_chain.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace vgyro::simulation {
namespace {

using model::Effect;
using model::Kind;

constexpr double kRate_hz = 100.0;
constexpr std::uint64_t kSeed = 5;
/// Tolerance of a measured figure in standard errors.
constexpr double kSigmas = 4.0;

struct Instant {
  double rate_dps = 0.0;
  model::Surroundings surroundings;
};

std::vector<Instant> turning(double rate_dps, std::size_t count) {
  std::vector<Instant> instants(count);
  for (std::size_t i = 0; i < count; ++i)
    instants[i] = {rate_dps, {.t_s = static_cast<double>(i) / kRate_hz}};
  return instants;
}

std::vector<double> read(const std::vector<Effect>& effects, const std::vector<Instant>& instants,
                         std::uint64_t seed = kSeed) {
  GyroChain chain(effects, 1.0 / kRate_hz, seed);
  std::vector<double> readings;
  for (const Instant& instant : instants)
    readings.push_back(chain.next(instant.rate_dps, instant.surroundings));
  return readings;
}

double variance(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values)
    sum += value * value;
  return sum / static_cast<double>(values.size());
}

std::vector<double> differences(const std::vector<double>& values, std::size_t lag) {
  std::vector<double> result;
  for (std::size_t i = lag; i < values.size(); i += lag)
    result.push_back(values[i] - values[i - lag]);
  return result;
}

void expect_variance(const std::vector<double>& values, double wanted) {
  const double error = wanted * std::sqrt(2.0 / static_cast<double>(values.size()));
  EXPECT_NEAR(variance(values), wanted, kSigmas * error);
}

TEST(GyroChain, WithoutEffectsAreTheRate) {
  const auto values = read({}, turning(12.5, 10));
  EXPECT_EQ(values, std::vector<double>(10, 12.5));
}

TEST(GyroChain, WhiteNoiseHasItsDensity) {
  RecordProperty("seed", kSeed);
  const auto values =
      read({{.kind = Kind::kWhiteNoise, .parameters = {2e-4}}}, turning(0, 100'000));
  expect_variance(values, 2e-4 * 2e-4 * kRate_hz);
  expect_variance(differences(values, 1), 2.0 * 2e-4 * 2e-4 * kRate_hz);
}

TEST(GyroChain, RateNoiseGrowsWithTheRate) {
  auto values = read({{.kind = Kind::kRateNoise, .parameters = {1e-4}}}, turning(-30.0, 100'000));
  for (double& value : values)
    value += 30.0;
  expect_variance(values, 1e-4 * 30.0 * 1e-4 * 30.0 * kRate_hz);
}

TEST(GyroChain, ARandomWalkSpreadsWithTheRootOfTime) {
  const std::vector<Effect> walk{{.kind = Kind::kRateRandomWalk, .parameters = {1e-3}}};
  const auto values = read(walk, turning(0.0, 200'000));
  EXPECT_EQ(values.front(), 0.0) << "where it begins is a bias";
  for (const std::size_t lag : {std::size_t{1}, std::size_t{100}})
    expect_variance(differences(values, lag), 1e-6 * static_cast<double>(lag) / kRate_hz);
}

// The law of the walk is independent of the sampling instants.
TEST(GyroChain, ARandomWalkIsExactOverGaps) {
  std::vector<Instant> instants;
  for (int i = 0; i < 40'000; ++i)
    instants.push_back({0.0, {.t_s = std::floor(i / 2.0) * 1.0 + (i % 2) * 0.01}});
  const auto values = read({{.kind = Kind::kRateRandomWalk, .parameters = {1e-3}}}, instants);
  std::vector<double> near;
  std::vector<double> far;
  for (std::size_t i = 1; i < values.size(); ++i)
    (i % 2 == 1 ? near : far).push_back(values[i] - values[i - 1]);
  expect_variance(near, 1e-6 * 0.01);
  expect_variance(far, 1e-6 * 0.99);
}

TEST(GyroChain, GaussMarkovIsStationaryWithItsTimeConstant) {
  constexpr double kSigma = 3e-4;
  constexpr double kTau_s = 2.0;
  const std::vector<Effect> drift{{.kind = Kind::kGaussMarkov, .parameters = {kSigma, kTau_s}}};
  std::vector<double> firsts;
  std::vector<double> products;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    const auto values = read(drift, turning(0.0, 101), seed);
    firsts.push_back(values.front());
    products.push_back(values.front() * values.back());
  }
  expect_variance(firsts, kSigma * kSigma);
  double mean = 0.0;
  for (const double product : products)
    mean += product / static_cast<double>(products.size());
  const double share = std::exp(-1.0 / kTau_s);
  const double error =
      kSigma * kSigma * std::sqrt((1.0 + share * share) / static_cast<double>(products.size()));
  EXPECT_NEAR(mean, kSigma * kSigma * share, kSigmas * error);
}

TEST(GyroChain, SpikesComeAsOftenAsTheyShouldWithBothSigns) {
  const auto values =
      read({{.kind = Kind::kSpikes, .parameters = {0.5, 7.0}}}, turning(0, 400'000));
  const auto up = std::count(values.begin(), values.end(), 7.0);
  const auto down = std::count(values.begin(), values.end(), -7.0);
  EXPECT_EQ(std::count(values.begin(), values.end(), 0.0) + up + down, 400'000);
  EXPECT_NEAR(static_cast<double>(up + down), 2000.0, kSigmas * std::sqrt(2000.0) + 5.0);
  EXPECT_NEAR(static_cast<double>(up - down), 0.0, kSigmas * std::sqrt(2000.0));
}

TEST(GyroChain, ClipsComeLastAndInTheirOrder) {
  // 9.87 + 0.5 → saturated at 10 → above the dead band → rounded to 0.3.
  const std::vector<Effect> effects{{.kind = Kind::kQuantization, .parameters = {0.3}},
                                    {.kind = Kind::kDeadBand, .parameters = {1.0}},
                                    {.kind = Kind::kSaturation, .parameters = {10.0}},
                                    {.kind = Kind::kBias, .parameters = {0.5}}};
  EXPECT_NEAR(read(effects, turning(9.87, 1)).front(), 9.9, 1e-12);
  EXPECT_EQ(read(effects, turning(0.4, 1)).front(), 0.0) << "0.9 lies in the dead band";
  EXPECT_NEAR(read(effects, turning(0.52, 1)).front(), 0.9, 1e-12) << "1.02 does not";
}

TEST(GyroChain, AStuckGyroRepeatsWhatItSaidLast) {
  const auto values = read({{.kind = Kind::kWhiteNoise, .parameters = {1e-3}},
                            {.kind = Kind::kStuck, .parameters = {0.1, 0.2}}},
                           turning(0.0, 40));
  const auto free = read({{.kind = Kind::kWhiteNoise, .parameters = {1e-3}}}, turning(0.0, 40));
  for (std::size_t i = 0; i < 40; ++i)
    EXPECT_EQ(values[i], i >= 10 && i < 20 ? free[9] : free[i]) << i;
}

TEST(GyroChain, OneMoreEffectLeavesTheOthersNoiseAsItIs) {
  const Effect white{.kind = Kind::kWhiteNoise, .parameters = {1e-3}};
  const Effect walk{.kind = Kind::kRateRandomWalk, .parameters = {1e-3}};
  const Effect spikes{.kind = Kind::kSpikes, .parameters = {1.0, 1.0}};
  const auto alone = read({white}, turning(0.0, 500));
  const auto both = read({spikes, walk, white}, turning(0.0, 500));
  const auto others = read({spikes, walk}, turning(0.0, 500));
  for (std::size_t i = 0; i < alone.size(); ++i)
    EXPECT_NEAR(both[i], alone[i] + others[i], 1e-14);
  Effect second = white;
  second.gyro = 1;
  EXPECT_NE(read({second}, turning(0.0, 500)), alone) << "the gyros' noises are their own";
  EXPECT_NE(read({white}, turning(0.0, 500), kSeed + 1), alone);
  EXPECT_EQ(read({white}, turning(0.0, 500)), alone);
}

}  // namespace
}  // namespace vgyro::simulation
