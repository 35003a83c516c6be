#include "gateway/surroundings.h"

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "tests/gateway/counting_new.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::ms;

constexpr std::uint32_t kIdAccelerometer = 0x210;
constexpr std::uint32_t kIdSpeed = 0x220;

Quantity float_at(std::uint16_t start, double limit) {
  return rig::quantity_of(rig::signal_of(start, 32, 1.0, 0.0, dbc::ValueType::kFloat32), limit, 12);
}

/// Accelerations and speed as floats, so that a frame can hold any of them.
Plan with_everything() {
  Plan plan = rig::two_gyros();
  plan.gyros[0].temperature = rig::quantity_of(rig::signal_of(32, 16, 0.01));
  plan.gyros[0].supply_voltage = rig::quantity_of(rig::signal_of(48, 16, 0.001), 32.0);
  for (const auto axis : kOtherAxes)
    plan.gyros[0].*axis = rig::quantity_of(rig::signal_of(40, 8, 1.0), 100.0);
  plan.accelerometer = AccelerometerPlan{"can0",
                                         "ACCEL",
                                         {0, kIdAccelerometer, can::kStandardIdMax, false},
                                         {float_at(0, 1e4), float_at(32, 1e4), float_at(64, 1e4)}};
  plan.speed =
      SpeedPlan{"can0", "WHEEL", {0, kIdSpeed, can::kStandardIdMax, false}, float_at(0, 100.0)};
  return plan;
}

std::vector<std::uint8_t> bytes_of(std::initializer_list<float> values) {
  std::vector<std::uint8_t> bytes;
  for (const float value : values) {
    const auto raw = std::bit_cast<std::uint32_t>(value);
    for (unsigned shift = 0; shift < 32; shift += 8)
      bytes.push_back(static_cast<std::uint8_t>(raw >> shift));
  }
  return bytes;
}

can::Frame accelerometer_frame(float x, float y, float z) {
  return rig::frame_of(kIdAccelerometer, bytes_of({x, y, z}), can::kFd);
}
can::Frame speed_frame(float speed) {
  return rig::frame_of(kIdSpeed, bytes_of({speed, 0.0F, 0.0F}), can::kFd);
}

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

class SurroundingsTest : public testing::Test {
 protected:
  bool accelerate(std::int64_t at, float x, float y, float z) {
    return surroundings_.receive_acceleration(accelerometer_frame(x, y, z), at_ms(at), guard_);
  }
  bool roll(std::int64_t at, float speed) {
    return surroundings_.receive_speed(speed_frame(speed), at_ms(at), guard_);
  }
  Plan plan_ = with_everything();
  fusion::StampGuard guard_;
  Surroundings surroundings_{plan_};
};

TEST_F(SurroundingsTest, AreUnknownAtFirst) {
  surroundings_.begin(at_ms(0));
  const model::Surroundings s = surroundings_.at(0, at_ms(0));
  EXPECT_TRUE(std::isnan(s.temperature_c));
  EXPECT_TRUE(std::isnan(s.acceleration_g[2]));
  EXPECT_EQ(surroundings_.wheels(at_ms(0)), fusion::Wheels::kUnknown);
  EXPECT_TRUE(std::isnan(s.supply_v));
  const auto all = static_cast<std::uint8_t>((1U << model::kNeedCount) - 1U);
  EXPECT_EQ(surroundings_.missing(0, all), all);
  EXPECT_EQ(surroundings_.missing(0, model::kNeedsNothing), 0U);
}

TEST_F(SurroundingsTest, TakeTheNewestAcceleration) {
  EXPECT_TRUE(accelerate(0, 0.1F, 0.2F, 1.0F));
  EXPECT_TRUE(accelerate(10, 0.3F, 0.2F, 0.5F));
  EXPECT_FLOAT_EQ(static_cast<float>(surroundings_.at(1, at_ms(10)).acceleration_g[0]), 0.3F);
  EXPECT_EQ(surroundings_.missing(1, model::kNeedsAcceleration), 0U);
}

