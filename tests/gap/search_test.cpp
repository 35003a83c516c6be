#include "gap/search.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "gap/score.h"
#include "model/catalogue.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

// A two-sided chance of one in sixteen thousand.
constexpr double kSigmas = 4.0;

Making making_of(std::uint64_t seed, double seconds = 100.0) {
  Making making;
  making.seconds = seconds;
  making.rest_s = 30.0;
  making.seed = seed;
  return making;
}

std::string names_of(const std::vector<Found>& found) {
  std::string text;
  for (const Found& one : found) {
    text += std::string(text.empty() ? "" : ", ") + "kind " +
            std::to_string(static_cast<int>(one.effect.kind)) + " of gyro " +
            std::to_string(one.effect.gyro) + " (" + model::parameters_text(one.effect) + ") by " +
            std::to_string(one.statistic);
  }
  return text;
}

struct Copy {
  std::vector<double> t_s;
  Eigen::VectorXd observed_dps;
  std::vector<double> rate_dps;
  std::vector<bool> held_out;
};

std::vector<Copy> copy_of(const Study& study) {
  std::vector<Copy> copies;
  for (const auto& data : study.observations()) {
    Copy copy{data->t_s, data->observed_dps, {}, {}};
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      for (const SampledCurve::Point& point : data->rate[gyro])
        copy.rate_dps.push_back(point.value);
    }
    for (const Block& block : data->layout.blocks)
      copy.held_out.push_back(block.held_out);
    copies.push_back(std::move(copy));
  }
  return copies;
}

void expect_same(const std::vector<Copy>& before, const std::vector<Copy>& after) {
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(before[i].t_s, after[i].t_s);
    EXPECT_EQ(before[i].observed_dps, after[i].observed_dps);
    EXPECT_EQ(before[i].rate_dps, after[i].rate_dps);
    EXPECT_EQ(before[i].held_out, after[i].held_out);
  }
}

// What a reader of the result is told rests on study() and effects(): both must be of one motion,
// which is the one that a study begun afresh learns from these effects.
void expect_of_one_motion(const Search& search, const Recording& recording, const Effects& known) {
  const Effects effects = search.effects();
  const auto begun = Study::begin(recording, known);
  ASSERT_TRUE(begun) << begun.error().message();
  const auto fresh = (*begun)->with_motion(effects);
  ASSERT_EQ(fresh->observations().size(), search.study().observations().size());
  for (std::size_t place = 0; place < fresh->observations().size(); ++place) {
    const Observations& ours = *search.study().observations()[place];
    const Observations& theirs = *fresh->observations()[place];
    ASSERT_EQ(ours.t_s, theirs.t_s);
    EXPECT_EQ(ours.residual(effects), theirs.residual(effects));
  }
  constexpr std::uint64_t kSeed = 1;
  const Floor ours = simulate_floor(search.study(), effects, Part::kAll, kSeed);
  const Floor theirs = simulate_floor(*fresh, effects, Part::kAll, kSeed);
  EXPECT_EQ(ours.nats_per_sample, theirs.nats_per_sample);
  EXPECT_EQ(gap_of(search.study(), effects, ours, Part::kAll),
            gap_of(*fresh, effects, theirs, Part::kAll));
}

TEST(Search, NamesAHiddenScaleFactorAloneAndLeavesTheStudyAsItWas) {
  Making making = making_of(41);
  constexpr double kError = 1.5e-4;
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 1 ? kError * rate_dps : 0.0;
  };
  const MadeStudy made(making);
  ASSERT_NE(made.study(), nullptr);
  const auto before = made.study()->observations();
  const std::vector<Copy> copies = copy_of(*made.study());
  Search search(made.study(), noise_effects(making));
  search.run();
  ASSERT_EQ(search.found().size(), 1U) << "seed 41: " << names_of(search.found());
  const Found found = search.found().front();
  EXPECT_EQ(found.effect.kind, Kind::kScaleFactor);
  EXPECT_EQ(found.effect.gyro, 1U);
  EXPECT_NEAR(found.effect.parameters[0], kError, kSigmas * found.sigma[0]);
  // White noise alone would leave σ = N/√(∫Ω² dt) over the three quarters that were not set aside;
  // the drift costs little more.
  double square = 0.0;
  for (double t_s = 0.0; t_s < making.seconds; t_s += making.interval_s)
    square += std::pow(true_rate_dps(making, t_s), 2) * making.interval_s;
  const double white_sigma = making.white_dps_rthz[1] / std::sqrt(0.75 * square);
  EXPECT_NEAR(found.sigma[0] / white_sigma, 1.0, 0.25);
  // Noise that is fitted again without it grows, which makes up for a part of what is lost.
  EXPECT_LT(found.statistic, 1.2 * std::pow(found.effect.parameters[0] / found.sigma[0], 2));
  EXPECT_GE(found.margin(), 0.0);
  EXPECT_TRUE(found.ambiguous_with.empty());
  EXPECT_TRUE(search.rejected().empty());
  EXPECT_EQ(made.study()->observations(), before);
  expect_same(copies, copy_of(*made.study()));
  expect_of_one_motion(search, made.recording(), noise_effects(making));
}

