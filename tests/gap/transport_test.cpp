#include "gap/transport.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "made_faults.h"

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

constexpr double kSamples_d = static_cast<double>(kSamples);
// Of a sample that a model calls impossible.
constexpr double kImpossible = 50.0;

double rms_error_s(const Transport& transport, const std::vector<double>& truth_s) {
  double squares = 0.0;
  for (std::size_t i = 0; i < truth_s.size(); ++i)
    squares += std::pow(transport.t_s[i] - truth_s[i], 2);
  return std::sqrt(squares / static_cast<double>(truth_s.size()));
}

// Nothing comes early: the clock is the line below the stamps, and known far better than one stamp.
TEST(Lateness, OneSidedIsTakenOutToAFractionOfItself) {
  for (const double sigma_s : {5e-5, 2e-4, 8e-4}) {
    GyroSeries series = clean(31);
    const std::vector<double> truth_s = series.t_s;
    std::mt19937_64 random(31);
    std::normal_distribution<double> normal(0.0, sigma_s);
    delay_stamps(series, [&] { return std::abs(normal(random)); });
    const Transport transport = check_transport(series, 0, {});
    const Finding* const finding = found(transport, Kind::kTimestampJitter);
    ASSERT_NE(finding, nullptr) << sigma_s;
    // A folded normal's kurtosis of 3.87 makes its deviation known to 0.85/√n of itself.
    EXPECT_NEAR(finding->effect.parameters[0], sigma_s, 5.0 * sigma_s / std::sqrt(kSamples_d));
    EXPECT_LT(rms_error_s(transport, truth_s), 0.04 * sigma_s) << sigma_s;
    EXPECT_NEAR(transport.interval_s, kInterval_s, 0.05 * sigma_s / 200.0) << sigma_s;
  }
}

TEST(Lateness, OfAnotherShapeIsTakenOutToo) {
  constexpr double kMean_s = 3e-4;
  GyroSeries series = clean(32);
  const std::vector<double> truth_s = series.t_s;
  std::mt19937_64 random(32);
  std::exponential_distribution<double> exponential(1.0 / kMean_s);
  delay_stamps(series, [&] { return exponential(random); });
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kTimestampJitter);
  ASSERT_NE(finding, nullptr);
  // The deviation of an exponential is its mean; its kurtosis of 9 doubles the error.
  EXPECT_NEAR(finding->effect.parameters[0], kMean_s, 5.0 * 2.0 * kMean_s / std::sqrt(kSamples_d));
  EXPECT_LT(rms_error_s(transport, truth_s), 0.04 * kMean_s);
}

// Stamps may also come early, when the log's clock is the one that is uneven.
TEST(Lateness, ToBothSidesLeavesTheClockInTheMiddle) {
  constexpr double kSigma_s = 3e-4;
  GyroSeries series = clean(33);
  const std::vector<double> truth_s = series.t_s;
  std::mt19937_64 random(33);
  std::normal_distribution<double> normal(0.0, kSigma_s);
  for (double& t_s : series.t_s)
    t_s += normal(random);
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kTimestampJitter);
  ASSERT_NE(finding, nullptr);
  EXPECT_NEAR(finding->effect.parameters[0], kSigma_s,
              5.0 * kSigma_s / std::sqrt(2.0 * kSamples_d));
  // The earliest of 100 scatter by 0.43 of the jitter; the line is through 200 of them.
  EXPECT_LT(rms_error_s(transport, truth_s), 4.0 * 0.43 / std::sqrt(200.0) * kSigma_s);
}

TEST(Lateness, IsTakenOutWhereFramesAreMissing) {
  constexpr double kSigma_s = 5e-4;
  GyroSeries series = clean(34);
  std::mt19937_64 random(34);
  std::bernoulli_distribution lost(0.02);
  lose(series, [&](std::size_t) { return lost(random); });
  const std::vector<double> truth_s = series.t_s;
  std::normal_distribution<double> normal(0.0, kSigma_s);
  delay_stamps(series, [&] { return std::abs(normal(random)); });
  const Transport transport = check_transport(series, 0, {});
  EXPECT_EQ(transport.findings.size(), 2U);
  EXPECT_NE(found(transport, Kind::kDroppedFrames), nullptr);
  EXPECT_LT(rms_error_s(transport, truth_s), 0.04 * kSigma_s);
}

