#include "gap/identifiable.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Kind;

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = 60.0;
  making.rest_s = 20.0;
  making.interval_s = 0.02;
  making.seed = seed;
  return making;
}

// A recording in which all moves.
Recording moving() {
  Recording recording = make_recording(making_of(151));
  add_surroundings(recording);
  // z feels gravity more and less, too.
  for (std::size_t i = 0; i < recording.acceleration.t_s.size(); ++i)
    recording.acceleration.g[2][i] += 0.05 * std::sin(0.5 * recording.acceleration.t_s[i]);
  return recording;
}

std::vector<NotIdentifiable> lacking(Recording recording) {
  const MadeStudy made(std::move(recording), noise_effects(making_of(151)));
  EXPECT_NE(made.study(), nullptr);
  return made.study() == nullptr ? std::vector<NotIdentifiable>{} : not_identifiable(*made.study());
}

// All that is said, of gyro 1; the other lacks the same.
std::set<Kind> kinds_of(const std::vector<NotIdentifiable>& list) {
  std::set<Kind> kinds;
  std::set<Kind> of_other;
  for (const NotIdentifiable& one : list)
    (one.gyro == 0 ? kinds : of_other).insert(one.kind);
  EXPECT_EQ(kinds, of_other);
  return kinds;
}

void expect_said(const std::vector<NotIdentifiable>& list, const std::string& why,
                 const std::string& experiment) {
  for (const NotIdentifiable& one : list) {
    EXPECT_EQ(one.why, why);
    EXPECT_EQ(one.experiment, experiment);
  }
}

TEST(NotIdentifiable, IsNothingWhereAllMovesBesideAReference) {
  const auto list = lacking(moving());
  EXPECT_TRUE(list.empty()) << list.front().why;
}

TEST(NotIdentifiable, IsWhatDependsOnATemperatureThatIsConstant) {
  Recording recording = moving();
  for (GyroSeries& gyro : recording.gyros) {
    for (std::size_t i = 0; i < gyro.t_s.size(); ++i)
      gyro.temperature_c[i] = 25.0 + 0.1 * std::sin(gyro.t_s[i] / 20.0);
  }
  const auto list = lacking(std::move(recording));
  EXPECT_EQ(kinds_of(list),
            (std::set<Kind>{Kind::kTemperatureBias, Kind::kTemperatureBiasQuadratic,
                            Kind::kTemperatureRateBias, Kind::kScaleFactorTemperature}));
  for (const NotIdentifiable& one : list) {
    EXPECT_EQ(one.why.substr(0, 56), "the temperature is constant in this recording, within 0.")
        << one.why;
    EXPECT_EQ(one.experiment, "let the temperature change by 10 K, up and down");
  }
}

TEST(NotIdentifiable, IsTemperatureWhereNoSensorTellsIt) {
  Recording recording = moving();
  for (GyroSeries& gyro : recording.gyros)
    gyro.temperature_c.clear();
  const auto list = lacking(std::move(recording));
  EXPECT_EQ(kinds_of(list), (std::set<Kind>{Kind::kTemperatureBias}));
  EXPECT_EQ(list.size(), 2U);
  expect_said(list, "the configuration names no temperature signal",
              "name `temperature` in [[gyro]], if the sensor sends one");
}

TEST(NotIdentifiable, IsAccelerationWhereThereIsNoAccelerometer) {
  Recording recording = moving();
  recording.acceleration = {};
  recording.has_acceleration = false;
  const auto list = lacking(std::move(recording));
  EXPECT_EQ(kinds_of(list), (std::set<Kind>{Kind::kGSensitivity}));
  EXPECT_EQ(list.size(), 2U);
  expect_said(list, "the configuration names no accelerometer", "name an [accelerometer]");
}