TEST(Search, NamesNothingInACleanRecording) {
  for (const std::uint64_t seed : {42U, 43U}) {
    const Making making = making_of(seed);
    const MadeStudy made(making);
    ASSERT_NE(made.study(), nullptr);
    Search search(made.study(), noise_effects(making));
    search.run();
    EXPECT_TRUE(search.found().empty()) << "seed " << seed << ": " << names_of(search.found());
    EXPECT_TRUE(search.rejected().empty())
        << "seed " << seed << ": " << names_of(search.rejected());
    EXPECT_EQ(search.effects(), noise_effects(making));
  }
}

TEST(Search, NamesNothingInACleanRecordingWithoutReference) {
  const Making making = making_of(44);
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  Search search(made.study(), noise_effects(making));
  search.run();
  EXPECT_TRUE(search.found().empty()) << "seed 44: " << names_of(search.found());
  expect_of_one_motion(search, made.recording(), noise_effects(making));
}

// A difference of two gyros does not say which of them is wrong, but what, and by how much.
TEST(Search, WithoutReferenceNamesTheScaleFactorOfOneGyroOrTheOther) {
  Making making = making_of(45);
  constexpr double kError = 3e-4;
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 0 ? kError * rate_dps : 0.0;
  };
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  const std::vector<Copy> copies = copy_of(*made.study());
  Search search(made.study(), noise_effects(making));
  search.run();
  ASSERT_EQ(search.found().size(), 1U) << "seed 45: " << names_of(search.found());
  const Found found = search.found().front();
  EXPECT_EQ(found.effect.kind, Kind::kScaleFactor);
  const double truth = found.effect.gyro == 0 ? kError : -kError;
  EXPECT_NEAR(found.effect.parameters[0], truth, kSigmas * found.sigma[0]);
  ASSERT_EQ(found.ambiguous_with.size(), 1U);
  EXPECT_EQ(found.ambiguous_with[0].kind, Kind::kScaleFactor);
  EXPECT_EQ(found.ambiguous_with[0].gyro, 1 - found.effect.gyro);
  expect_same(copies, copy_of(*made.study()));
  expect_of_one_motion(search, made.recording(), noise_effects(making));
}

// A delay is a shape of its own only while the rate is known; without a reference a wrong name
// would be worth less than none.
TEST(Search, WithoutReferenceNamesADelayRightlyOrNotAtAll) {
  Making making = making_of(46);
  constexpr double kDelay_s = 0.004;
  making.error = [&](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 1 ? true_rate_dps(making, t_s - kDelay_s) - rate_dps : 0.0;
  };
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  Search search(made.study(), noise_effects(making));
  search.run();
  for (const Found& found : search.found()) {
    EXPECT_EQ(found.effect.kind, Kind::kDelay) << "seed 46: " << names_of(search.found());
    EXPECT_EQ(found.effect.gyro, 1U) << "seed 46: " << names_of(search.found());
    EXPECT_NEAR(found.effect.parameters[0], kDelay_s, kSigmas * found.sigma[0]);
  }
  expect_of_one_motion(search, made.recording(), noise_effects(making));
}

// A vehicle that turns slowly and stops every minute, two cheap gyros of unequal noise, nothing
// known of either: what the one is late by, and drifts, is seen beside the noise of both.
double stop_and_go_dps(double t_s) {
  constexpr double kStart_s = 60.0;
  constexpr double kGo_s = 40.0;
  const double in_cycle_s = std::fmod(t_s - kStart_s, 60.0);
  if (t_s < kStart_s || in_cycle_s > kGo_s) return 0.0;
  if (in_cycle_s >= 5.0 && in_cycle_s < 12.0)
    return 15.0 * std::sin(kPi * (in_cycle_s - 5.0) / 7.0);
  if (in_cycle_s >= 20.0 && in_cycle_s < 30.0)
    return -10.0 * std::sin(kPi * (in_cycle_s - 20.0) / 10.0);
  return 0.3 * std::sin(2.0 * kPi * in_cycle_s / 7.0) * std::sin(kPi * in_cycle_s / kGo_s);
}