TEST(Lateness, IsNoRoundingToMicroseconds) {
  GyroSeries series = clean(35);
  for (std::size_t i = 0; i < kSamples; ++i)
    series.t_s[i] = 1e-6 * std::round(1e6 * 1.0000371 * series.t_s[i]);
  const Transport transport = check_transport(series, 0, {});
  EXPECT_TRUE(transport.findings.empty());
  EXPECT_EQ(transport.t_s, series.t_s);
  EXPECT_NEAR(transport.interval_s, 1.0000371 * kInterval_s, 1e-10);
}

// That is the regression's to find: what is taken out of the stamps could not be seen any more.
TEST(Lateness, IsNoClockThatWanders) {
  GyroSeries series = clean(36);
  for (double& t_s : series.t_s)
    t_s += 1e-3 * std::sin(2.0 * kPi * t_s / 60.0);
  const Transport transport = check_transport(series, 0, {});
  EXPECT_EQ(found(transport, Kind::kTimestampJitter), nullptr);
  EXPECT_EQ(transport.t_s, series.t_s);
}

TEST(Lateness, OfFewStampsIsLeftAlone) {
  GyroSeries series = clean(37);
  series.t_s.resize(150), series.rate_dps.resize(150), series.counter.resize(150);
  std::mt19937_64 random(37);
  std::normal_distribution<double> normal(0.0, 1e-3);
  delay_stamps(series, [&] { return std::abs(normal(random)); });
  EXPECT_EQ(check_transport(series, 0, {}).t_s, series.t_s);
}

TEST(Lateness, ThatTheModelKnowsIsTakenOutButNotFoundAgain) {
  constexpr double kSigma_s = 5e-4;
  GyroSeries series = clean(38);
  const std::vector<double> truth_s = series.t_s;
  std::mt19937_64 random(38);
  std::normal_distribution<double> normal(0.0, kSigma_s);
  delay_stamps(series, [&] { return std::abs(normal(random)); });
  const Transport transport =
      check_transport(series, 0, {{0, Kind::kTimestampJitter, {kSigma_s}, 0}});
  EXPECT_TRUE(transport.findings.empty());
  EXPECT_LT(rms_error_s(transport, truth_s), 0.04 * kSigma_s);
}

TEST(Lateness, CostsWhatStampsRightToThreeMicrosecondsWouldSay) {
  GyroSeries series = clean(39);
  std::mt19937_64 random(39);
  std::normal_distribution<double> normal(0.0, 2e-5);
  delay_stamps(series, [&] { return std::abs(normal(random)); });
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kTimestampJitter);
  ASSERT_NE(finding, nullptr);
  double nats = 0.0;
  for (const double late_s : transport.late_s)
    nats += std::min(kImpossible, 0.5 * std::pow(late_s / 3e-6, 2));
  EXPECT_NEAR(finding->cost_nats, nats, 1e-9 * nats);
}

TEST(Lattice, IsFoundOfAnyStepThatTheFrameCouldSplit) {
  for (const double step_dps : {4e-4, 0.003, 0.0125, 0.07, 0.5}) {
    GyroSeries series = clean(41);
    for (double& rate_dps : series.rate_dps)
      rate_dps = 1e-6 * std::round(1e6 * step_dps * std::round(rate_dps / step_dps));
    const Transport transport = check_transport(series, 0, {});
    const Finding* const finding = found(transport, Kind::kQuantization);
    ASSERT_NE(finding, nullptr) << step_dps;
    EXPECT_NEAR(finding->effect.parameters[0], step_dps, 5.0 * finding->sigma[0] + 1e-9 * step_dps);
    EXPECT_EQ(transport.lattice_dps, finding->effect.parameters[0]);
    EXPECT_EQ(finding->cost_nats, 0.0);
  }
}

TEST(Lattice, OfTheFrameIsNone) {
  GyroSeries series = clean(42);
  series.step_dps = 0.0125;
  for (double& rate_dps : series.rate_dps)
    rate_dps = series.step_dps * std::round(rate_dps / series.step_dps);
  const Transport transport = check_transport(series, 0, {});
  EXPECT_TRUE(transport.findings.empty());
  EXPECT_EQ(transport.lattice_dps, series.step_dps);
}

