#include "gap/study.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gap/scan.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

constexpr double kYear_s = 365.0 * 86'400.0;

std::string refusal(const Recording& recording) {
  const auto begun = Study::begin(recording, {});
  return begun ? std::string() : begun.error().message();
}

Recording recording_of(double seconds) {
  Making making;
  making.seconds = seconds;
  return make_recording(making);
}

// One logger's clock was not set: there is nothing to compare, and no year to allot memory for.
TEST(Study, SaysWhenEachGyroIsThereWhenTheyNeverAreTogether) {
  Recording recording = recording_of(120.0);
  for (double& t : recording.gyros[1].t_s)
    t += kYear_s;
  recording.seconds += kYear_s;
  EXPECT_EQ(refusal(recording),
            "the gyros are not there at the same time, or too shortly: a from 0.0 to 120.0 s, b "
            "from 31536000.0 to 31536120.0 s; at least 30 s of both, with the stamps of one clock");
}

// The clock was set in the middle, or two drives are in one log.
TEST(Study, RefusesMuchMoreTimeThanTheGyrosFill) {
  Recording recording = recording_of(120.0);
  for (GyroSeries& gyro : recording.gyros) {
    for (std::size_t i = gyro.t_s.size() / 2; i < gyro.t_s.size(); ++i)
      gyro.t_s[i] += 10.0 * kYear_s;
  }
  recording.seconds += 10.0 * kYear_s;
  EXPECT_EQ(
      refusal(recording).substr(0, 89),
      "from the first frame to the last it is 315360120 s, and the gyros are there in 120 s of t");
}

// A stop for coffee is none of that, nor are frames of others before and after.
TEST(Study, BearsPauses) {
  Recording recording = recording_of(120.0);
  for (GyroSeries& gyro : recording.gyros) {
    for (std::size_t i = gyro.t_s.size() / 2; i < gyro.t_s.size(); ++i)
      gyro.t_s[i] += 1800.0;
  }
  for (std::size_t i = recording.reference_dps.t_s.size() / 2;
       i < recording.reference_dps.t_s.size(); ++i)
    recording.reference_dps.t_s[i] += 1800.0;
  recording.seconds += 1800.0;
  EXPECT_EQ(refusal(recording), "");
}

// What a model says of a scale factor behind a delay leaves nothing but noise of readings that the
// same equation made; with the response before the delay it would leave 2e-3 deg/s.
TEST(Study, ResponsesSeeTheLateRate) {
  constexpr double kDelay_s = 0.02;
  constexpr double kScale = 2e-3;
  constexpr double kNoise_dps = 1e-5;
  Making making;
  making.white_dps_rthz.fill(kNoise_dps * std::sqrt(making.interval_s));
  making.walk_dps_rts.fill(0.0);
  making.error = [&](std::size_t, double t_s, double rate_dps) {
    return (1.0 + kScale) * true_rate_dps(making, t_s - kDelay_s) - rate_dps;
  };
  const Recording recording = make_recording(making);
  std::vector<model::Effect> effects;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    effects.push_back({gyro, model::Kind::kScaleFactor, {kScale}, 0});
    effects.push_back({gyro, model::Kind::kDelay, {kDelay_s}, 0});
  }
  const auto study = Study::begin(recording, effects);
  ASSERT_TRUE(study) << study.error().message();
  ASSERT_EQ((*study)->observations().size(), 2U);
  for (const auto& data : (*study)->observations()) {
    // Asked twice, because what a delay does is remembered.
    for (int time = 0; time < 2; ++time)
      EXPECT_LT(data->residual(effects).cwiseAbs().maxCoeff(), 10.0 * kNoise_dps);
  }
}

// An hour without a sample is one place for a step, not a thousand.
TEST(Study, StepsWithinAPauseAreOne) {
  Layout layout;
  for (const double t_s : {0.5, 1.5, 2.5, 3600.5, 3601.5}) {
    layout.blocks.emplace_back();
    layout.blocks.back().t_s = t_s;
  }
  std::vector<double> even_s;
  for (int k = 1; k < 3602; ++k)
    even_s.push_back(k);
  EXPECT_EQ(distinct_steps(layout, even_s), (std::vector<double>{1.0, 2.0, 3.0, 3601.0}));
}

Making short_making(std::uint64_t seed) {
  Making making;
  making.seconds = 60.0;
  making.rest_s = 20.0;
  making.seed = seed;
  return making;
}

Effects with(const Making& making, const model::Effect& effect) {
  Effects effects = noise_effects(making);
  effects.push_back(effect);
  return effects;
}

