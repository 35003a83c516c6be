#include "gap/transport.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "made_recording.h"

namespace vgyro::gap {
namespace {

using model::Kind;

constexpr double kInterval_s = 0.01;
constexpr std::size_t kSamples = 20000;

// Gyro 1 of a recording of motion after rest, with a counter.
GyroSeries clean(std::uint64_t seed) {
  Making making;
  making.seconds = 200.0;
  making.seed = seed;
  GyroSeries series = make_recording(making).gyros[0];
  series.counter_modulus = 16;
  for (std::size_t i = 0; i < series.t_s.size(); ++i)
    series.counter.push_back(static_cast<std::uint32_t>(i % 16));
  return series;
}

const Finding* found(const Transport& transport, Kind kind) {
  for (const Finding& finding : transport.findings) {
    if (finding.effect.kind == kind) return &finding;
  }
  return nullptr;
}

TEST(Transport, FindsNothingInACleanSeries) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Transport transport = check_transport(clean(seed), 0, {});
    EXPECT_TRUE(transport.findings.empty())
        << "seed " << seed << ": " << transport.findings.front().evidence;
    EXPECT_EQ(transport.lost_share, 0.0);
    EXPECT_NEAR(transport.interval_s, kInterval_s, 1e-9);
    for (const std::uint8_t mask : transport.masked)
      EXPECT_EQ(mask, 0);
  }
}

TEST(Transport, CountsFramesThatNeverCame) {
  const GyroSeries whole = clean(4);
  std::mt19937_64 random(4);
  std::bernoulli_distribution lost(0.01);
  GyroSeries series = whole;
  series.t_s.clear(), series.rate_dps.clear(), series.counter.clear();
  std::size_t missing = 0;
  for (std::size_t i = 0; i < whole.t_s.size(); ++i) {
    // The first and last are there, so that all losses can be counted.
    if (i > 0 && i + 1 < whole.t_s.size() && lost(random)) {
      ++missing;
      continue;
    }
    series.t_s.push_back(whole.t_s[i]);
    series.rate_dps.push_back(whole.rate_dps[i]);
    series.counter.push_back(whole.counter[i]);
  }
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kDroppedFrames);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(transport.findings.size(), 1U);
  const double share = static_cast<double>(missing) / static_cast<double>(kSamples);
  EXPECT_NEAR(finding->effect.parameters[0], share, 1e-9);
  EXPECT_NEAR(finding->effect.parameters[0], 0.01, 4.0 * finding->sigma[0]);
}

TEST(Transport, TakesLatenessOutOfTheStamps) {
  GyroSeries series = clean(5);
  const std::vector<double> truth_s = series.t_s;
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, 8e-4);
  double last_s = 0.0;
  for (double& t_s : series.t_s) {
    t_s = std::max(last_s, t_s + std::abs(normal(random)));
    last_s = t_s;
  }
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kTimestampJitter);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(transport.findings.size(), 1U);
  EXPECT_NEAR(finding->effect.parameters[0], 8e-4, 5.0 * 8e-4 / std::sqrt(kSamples));
  for (std::size_t i = 0; i < truth_s.size(); i += 37)
    EXPECT_NEAR(transport.t_s[i], truth_s[i], 3e-5);
}

TEST(Transport, FindsTheLatticeThatValuesStandOn) {
  GyroSeries series = clean(6);
  constexpr double kStep_dps = 0.0125;
  for (double& rate_dps : series.rate_dps)
    rate_dps = kStep_dps * std::round(rate_dps / kStep_dps);
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kQuantization);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(transport.findings.size(), 1U);
  EXPECT_NEAR(finding->effect.parameters[0], kStep_dps, 1e-6);
}

TEST(Transport, MasksAValueThatFreezes) {
  GyroSeries series = clean(7);
  for (std::size_t i = 12001; i < 12100; ++i)
    series.rate_dps[i] = series.rate_dps[12000];
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kStuck);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(transport.findings.size(), 1U);
  EXPECT_NEAR(finding->effect.parameters[0], 120.0, 1.5 * kInterval_s);
  EXPECT_NEAR(finding->effect.parameters[1], 121.0, 1.5 * kInterval_s);
  for (std::size_t i = 0; i < kSamples; ++i)
    EXPECT_EQ(transport.masked[i] != 0, i > 12000 && i < 12100) << i;
}

TEST(Transport, FindsTheLimitThatReadingsEndAt) {
  GyroSeries series = clean(8);
  for (double& rate_dps : series.rate_dps)
    rate_dps = std::clamp(rate_dps, -35.0, 35.0);
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kSaturation);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(transport.findings.size(), 1U);
  EXPECT_NEAR(finding->effect.parameters[0], 35.0, 1e-5);
  for (std::size_t i = 0; i < kSamples; ++i) {
    if (std::abs(series.rate_dps[i]) < 35.0) continue;
    EXPECT_NE(transport.masked[i], 0);
  }
}

TEST(Transport, FindsTheBandThatReadsZero) {
  GyroSeries series = clean(9);
  constexpr double kWidth_dps = 0.6;
  for (double& rate_dps : series.rate_dps)
    rate_dps = std::abs(rate_dps) < kWidth_dps ? 0.0 : rate_dps;
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kDeadBand);
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(transport.findings.size(), 1U);
  EXPECT_NEAR(finding->effect.parameters[0], kWidth_dps, 5.0 * finding->sigma[0]);
  EXPECT_LT(finding->sigma[0], 0.05 * kWidth_dps);
}

TEST(Transport, FindsNothingThatTheModelKnows) {
  GyroSeries series = clean(10);
  for (double& rate_dps : series.rate_dps)
    rate_dps = std::clamp(rate_dps, -35.0, 35.0);
  const Transport transport = check_transport(series, 0, {{0, Kind::kSaturation, {35.0}, 0}});
  EXPECT_TRUE(transport.findings.empty());
}

}  // namespace
}  // namespace vgyro::gap
