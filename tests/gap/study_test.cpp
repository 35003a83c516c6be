#include "gap/study.h"

#include <cmath>

#include <gtest/gtest.h>

#include "gap/scan.h"
#include "tests/gap/made_recording.h"

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

}  // namespace
}  // namespace vgyro::gap