TEST(Search, FromNothingFindsRampAndDelayOfTwoCheapGyros) {
  constexpr double kDelay_s = 0.0031;
  constexpr double kSlope_dps_s = 5e-4;
  Making making = making_of(51, 400.0);
  making.white_dps_rthz = {5e-3, 2e-3};
  making.error = [&](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 0 ? 0.35 + stop_and_go_dps(t_s) - rate_dps
                     : -0.8 + kSlope_dps_s * t_s + stop_and_go_dps(t_s - kDelay_s) - rate_dps;
  };
  const MadeStudy made(without_reference(make_recording(making)), {});
  ASSERT_NE(made.study(), nullptr);
  Search search(made.study(), {});
  search.run();
  const std::vector<Found> found = search.found();
  bool has_ramp = false;
  bool has_lateness = false;
  for (const Found& one : found) {
    EXPECT_EQ(one.effect.gyro, 1U) << "seed 51: " << names_of(found);
    if (one.effect.kind == Kind::kBiasRamp) {
      has_ramp = true;
      EXPECT_NEAR(one.effect.parameters[0], kSlope_dps_s, kSigmas * one.sigma[0]);
      continue;
    }
    // So slow a motion hardly tells a delay from a low-pass that delays as much.
    has_lateness = true;
    const bool is_delay = one.effect.kind == Kind::kDelay;
    EXPECT_TRUE(is_delay || one.effect.kind == Kind::kBandwidth) << names_of(found);
    const double late_s =
        is_delay ? one.effect.parameters[0] : 1.0 / (2.0 * kPi * one.effect.parameters[0]);
    EXPECT_NEAR(late_s / kDelay_s, 1.0, 0.2) << "seed 51: " << names_of(found);
    EXPECT_TRUE(is_delay || std::any_of(one.ambiguous_with.begin(), one.ambiguous_with.end(),
                                        [](const Reading& other) {
                                          return other.kind == Kind::kDelay && other.gyro == 1;
                                        }))
        << names_of(found);
  }
  EXPECT_TRUE(has_ramp && has_lateness) << "seed 51: " << names_of(found);
}

// Stamps that come late at random leave what looks like a small delay, which is then no name: the
// search ends within a round, on the motion that goes with what it has named.
TEST(Search, KeepsStudyAndEffectsTogetherWhereALateGyroComesToNothing) {
  Making making = making_of(48);
  constexpr double kDelay_s = 1e-4;
  constexpr double kLate_s = 8e-4;
  making.error = [&](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 1 ? true_rate_dps(making, t_s - kDelay_s) - rate_dps : 0.0;
  };
  Recording recording = without_reference(make_recording(making));
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, kLate_s);
  double last_s = 0.0;
  for (double& t_s : recording.gyros[1].t_s)
    last_s = t_s = std::max(last_s, t_s + std::abs(normal(random)));
  const MadeStudy made(std::move(recording), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  ASSERT_EQ(made.study()->findings().size(), 1U);
  EXPECT_EQ(made.study()->findings().front().effect.kind, Kind::kTimestampJitter);
  Search search(made.study(), noise_effects(making));
  search.run();
  EXPECT_TRUE(search.found().empty()) << "seed 48: " << names_of(search.found());
  expect_of_one_motion(search, made.recording(), noise_effects(making));
}

// A line over the temperature that is 0 where the recording begins is no parabola that is 0 at 25
// °C.
TEST(Search, TellsAtWhichTemperatureABiasIsNone) {
  Making making = making_of(49);
  constexpr double kPerK = 4e-3;
  constexpr double kNone_c = 18.0;
  const auto temperature_c = [](double t_s) { return kNone_c - 20.0 * std::sin(0.05 * t_s); };
  making.error = [&](std::size_t gyro, double t_s, double) {
    return gyro == 1 ? kPerK * (temperature_c(t_s) - kNone_c) : 0.0;
  };
  Recording recording = make_recording(making);
  for (GyroSeries& gyro : recording.gyros) {
    for (const double t_s : gyro.t_s)
      gyro.temperature_c.push_back(temperature_c(t_s));
  }
  Effects known = noise_effects(making);
  known.push_back({1, Kind::kBias, {0.0}, 0});
  const MadeStudy made(std::move(recording), known);
  ASSERT_NE(made.study(), nullptr);
  Search search(made.study(), known);
  search.run();
  ASSERT_EQ(search.found().size(), 1U) << "seed 49: " << names_of(search.found());
  const Found found = search.found().front();
  EXPECT_EQ(found.effect.kind, Kind::kTemperatureBias) << names_of(search.found());
  EXPECT_EQ(found.effect.gyro, 1U);
  EXPECT_NEAR(found.effect.parameters[0], kPerK, kSigmas * found.sigma[0]);
  EXPECT_NEAR(found.effect.parameters[1], kNone_c, kSigmas * found.sigma[1]);
  EXPECT_LT(found.sigma[1], 3.0);
}

}  // namespace
}  // namespace vgyro::gap