TEST(Lattice, OfAFloatIsFoundToo) {
  GyroSeries series = clean(43);
  series.step_dps = 0.0;
  for (double& rate_dps : series.rate_dps)
    rate_dps = static_cast<double>(static_cast<float>(0.025 * std::round(rate_dps / 0.025)));
  const Transport transport = check_transport(series, 0, {});
  ASSERT_NE(found(transport, Kind::kQuantization), nullptr);
  EXPECT_NEAR(transport.lattice_dps, 0.025, 1e-7);
}

TEST(Lattice, ThatTheModelKnowsIsUsedButNotFoundAgain) {
  GyroSeries series = clean(44);
  for (double& rate_dps : series.rate_dps)
    rate_dps = 0.0125 * std::round(rate_dps / 0.0125);
  const Transport transport = check_transport(series, 0, {{0, Kind::kQuantization, {0.0125}, 0}});
  EXPECT_TRUE(transport.findings.empty());
  EXPECT_NEAR(transport.lattice_dps, 0.0125, 1e-6);
}

// An adapter hands out ten frames at once: the counter has no gap, and nothing is lost.
TEST(Bunches, AreNoLossAndNoLateness) {
  for (const bool counted : {true, false}) {
    GyroSeries series = clean(57);
    const std::vector<double> truth_s = series.t_s;
    for (std::size_t i = 0; i < kSamples; ++i) {
      const std::size_t last = std::min(kSamples - 1, i / 10 * 10 + 9);
      series.t_s[i] = truth_s[last] + 1e-4 * static_cast<double>(i % 10);
    }
    if (!counted) series.counter.clear(), series.counter_modulus = 0;
    const Transport transport = check_transport(series, 0, {});
    EXPECT_TRUE(transport.findings.empty()) << counted;
    ASSERT_EQ(transport.notes.size(), 1U) << counted;
    EXPECT_NE(transport.notes[0].find("bunches of 10"), std::string::npos) << transport.notes[0];
    EXPECT_EQ(transport.lost_share, 0.0);
    EXPECT_NEAR(transport.interval_s, kInterval_s, 1e-6);
    // Of an even clock, at most the adapter's own time late.
    for (std::size_t i = 0; i < kSamples; i += 97)
      EXPECT_NEAR(transport.t_s[i], truth_s[i], 1.1e-3) << i;
  }
}

// What is lost is told by the counter in bunches, too.
TEST(Bunches, LoseFramesByTheCounter) {
  GyroSeries series = clean(58);
  for (std::size_t i = 0; i < kSamples; ++i)
    series.t_s[i] = series.t_s[std::min(kSamples - 1, i / 10 * 10 + 9)];
  const std::size_t lost = lose(series, [](std::size_t i) { return i % 53 == 7; });
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kDroppedFrames);
  ASSERT_NE(finding, nullptr);
  EXPECT_NEAR(finding->effect.parameters[0], static_cast<double>(lost) / kSamples, 1e-6);
}

TEST(Stuck, EachFreezeIsFoundByItself) {
  GyroSeries series = clean(51);
  freeze(series, 9000, 9040);
  freeze(series, 15000, 15300);
  const Transport transport = check_transport(series, 0, {});
  ASSERT_EQ(transport.findings.size(), 2U);
  const std::array<std::array<double, 2>, 2> truth_s{{{90.0, 90.4}, {150.0, 153.0}}};
  for (std::size_t k = 0; k < 2; ++k) {
    const Finding& finding = transport.findings[k];
    EXPECT_EQ(finding.effect.kind, Kind::kStuck);
    EXPECT_NEAR(finding.effect.parameters[0], truth_s[k][0], kInterval_s);
    EXPECT_NEAR(finding.effect.parameters[1], truth_s[k][1], kInterval_s);
    const double frozen =
        (finding.effect.parameters[1] - finding.effect.parameters[0]) / transport.interval_s;
    EXPECT_NEAR(finding.cost_nats, 0.2 * kImpossible * frozen, 1e-9 * finding.cost_nats);
  }
}

TEST(Stuck, TheRecordingMayEndFrozen) {
  GyroSeries series = clean(52);
  freeze(series, kSamples - 100, kSamples);
  const Transport transport = check_transport(series, 0, {});
  ASSERT_EQ(transport.findings.size(), 1U);
  EXPECT_EQ(transport.findings[0].effect.kind, Kind::kStuck);
  EXPECT_EQ(transport.findings[0].effect.parameters[1], series.t_s.back());
  EXPECT_EQ(masked_samples(transport).size(), 99U);
}