TEST(NotIdentifiable, IsAccelerationOfALevelPlatformThatStandsStill) {
  Recording recording = moving();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (double& g : recording.acceleration.g[axis])
      g = axis == 2 ? 1.0 : 0.0;
  }
  const auto list = lacking(std::move(recording));
  EXPECT_EQ(kinds_of(list), (std::set<Kind>{Kind::kGSensitivity, Kind::kVibrationRectification}));
  for (const NotIdentifiable& one : list) {
    const bool tilt = one.kind == Kind::kGSensitivity;
    EXPECT_EQ(one.why, tilt ? "the acceleration is constant in this recording"
                            : "there is no vibration in this recording");
    EXPECT_EQ(one.experiment, tilt ? "tilt the platform about both horizontal axes"
                                   : "shake the platform in bursts");
  }
}

TEST(NotIdentifiable, IsTheAxisThatFeelsNothing) {
  Recording recording = moving();
  for (double& g : recording.acceleration.g[1])
    g = 0.0;
  const auto list = lacking(std::move(recording));
  EXPECT_EQ(list.size(), 2U);
  EXPECT_EQ(kinds_of(list), (std::set<Kind>{Kind::kGSensitivity}));
  expect_said(list, "the acceleration along y is constant in this recording",
              "tilt the platform so that y feels gravity");
}

TEST(NotIdentifiable, IsWhatTurnsTellOfAPlatformThatStands) {
  Making making = making_of(152);
  making.rest_s = making.seconds;
  Recording recording = make_recording(making);
  add_surroundings(recording);
  const auto list = lacking(std::move(recording));
  const std::set<Kind> kinds = kinds_of(list);
  EXPECT_TRUE(kinds.contains(Kind::kScaleFactor));
  EXPECT_TRUE(kinds.contains(Kind::kDelay));
  for (const NotIdentifiable& one : list) {
    if (one.kind != Kind::kScaleFactor && one.kind != Kind::kDelay) continue;
    EXPECT_EQ(one.why, "the platform never turned faster than 0 deg/s");
    EXPECT_EQ(one.experiment, one.kind == Kind::kDelay
                                  ? "turn to and fro a few times a second"
                                  : "turn both ways at several rates, some of them fast");
  }
}

TEST(NotIdentifiable, IsWhatBothGyrosShareWithoutAReference) {
  const auto list = lacking(without_reference(moving()));
  EXPECT_EQ(kinds_of(list), (std::set<Kind>{Kind::kScaleFactor}));
  expect_said(list,
              "what both gyros share does not show in their difference, and there is no reference",
              "record a rate table or a dual-antenna heading as [reference]");
}

TEST(NotIdentifiable, ExperimentThatTellsTwoReadingsApart) {
  const Reading scale{Kind::kScaleFactor, 0};
  const Reading other_scale{Kind::kScaleFactor, 1};
  const Reading delay{Kind::kDelay, 0};
  const Reading tilt{Kind::kGSensitivity, 0};
  const Reading bias{Kind::kBias, 0};
  EXPECT_EQ(experiment_for(scale, other_scale, false),
            "record a [reference]: a difference alone does not say which of two gyros is wrong");
  // With a reference each gyro is seen by itself.
  EXPECT_EQ(experiment_for(scale, other_scale, true),
            "turn both ways at many different rates, slow ones and the fastest");
  EXPECT_EQ(experiment_for(scale, delay, true),
            "turn to and fro faster, up to a tenth of the sampling rate, and for longer");
  EXPECT_EQ(experiment_for(bias, tilt, true),
            "tilt about both horizontal axes, and shake in bursts");
  EXPECT_EQ(experiment_for(bias, bias, true), "record for longer, with the motion at other times");
  for (const Reading& a : {scale, other_scale, delay, tilt, bias}) {
    for (const Reading& b : {scale, other_scale, delay, tilt, bias})
      EXPECT_EQ(experiment_for(a, b, false), experiment_for(b, a, false));
  }
}

}  // namespace
}  // namespace vgyro::gap