void expect_same(const Study& ours, const Study& theirs, const Effects& effects) {
  ASSERT_EQ(ours.observations().size(), theirs.observations().size());
  for (std::size_t place = 0; place < ours.observations().size(); ++place) {
    const Observations& a = *ours.observations()[place];
    const Observations& b = *theirs.observations()[place];
    EXPECT_EQ(a.t_s, b.t_s);
    EXPECT_EQ(a.observed_dps, b.observed_dps);
    EXPECT_EQ(a.residual(effects), b.residual(effects));
  }
}

// Without a reference the rate is learned anew: whatever was believed before leaves no trace.
TEST(Study, MotionDependsOnTheEffectsAlone) {
  Making making = short_making(161);
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 1 ? 0.01 * rate_dps : 0.0;
  };
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  const Effects truth = with(making, {1, model::Kind::kScaleFactor, {0.01}, 0});
  const Effects wrong = with(making, {0, model::Kind::kDelay, {0.1}, 0});
  const auto direct = made.study()->with_motion(truth);
  const auto detour = made.study()->with_motion(wrong)->with_motion(truth);
  expect_same(*detour, *direct, truth);
  const auto begun = Study::begin(made.recording(), truth);
  ASSERT_TRUE(begun);
  expect_same(**begun, *direct, truth);
  // Studies that were asked for another motion have kept theirs.
  expect_same(*made.study()->with_motion(noise_effects(making)), *made.study(), truth);
}

// With the right effects the rate is that of both gyros' mean, which the weights make the quieter;
// a scale factor that nobody knows is seen in it by its weight.
TEST(Study, MotionIsAsGoodAsTheEffects) {
  constexpr double kScale = 0.01;
  Making making = short_making(162);
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 1 ? kScale * rate_dps : 0.0;
  };
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  const auto error_of = [&](const Study& study) {
    double square = 0.0;
    double slope = 0.0;
    double rates = 0.0;
    double count = 0.0;
    for (double t_s = 25.0; t_s < 55.0; t_s += 0.037) {
      const double rate_dps = true_rate_dps(making, t_s);
      const double error_dps = study.signals(0).motion.rate(t_s).value - rate_dps;
      square += error_dps * error_dps;
      slope += error_dps * rate_dps;
      rates += rate_dps * rate_dps;
      count += 1.0;
    }
    return std::pair{std::sqrt(square / count), slope / rates};
  };
  // White noise of 1 and 2 thousandths counts 4 : 1; the second gyro's scale factor is a fifth.
  const auto [unaware_dps, unaware_share] = error_of(*made.study());
  EXPECT_NEAR(unaware_share, 0.2 * kScale, 0.1 * 0.2 * kScale);
  const auto study =
      made.study()->with_motion(with(making, {1, model::Kind::kScaleFactor, {kScale}, 0}));
  const auto [aware_dps, aware_share] = error_of(*study);
  EXPECT_LT(aware_dps, unaware_dps);
  EXPECT_NEAR(aware_share, 0.0, 0.01 * kScale);
  // No more than the noise of the mean, and less where it is filtered.
  const double noise_dps =
      std::hypot(0.8 * making.white_dps_rthz[0], 0.2 * making.white_dps_rthz[1]) /
      std::sqrt(making.interval_s);
  EXPECT_LT(aware_dps, noise_dps);
}

TEST(Study, ReferenceIsTheMotionWhateverTheEffects) {
  const Making making = short_making(163);
  const MadeStudy made(making);
  ASSERT_NE(made.study(), nullptr);
  const auto study =
      made.study()->with_motion(with(making, {0, model::Kind::kScaleFactor, {0.5}, 0}));
  expect_same(*study, *made.study(), noise_effects(making));
  EXPECT_EQ(study->place_of(0), 0U);
  EXPECT_EQ(study->place_of(1), 1U);
  EXPECT_TRUE(study->observations_of(1).holds[1]);
  EXPECT_FALSE(study->observations_of(1).holds[0]);
}

// Without one there is one place for both: each at rest, and their difference.
TEST(Study, PairIsSeenEachAtRestAndApartElsewhere) {
  const Making making = short_making(164);
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  ASSERT_EQ(made.study()->observations().size(), 1U);
  EXPECT_EQ(made.study()->place_of(1), 0U);
  const Observations& data = made.study()->observations_of(1);
  EXPECT_TRUE(data.holds[0] && data.holds[1]);
  std::array<double, 3> seconds{};
  for (std::size_t i = 0; i < data.t_s.size(); ++i) {
    const bool rests = data.channel[i] != Channel::kDifference;
    seconds[static_cast<std::size_t>(data.channel[i])] += making.interval_s;
    // The turns begin softly: within a second or two of rest nobody can tell, and what is late half
    // a second before that may be of the turns.
    if (data.t_s[i] < making.rest_s - 1.5) {
      EXPECT_TRUE(rests) << data.t_s[i];
    }
    if (data.t_s[i] > making.rest_s + 5.0) {
      EXPECT_FALSE(rests) << data.t_s[i];
    }
  }
  EXPECT_NEAR(seconds[0], making.rest_s, 3.0);
  EXPECT_EQ(seconds[0], seconds[1]);
  EXPECT_NEAR(seconds[0] + seconds[2], making.seconds, 1.0);
}