TEST(Stuck, AFewRepeatsAreNone) {
  GyroSeries series = clean(53);
  freeze(series, 9000, 9007);
  freeze(series, 12000, 12010);
  const Transport transport = check_transport(series, 0, {});
  EXPECT_TRUE(transport.findings.empty());
  EXPECT_TRUE(masked_samples(transport).empty());
}

// Again and again is a property of the sensor: six values alike, fourteen times, in turns.
TEST(Stuck, BriefFreezesThatComeAgainAreFound) {
  GyroSeries series = clean(56);
  for (std::size_t k = 0; k < 14; ++k)
    freeze(series, 9000 + 700 * k, 9006 + 700 * k);
  const Transport transport = check_transport(series, 0, {});
  ASSERT_EQ(transport.findings.size(), 14U);
  for (const Finding& finding : transport.findings)
    EXPECT_EQ(finding.effect.kind, Kind::kStuck);
  EXPECT_EQ(masked_samples(transport).size(), 14U * 5U);
}

// A coarse sensor repeats itself at rest; what it does not do is to keep a value in a turn.
TEST(Stuck, ACoarseSensorAtRestIsNot) {
  constexpr double kStep_dps = 0.05;
  GyroSeries series = clean(54);
  for (double& rate_dps : series.rate_dps)
    rate_dps = kStep_dps * std::round(rate_dps / kStep_dps);
  EXPECT_EQ(found(check_transport(series, 0, {}), Kind::kStuck), nullptr);
}

TEST(Stuck, WhatTheModelKnowsIsMaskedButNotFoundAgain) {
  GyroSeries series = clean(55);
  freeze(series, 9000, 9100);
  freeze(series, 15000, 15100);
  const Transport transport = check_transport(series, 0, {{0, Kind::kStuck, {90.0, 91.0}, 0}});
  ASSERT_EQ(transport.findings.size(), 1U);
  EXPECT_NEAR(transport.findings[0].effect.parameters[0], 150.0, kInterval_s);
  EXPECT_EQ(masked_samples(transport).size(), 2U * 99U);
}

TEST(Frames, OnePauseIsTold) {
  GyroSeries series = clean(61);
  lose(series, [](std::size_t i) { return i >= 8000 && i < 8500; });
  const Transport transport = check_transport(series, 0, {});
  EXPECT_TRUE(transport.findings.empty());
  ASSERT_EQ(transport.notes.size(), 1U);
  EXPECT_EQ(transport.notes[0], "a: 500 frames are missing, 500 of them at once");
  EXPECT_NEAR(transport.lost_share, 500.0 / kSamples_d, 1e-12);
}

// A recording of segments: what was not recorded is no property of the bus, and what is lost beside
// it is counted by itself.
TEST(Frames, OfManyPausesAreNotLost) {
  for (const double share : {0.0, 0.01}) {
    GyroSeries series = clean(65);
    series.counter.clear();
    series.counter_modulus = 0;
    std::mt19937_64 random(65);
    std::bernoulli_distribution lost(share);
    std::size_t single = 0;
    const std::size_t missing = lose(series, [&](std::size_t i) {
      if (i % 2000 >= 1800) return true;
      const bool is_lost = lost(random);
      if (is_lost) ++single;
      return is_lost;
    });
    const Transport transport = check_transport(series, 0, {});
    EXPECT_NEAR(transport.lost_share, static_cast<double>(missing) / kSamples_d, 0.01);
    const Finding* const finding = found(transport, Kind::kDroppedFrames);
    ASSERT_EQ(finding != nullptr, share > 0.0) << "seed 65";
    if (finding != nullptr) {
      EXPECT_NEAR(finding->effect.parameters[0], share, 0.002) << single << " lost, seed 65";
    }
    ASSERT_EQ(transport.notes.size(), 1U);
  }
}

