// Several recordings of one pair, explained by one model.

#include <gtest/gtest.h>

#include "gap/workflow.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Kind;

constexpr double kSigmas = 4.0;

// It ends in motion, so that a curve drawn over the seam would be seen.
Making drive(std::uint64_t seed) {
  Making making;
  making.seconds = 90.0 + static_cast<double>(seed % 7);
  making.rest_s = 30.0;
  making.seed = seed;
  return making;
}

Result found_in(const std::vector<Recording>& recordings, const Effects& known) {
  model::Model model;
  model.effects = known;
  auto result = find_gap(recordings, model, {});
  EXPECT_TRUE(result) << result.error().message();
  return result.value_or(Result{});
}

std::string names_of(const Result& result) {
  std::string text;
  for (const NamedEffect& one : result.effects)
    text += std::to_string(static_cast<int>(one.effect.kind)) + " of gyro " +
            std::to_string(one.effect.gyro) + "; ";
  return text;
}

const NamedEffect* find(const Result& result, Kind kind, std::size_t gyro) {
  for (const NamedEffect& one : result.effects) {
    if (one.effect.kind == kind && one.effect.gyro == gyro) return &one;
  }
  return nullptr;
}

TEST(Drives, CleanWithBiasesOfTheirOwnHaveNoGap) {
  for (const bool reference : {true, false}) {
    std::vector<Recording> recordings;
    for (const std::uint64_t seed : {501U, 502U, 503U}) {
      Making making = drive(seed);
      const double bias_dps = 0.04 * static_cast<double>(seed - 501);
      making.error = [bias_dps](std::size_t gyro, double, double) {
        return gyro == 0 ? bias_dps : -0.5 * bias_dps;
      };
      Recording recording = make_recording(making);
      recordings.push_back(reference ? recording : without_reference(recording));
    }
    const Result result = found_in(recordings, noise_effects(drive(501)));
    EXPECT_TRUE(result.effects.empty()) << reference << " " << names_of(result);
    EXPECT_TRUE(result.unexplained.empty()) << reference;
    EXPECT_EQ(result.verdict, Verdict::kNoGap) << reference << " gap " << result.gap.after;
    ASSERT_EQ(result.drives.size(), 3U);
    EXPECT_GE(result.drives[1].from_s, result.drives[0].to_s + 10.0);
    EXPECT_NEAR(result.seconds, 94.0 + 95.0 + 96.0, 4.0);
  }
}

// One drive turns and stays at one temperature, the other one rests and warms up.
TEST(Drives, ShowTogetherWhatNeitherShowsAlone) {
  constexpr double kScale = 2e-3;
  constexpr double kPerK = 4e-3;
  const auto temperature = [](bool warms, double t_s) { return warms ? 20.0 + 0.1 * t_s : 20.0; };
  std::vector<Recording> recordings;
  for (const bool warms : {false, true}) {
    Making making = drive(warms ? 511 : 512);
    if (warms) making.rest_s = 1e6;
    making.error = [&, warms](std::size_t gyro, double t_s, double rate_dps) {
      return gyro == 1 ? kScale * rate_dps + kPerK * (temperature(warms, t_s) - 25.0) : 0.0;
    };
    Recording recording = make_recording(making);
    for (GyroSeries& gyro : recording.gyros) {
      for (const double t_s : gyro.t_s)
        gyro.temperature_c.push_back(temperature(warms, t_s));
    }
    recordings.push_back(std::move(recording));
  }
  Effects known = noise_effects(drive(512));
  known.push_back({1, Kind::kBias, {0.0}, 0});
  const Result result = found_in(recordings, known);
  const NamedEffect* scale = find(result, Kind::kScaleFactor, 1);
  const NamedEffect* warmth = find(result, Kind::kTemperatureBias, 1);
  ASSERT_NE(scale, nullptr) << names_of(result);
  EXPECT_NEAR(scale->effect.parameters[0], kScale, kSigmas * scale->sigma[0]);
  // A ramp of this one drive has the same shape, and so may be it.
  const bool named = warmth != nullptr || find(result, Kind::kBiasRamp, 1) != nullptr;
  EXPECT_TRUE(named) << names_of(result);
  if (warmth != nullptr) {
    EXPECT_NEAR(warmth->effect.parameters[0], kPerK, kSigmas * warmth->sigma[0]);
  }
  EXPECT_LE(result.gap.after, 1.5 * result.gap.band95[1]);
}