// Once all inputs were received none is missing, and every kind that depends on one has an effect.
// A new input is included without being named here.
TEST_F(SurroundingsTest, LackNothingOnceAllHaveSpoken) {
  const auto all = static_cast<std::uint8_t>((1U << model::kNeedCount) - 1U);
  surroundings_.begin(at_ms(0));
  GyroInput input(plan_.gyros[0]);
  for (std::int64_t at = 0; at < 10'000; at += 10) {
    const auto warm = static_cast<std::uint8_t>(at / 1000);
    const can::Frame frame = rig::frame_of(rig::kIdA, {0, 0, 0, 0, 0, warm, 0x88, 0x13});
    ASSERT_FALSE(input.decode(frame).reject);
    surroundings_.hear_gyro(0, at_ms(at), input, all);
    ASSERT_TRUE(accelerate(at, 0.1F, 0.2F, at % 20 == 0 ? 1.0F : 0.5F));
  }
  EXPECT_EQ(surroundings_.missing(0, all), 0U);
  const model::Surroundings s = surroundings_.at(0, at_ms(10'000));
  EXPECT_DOUBLE_EQ(s.supply_v, 5.0);
  for (const model::KindInfo& row : model::catalogue()) {
    if (row.added == nullptr || row.needs == model::kNeedsNothing) continue;
    const double added_dps = row.added({1.0, 1.0}, 10.0, s);
    EXPECT_TRUE(std::isfinite(added_dps) && added_dps != 0.0) << row.name << " " << added_dps;
  }
}

TEST_F(SurroundingsTest, HoldTheSupplyVoltage) {
  surroundings_.add_supply(0, 4.8);
  surroundings_.add_supply(0, std::nan(""));
  EXPECT_DOUBLE_EQ(surroundings_.at(0, at_ms(1000)).supply_v, 4.8);
  EXPECT_TRUE(std::isnan(surroundings_.at(1, at_ms(1000)).supply_v));
  EXPECT_EQ(surroundings_.missing(1, model::kNeedsSupply), model::kNeedsSupply);
}

// The rates are from the same frame as the gyro's: an axis without a value does not keep the last
// one.
TEST_F(SurroundingsTest, TellTheRatesAboutOtherAxesOfTheNewestFrame) {
  surroundings_.set_other_rates(1, {1.0, 2.0, std::nan("")});
  EXPECT_DOUBLE_EQ(surroundings_.at(1, at_ms(0)).other_rate_dps[1], 2.0);
  EXPECT_EQ(surroundings_.missing(1, model::kNeedsOtherAxes), model::kNeedsNothing);
  surroundings_.set_other_rates(1, {1.0, std::nan(""), std::nan("")});
  EXPECT_TRUE(std::isnan(surroundings_.at(1, at_ms(10)).other_rate_dps[1]));
  EXPECT_EQ(surroundings_.missing(0, model::kNeedsOtherAxes), model::kNeedsOtherAxes);
}

// The follower of a temperature that rises by 12 K and falls by 2: with a play of 5 K it is 5 K
// below at the top, then 3 K below.
TEST_F(SurroundingsTest, RememberWhereTheTemperatureHasBeen) {
  EXPECT_EQ(surroundings_.at(0, at_ms(0)).temperature_past, nullptr);
  const auto warm = [&](double t_s) {
    return t_s < 120.0 ? 20.0 + 0.1 * t_s : 32.0 - 0.1 * (t_s - 120.0);
  };
  for (int i = 0; i <= 1400; ++i)
    surroundings_.add_temperature(0, at_ms(100 * i), warm(0.1 * i));
  const model::Surroundings s = surroundings_.at(0, at_ms(140'000));
  ASSERT_NE(s.temperature_past, nullptr);
  EXPECT_NEAR(s.temperature_c, 30.0, 0.1);
  EXPECT_NEAR(s.temperature_past->followed_c(5.0, s.temperature_c), 27.0, 0.15);
}

// One frame with an impossible value must not affect every rate from then on.
TEST_F(SurroundingsTest, RefuseAccelerationsThatCannotBe) {
  ASSERT_TRUE(accelerate(0, 0.0F, 0.0F, 1.0F));
  EXPECT_FALSE(accelerate(10, kNan, 0.0F, 1.0F));
  EXPECT_FALSE(accelerate(20, 0.0F, kInfinity, 1.0F));
  EXPECT_FALSE(accelerate(30, 0.0F, 0.0F, -3e38F));
  can::Frame cut = accelerometer_frame(1.0F, 1.0F, 1.0F);
  cut.length = 8;
  EXPECT_FALSE(surroundings_.receive_acceleration(cut, at_ms(40), guard_));
  const model::Surroundings s = surroundings_.at(0, at_ms(50));
  EXPECT_EQ(s.acceleration_g[2], 1.0);
  EXPECT_EQ(s.vibration_g2, 0.0);
}

TEST_F(SurroundingsTest, TellStandingFromRolling) {
  EXPECT_TRUE(roll(0, 0.04F));
  EXPECT_EQ(surroundings_.wheels(at_ms(0)), fusion::Wheels::kStanding);
  EXPECT_TRUE(roll(100, -0.06F));
  EXPECT_EQ(surroundings_.wheels(at_ms(100)), fusion::Wheels::kRolling);
}

// A dead sensor is not a parked car.
TEST_F(SurroundingsTest, KnowNothingOfASpeedThatFellSilent) {
  ASSERT_TRUE(roll(0, 0.0F));
  EXPECT_EQ(surroundings_.wheels(at_ms(1000)), fusion::Wheels::kStanding);
  EXPECT_EQ(surroundings_.wheels(at_ms(1001)), fusion::Wheels::kUnknown);
}

TEST_F(SurroundingsTest, KnowNothingOfASpeedThatSaysItIsInvalid) {
  for (const float bad : {kNan, kInfinity, 101.0F}) {
    Surroundings surroundings(plan_);
    fusion::StampGuard guard;
    ASSERT_TRUE(surroundings.receive_speed(speed_frame(0.0F), at_ms(0), guard));
    EXPECT_FALSE(surroundings.receive_speed(speed_frame(bad), at_ms(10), guard));
    EXPECT_EQ(surroundings.wheels(at_ms(10)), fusion::Wheels::kUnknown) << bad;
    EXPECT_TRUE(surroundings.receive_speed(speed_frame(0.0F), at_ms(20), guard));
    EXPECT_EQ(surroundings.wheels(at_ms(20)), fusion::Wheels::kStanding);
  }
}

TEST_F(SurroundingsTest, RefuseAStampFarAhead) {
  ASSERT_TRUE(roll(0, 0.0F));
  EXPECT_FALSE(roll(3'600'000, 5.0F));
  EXPECT_EQ(surroundings_.wheels(at_ms(100)), fusion::Wheels::kStanding);
}

TEST_F(SurroundingsTest, TurnByTheRate) {
  surroundings_.begin(at_ms(0));
  for (int i = 1; i <= 300; ++i)
    surroundings_.add_rate(at_ms(10 * i), 90.0);
  // The first interval begins with the calibration's rate, here 0.
  const double turned = 90.0 * 3.0 - 0.45;
  EXPECT_NEAR(
      std::remainder(surroundings_.at(0, at_ms(3000)).angle_rad - turned * std::numbers::pi / 180.0,
                     2.0 * std::numbers::pi),
      0.0, 1e-9);
  EXPECT_NEAR(
      surroundings_.at(0, at_ms(3010)).angle_rad - surroundings_.at(0, at_ms(3000)).angle_rad,
      0.9 * std::numbers::pi / 180.0, 1e-9)
      << "carried on to the sample that asks";
}

TEST_F(SurroundingsTest, CountTimeFromTheFirstFrame) {
  surroundings_.begin(at_ms(500));
  surroundings_.begin(at_ms(700));
  surroundings_.reach(at_ms(1500));
  EXPECT_DOUBLE_EQ(surroundings_.at(0, at_ms(1500)).t_s, 1.0);
}

// A host without a clock starts in 1970, and its clock is set a minute later.
TEST_F(SurroundingsTest, DoNotCountALeapOfTheClock) {
  surroundings_.begin(at_ms(0));
  surroundings_.reach(at_ms(60'000));
  const TimePoint set_right = at_ms(60'000) + std::chrono::hours(24 * 365 * 50);
  surroundings_.reach(set_right);
  EXPECT_DOUBLE_EQ(surroundings_.at(0, set_right).t_s, 60.0);
  surroundings_.reach(set_right + ms(1000));
  EXPECT_DOUBLE_EQ(surroundings_.at(0, set_right + ms(1000)).t_s, 61.0);
}

// Reference frames are not samples: a garbage stamp among them has no effect, and if the clock
// really was set they wait for the gyros.
TEST_F(SurroundingsTest, PassOverRatesThatLeapAheadOfTheGyros) {
  const TimePoint leap = at_ms(0) + std::chrono::hours(24 * 365 * 160);
  surroundings_.begin(at_ms(0));
  surroundings_.add_rate(leap, 10.0);
  surroundings_.reach(at_ms(1000));
  surroundings_.add_rate(at_ms(1000), 10.0);
  // From the calibration's rate, here 0, to 10 deg/s.
  EXPECT_NEAR(surroundings_.at(0, at_ms(1000)).angle_rad, 5.0 * std::numbers::pi / 180.0, 1e-12);
  surroundings_.reach(leap);
  surroundings_.add_rate(leap + ms(1000), 10.0);
  const model::Surroundings after = surroundings_.at(0, leap + ms(1000));
  EXPECT_DOUBLE_EQ(after.t_s, 2.0);
  EXPECT_NEAR(after.angle_rad, 15.0 * std::numbers::pi / 180.0, 1e-12);
}

class Quiet final : public FrameSink {
 public:
  void put(const can::Frame& /*frame*/, TimePoint /*stamp*/) override {}
};

Plan with_model() {
  Plan plan = with_everything();
  plan.model.emplace();
  const auto add = [&](std::size_t gyro, model::Kind kind, model::Parameters parameters) {
    plan.model->effects.push_back({.gyro = gyro, .kind = kind, .parameters = parameters});
  };
  add(0, model::Kind::kTemperatureRateBias, {0.5});
  add(0, model::Kind::kVibrationRectification, {1e-3});
  add(1, model::Kind::kGSensitivity, {0.0, 1e-4});
  add(1, model::Kind::kScaleFactorCubic, {1e-7});
  add(1, model::Kind::kAngleHarmonic, {4.0, 0.01, 0.0});
  add(0, model::Kind::kDelay, {0.004});
  return plan;
}

// Whatever accelerometer and wheels send, rates stay finite, every frame is counted, and nothing is
// allocated.
TEST(SurroundingsInThePipeline, SurviveHostileFramesWithoutAllocating) {
  Plan plan = with_model();
  for (Quantity& axis : plan.accelerometer->axes) {
    axis.minimum = -3.0;
    axis.maximum = 3.0;
  }
  Pipeline pipeline(plan);
  Quiet sink;
  constexpr std::uint32_t kSeed = 8;
  SCOPED_TRACE(kSeed);
  rig::Dice dice(kSeed);
  std::vector<rig::Event> events =
      rig::merge({rig::stream_a(ms(0), ms(20'000), rig::constant(0.1)),
                  rig::stream_b(ms(0), ms(20'000), rig::constant(0.2))});
  std::vector<rig::Event> hostile;
  for (const rig::Event& event : events) {
    can::Frame frame = accelerometer_frame(0, 0, 0);
    if (dice.one_in(2)) frame.id = kIdSpeed;
    for (std::size_t i = 0; i < 12; ++i)
      frame.data[i] = static_cast<std::uint8_t>(dice.bits());
    if (dice.one_in(5)) frame.length = static_cast<std::uint8_t>(dice.below(13));
    hostile.push_back({0, frame, event.stamp + ms(1)});
  }
  events = rig::merge({events, hostile});
  const std::size_t before = allocations_so_far();
  rig::play(pipeline, events, sink);
  EXPECT_EQ(allocations_so_far(), before);
  const Status& status = pipeline.status();
  EXPECT_EQ(status.accelerometer_frames + status.speed_frames, hostile.size());
  EXPECT_GT(status.accelerometer_rejected, status.accelerometer_frames / 2);
  EXPECT_GT(status.rates_out_valid, 1500U);
  EXPECT_TRUE(std::isfinite(status.rate_dps));
  EXPECT_LT(std::abs(status.rate_dps), 1.0);
  EXPECT_EQ(status.gyros[0].samples, 2000U);
}

TEST(SurroundingsInThePipeline, TellWhatTheModelWaitsFor) {
  Pipeline pipeline(with_model());
  Quiet sink;
  EXPECT_EQ(pipeline.status().gyros[0].waits_for,
            model::kNeedsTemperature | model::kNeedsAcceleration);
  EXPECT_EQ(pipeline.status().gyros[1].waits_for, model::kNeedsAcceleration);
  pipeline.receive(0, rig::rate_frame(rig::kIdA, 0.1), at_ms(0), sink);
  pipeline.receive(0, accelerometer_frame(0, 0, 1), at_ms(1), sink);
  EXPECT_EQ(pipeline.status().gyros[0].waits_for, model::kNeedsNothing);
  EXPECT_EQ(pipeline.status().gyros[1].waits_for, model::kNeedsNothing);
}

struct WorstError final : RateObserver {
  void on_rate(TimePoint /*t*/, const std::array<double, 2>& raw_dps, double rate_dps) override {
    if (std::isnan(rate_dps)) return;
    ++valid;
    worst_dps = std::max(worst_dps, std::abs(rate_dps - kTrue_dps));
    worst_raw_dps = std::max(worst_raw_dps, std::abs(raw_dps[0] - kTrue_dps));
  }
  static constexpr double kTrue_dps = 0.0;
  std::size_t valid = 0;
  double worst_dps = 0.0;
  double worst_raw_dps = 0.0;
};

// A bias that depends on the supply voltage is corrected from the first sample after a step on,
// within the wire's resolution.
TEST(SurroundingsInThePipeline, ASupplyThatStepsMovesNoRate) {
  constexpr double kCoefficient_dps_v = 0.4;
  const auto supply_v = [](double t_s) { return t_s < 2.0 ? 5.0 : t_s < 4.0 ? 4.7 : 5.4; };
  for (const bool known : {true, false}) {
    Plan plan = with_everything();
    if (known) {
      plan.model.emplace();
      plan.model->effects.push_back({.gyro = 0,
                                     .kind = model::Kind::kSupplyVoltageBias,
                                     .parameters = {kCoefficient_dps_v, 5.0}});
    }
    rig::Recording a = rig::stream_a(
        ms(0), ms(6000), [&](double t_s) { return kCoefficient_dps_v * (supply_v(t_s) - 5.0); });
    for (rig::Event& event : a) {
      const double told_v = supply_v(to_seconds(event.stamp.time_since_epoch()));
      const auto raw = static_cast<std::uint16_t>(std::lround(told_v / 0.001));
      event.frame.data[6] = static_cast<std::uint8_t>(raw);
      event.frame.data[7] = static_cast<std::uint8_t>(raw >> 8U);
    }
    Pipeline pipeline(plan);
    WorstError seen;
    pipeline.observe(&seen);
    Quiet sink;
    rig::play(pipeline, rig::merge({a, rig::stream_b(ms(0), ms(6000), rig::constant(0.0))}), sink);
    EXPECT_GT(seen.valid, 400U);
    EXPECT_EQ(seen.worst_dps < rig::kRateStep_dps, known) << seen.worst_dps;
    EXPECT_EQ(seen.worst_raw_dps < rig::kRateStep_dps, known) << seen.worst_raw_dps;
    EXPECT_DOUBLE_EQ(pipeline.status().gyros[0].supply_v, 5.4);
    EXPECT_TRUE(std::isnan(pipeline.status().gyros[1].supply_v));
  }
}

// VG_Bias includes the bias that the model file states, although it was subtracted earlier.
TEST(SurroundingsInThePipeline, BiasIsToldAsAWhole) {
  Plan plan = rig::two_gyros();
  plan.corrector.method = Method::kMutual;
  plan.model.emplace();
  plan.model->effects.push_back({.gyro = 0, .kind = model::Kind::kBias, .parameters = {0.03}});
  Pipeline pipeline(plan);
  Quiet sink;
  rig::play(pipeline,
            rig::merge({rig::stream_a(ms(0), ms(5000), rig::constant(0.05)),
                        rig::stream_b(ms(0), ms(5000), rig::constant(-0.01))}),
            sink);
  EXPECT_NEAR(pipeline.status().gyros[0].bias_dps, 0.05, 1e-6);
  EXPECT_NEAR(pipeline.status().gyros[1].bias_dps, -0.01, 1e-6);
  EXPECT_NEAR(pipeline.status().rate_dps, 0.0, 1e-6);
}

}  // namespace
}  // namespace vgyro::gateway