// Without a counter time tells.
TEST(Frames, AreCountedByTimeWhereThereIsNoCounter) {
  GyroSeries series = clean(62);
  series.counter.clear();
  series.counter_modulus = 0;
  std::mt19937_64 random(62);
  std::bernoulli_distribution lost(0.01);
  const std::size_t missing = lose(series, [&](std::size_t) { return lost(random); });
  const Transport transport = check_transport(series, 0, {});
  const Finding* const finding = found(transport, Kind::kDroppedFrames);
  ASSERT_NE(finding, nullptr);
  const double share = static_cast<double>(missing) / kSamples_d;
  EXPECT_NEAR(finding->effect.parameters[0], share, 1e-12);
  const double frames = static_cast<double>(series.t_s.size());
  EXPECT_NEAR(finding->cost_nats, frames * share * std::log(1e6), 1e-6);
}

// Stamps of a poll every 5.44 ms, of frames every 12 ms: late by half an interval, none lost.
GyroSeries polled(unsigned seed) {
  constexpr double kPoll_s = 5.44e-3;
  constexpr double kFrames_s = 12e-3;
  GyroSeries series = clean(seed);
  series.counter.clear();
  series.counter_modulus = 0;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> read(0.0, 1.5e-3);
  for (std::size_t i = 0; i < series.t_s.size(); ++i) {
    const double sent_s = kFrames_s * static_cast<double>(i);
    series.t_s[i] = kPoll_s * std::ceil(sent_s / kPoll_s) + read(random);
  }
  return series;
}

TEST(Frames, ThatAreLateAreNotLost) {
  const Transport transport = check_transport(polled(63), 0, {});
  EXPECT_EQ(found(transport, Kind::kDroppedFrames), nullptr);
  EXPECT_EQ(transport.lost_share, 0.0);
  EXPECT_NEAR(transport.interval_s, 12e-3, 1e-6);
  // The clock shows through the lateness: what is left of it is a shift of all stamps.
  for (std::size_t i = 0; i < kSamples; i += 97)
    EXPECT_NEAR(transport.t_s[i] - transport.t_s[0], 12e-3 * static_cast<double>(i), 1e-4) << i;
}

TEST(Frames, OfLateOnesAPauseStillCounts) {
  GyroSeries series = polled(64);
  lose(series, [](std::size_t i) { return i >= 5000 && i < 5100; });
  const Transport transport = check_transport(series, 0, {});
  EXPECT_NEAR(transport.lost_share, 100.0 / kSamples_d, 2.0 / kSamples_d);
  EXPECT_EQ(found(transport, Kind::kDroppedFrames), nullptr) << "one pause";
}

TEST(Plateaus, CostHalfOfAllThatIsMasked) {
  for (const Kind kind : {Kind::kSaturation, Kind::kDeadBand}) {
    GyroSeries series = clean(71);
    for (double& rate_dps : series.rate_dps) {
      if (kind == Kind::kSaturation) rate_dps = std::clamp(rate_dps, -35.0, 35.0);
      if (kind == Kind::kDeadBand && std::abs(rate_dps) < 0.6) rate_dps = 0.0;
    }
    const Transport transport = check_transport(series, 0, {});
    const Finding* const finding = found(transport, kind);
    ASSERT_NE(finding, nullptr);
    const double masked = static_cast<double>(masked_samples(transport).size());
    EXPECT_DOUBLE_EQ(finding->cost_nats, 0.5 * kImpossible * masked);
  }
}

TEST(Plateaus, CostMoreWhenMoreIsMasked) {
  GyroSeries series = clean(72);
  for (double& rate_dps : series.rate_dps)
    rate_dps = std::clamp(rate_dps, -35.0, 35.0);
  freeze(series, 3000, 3100);
  Transport transport = check_transport(series, 0, {});
  ASSERT_EQ(transport.findings.size(), 2U);
  const double stuck = found(transport, Kind::kStuck)->cost_nats;
  const double clipped = found(transport, Kind::kSaturation)->cost_nats;
  transport.masked[10] = transport.masked[20] = 1;
  count_masked(transport);
  EXPECT_EQ(found(transport, Kind::kStuck)->cost_nats, stuck);
  EXPECT_DOUBLE_EQ(found(transport, Kind::kSaturation)->cost_nats, clipped + kImpossible);
}

TEST(Plateaus, AMotionsPeakIsNone) {
  Making making;
  making.white_dps_rthz.fill(1e-6);
  EXPECT_TRUE(check_transport(make_recording(making).gyros[0], 0, {}).findings.empty());
}

}  // namespace
}  // namespace vgyro::gap