TEST(Drives, CountTheModelsTimeFromTheirOwnFirstFrames) {
  constexpr double kSlope = 4e-4;
  std::vector<Recording> recordings;
  for (const std::uint64_t seed : {521U, 522U}) {
    Making making = drive(seed);
    making.error = [](std::size_t gyro, double t_s, double) {
      return gyro == 0 ? kSlope * t_s : 0.0;
    };
    recordings.push_back(make_recording(making));
  }
  const Result result = found_in(recordings, noise_effects(drive(521)));
  ASSERT_EQ(result.effects.size(), 1U) << names_of(result);
  const NamedEffect& ramp = result.effects.front();
  EXPECT_EQ(ramp.effect.kind, Kind::kBiasRamp);
  EXPECT_NEAR(ramp.effect.parameters[0], kSlope, kSigmas * ramp.sigma[0]);
  EXPECT_LE(result.gap.after, 1.5 * result.gap.band95[1]);
}

TEST(Drives, AreSurerTogetherThanOneIs) {
  constexpr double kError = 3e-4;
  std::vector<Recording> recordings;
  for (const std::uint64_t seed : {531U, 532U, 533U, 534U}) {
    Making making = drive(seed);
    making.error = [](std::size_t gyro, double, double rate_dps) {
      return gyro == 0 ? kError * rate_dps : 0.0;
    };
    recordings.push_back(make_recording(making));
  }
  const Effects known = noise_effects(drive(531));
  const Result one = found_in({recordings[0]}, known);
  const Result all = found_in(recordings, known);
  const NamedEffect* alone = find(one, Kind::kScaleFactor, 0);
  const NamedEffect* together = find(all, Kind::kScaleFactor, 0);
  ASSERT_NE(alone, nullptr);
  ASSERT_NE(together, nullptr);
  EXPECT_NEAR(together->sigma[0] / alone->sigma[0], 0.5, 0.1);
  EXPECT_NEAR(together->effect.parameters[0], kError, kSigmas * together->sigma[0]);
}

TEST(Drives, MustBeOfOnePairSetUpAlike) {
  Making slow = drive(541);
  slow.interval_s = 0.02;
  const std::vector<Recording> recordings{make_recording(drive(540)), make_recording(slow)};
  const auto begun = Study::begin(recordings, noise_effects(slow));
  ASSERT_FALSE(begun);
  EXPECT_NE(begun.error().message().find("every 0.02 s in recording 2"), std::string::npos)
      << begun.error().message();
}

TEST(Drives, AreNamedByTheirNumberWhereOneCannotBeJudged) {
  std::vector<Recording> recordings{make_recording(drive(551)), make_recording(drive(552))};
  recordings[1].gyros[0].t_s.resize(20);
  recordings[1].gyros[0].rate_dps.resize(20);
  const auto begun = Study::begin(recordings, noise_effects(drive(551)));
  ASSERT_FALSE(begun);
  EXPECT_NE(begun.error().message().find("recording 2: the recording is too short"),
            std::string::npos)
      << begun.error().message();
}

TEST(Drives, BeginTheirDriftAnew) {
  // A bias that is another one in each drive says nothing of the drift in a drive.
  Layout layout;
  layout.interval_s = {0.01, 0.01};
  Eigen::VectorXd residual(400);
  for (std::uint32_t b = 0; b < 40; ++b) {
    Block block;
    block.t_s = 0.1 * b + 0.05;
    block.first = 10 * b;
    block.count = 10;
    block.within_gain[0] = 1.0;
    block.mean_gain[0] = 0.1;
    block.begins = b == 20;
    layout.blocks.push_back(block);
    for (std::uint32_t i = 0; i < 10; ++i)
      residual[block.first + i] = (b < 20 ? 0.0 : 0.3) + (i % 2 == 0 ? 1e-3 : -1e-3);
  }
  layout.samples = 400;
  PairNoise noise;
  noise[0].white_dps_rthz = 1e-4;
  const double anew = log_likelihood(residual, layout, noise, Part::kAll);
  layout.blocks[20].begins = false;
  const double on = log_likelihood(residual, layout, noise, Part::kAll);
  EXPECT_GT(anew, on + 1000.0);
}

}  // namespace
}  // namespace vgyro::gap