TEST(Study, SecondsThatAreUsedForTheFitStaySo) {
  const Making making = short_making(165);
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  const auto held_out_in = [](const Study& study, double from_s, double to_s) {
    int count = 0;
    for (const Block& block : study.observations().front()->layout.blocks)
      count += block.held_out && block.t_s >= from_s && block.t_s <= to_s ? 1 : 0;
    return count;
  };
  ASSERT_GT(held_out_in(*made.study(), 10.0, 25.0), 0);
  ASSERT_GT(held_out_in(*made.study(), 40.0, 55.0), 0);
  const int elsewhere = held_out_in(*made.study(), 25.5, 39.5);
  const auto first = made.study()->with_used_for_fit({10.0, 25.0});
  EXPECT_EQ(held_out_in(*first, 10.0, 25.0), 0);
  EXPECT_GT(held_out_in(*first, 40.0, 55.0), 0);
  // Neither a second span nor another motion forgets the first.
  const auto second = first->with_used_for_fit({40.0, 55.0})->with_motion(noise_effects(making));
  EXPECT_EQ(held_out_in(*second, 10.0, 25.0), 0);
  EXPECT_EQ(held_out_in(*second, 40.0, 55.0), 0);
  EXPECT_EQ(held_out_in(*second, 25.5, 39.5), elsewhere);
  EXPECT_GT(held_out_in(*made.study(), 10.0, 25.0), 0);
  expect_same(*second, *made.study(), noise_effects(making));
}

TEST(Study, RefusesWhatIsTooShort) {
  EXPECT_EQ(refusal(recording_of(25.0)).substr(0, 58),
            "the recording is too short: 25.0 s, 2500 samples of a; at ");
  Making slow = short_making(166);
  slow.interval_s = 0.2;
  EXPECT_EQ(refusal(make_recording(slow)).substr(0, 57),
            "the recording is too short: 60.0 s, 300 samples of a; at ");
}

TEST(Study, RefusesAReferenceThatIsNotThere) {
  Recording nothing = recording_of(60.0);
  nothing.reference_dps = {};
  EXPECT_EQ(refusal(nothing).substr(0, 84),
            "the configuration names a reference, but the recording holds 0 of its samples; recor");
  Recording part = recording_of(60.0);
  part.reference_dps.t_s.resize(4000);
  part.reference_dps.value.resize(4000);
  EXPECT_EQ(refusal(part).substr(0, 81),
            "the reference is there from 0.0 to 40.0 s only, the recording lasts 60.0 s; cut t");
}

// Without rest and reference nothing tells which gyro is wrong: what they differ about remains.
TEST(Study, SeesTheDifferenceAloneOfTurnsWithoutAReference) {
  Making making = short_making(167);
  making.rest_s = 0.0;
  const MadeStudy made(without_reference(make_recording(making)), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  for (const Channel channel : made.observations(0)->channel)
    EXPECT_EQ(channel, Channel::kDifference);
  ASSERT_EQ(made.study()->notes().size(), 1U);
  EXPECT_EQ(made.study()->notes()[0].substr(0, 96),
            "the recording holds no rest, and there is no reference: only the difference of the "
            "gyros is judg");
}

// A sensor that has died has few values to be judged by.
TEST(Study, RefusesASensorThatNeverMoves) {
  Recording recording = recording_of(60.0);
  for (std::size_t i = 300; i < recording.gyros[1].rate_dps.size(); ++i)
    recording.gyros[1].rate_dps[i] = recording.gyros[1].rate_dps[300];
  const std::string text = refusal(recording);
  EXPECT_NE(text.find("samples of b are left"), std::string::npos) << text;
  EXPECT_NE(text.find("record with a sensor that moves"), std::string::npos) << text;
}

// Where the step is as large as the noise most samples repeat the last: rounding is no noise then.
TEST(Study, KnowsWhichGyroIsCoarse) {
  const Making making = short_making(168);
  Recording recording = make_recording(making);
  constexpr double kStep_dps = 0.1;
  recording.gyros[0].step_dps = kStep_dps;
  for (double& rate_dps : recording.gyros[0].rate_dps)
    rate_dps = kStep_dps * std::round(rate_dps / kStep_dps);
  const MadeStudy made(std::move(recording), noise_effects(making));
  ASSERT_NE(made.study(), nullptr);
  EXPECT_TRUE(made.study()->is_coarse(0));
  EXPECT_FALSE(made.study()->is_coarse(1));
  EXPECT_TRUE(made.observations(0)->about.coarse[0]);
}

}  // namespace
}  // namespace vgyro::gap
