#include "gateway/intake.h"

#include <gtest/gtest.h>

#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::codec_of;
using rig::frame_of;
using rig::kIdA;
using rig::quantity_of;
using rig::signal_of;

constexpr std::int64_t kFarAhead_ms = 100'000;

// Rate 16 bits from bit 0, 0.01 deg/s, up to 300 deg/s; a counter in byte 2.
GyroPlan counted_plan() {
  GyroPlan plan = rig::gyro_plan(0, kIdA, "a");
  plan.rate = quantity_of(signal_of(0, 16, 0.01), 300.0);
  plan.e2e.counter =
      AliveCounter{"Counter", codec_of(signal_of(16, 8, 1.0, 0.0, dbc::ValueType::kUnsigned)), 256};
  return plan;
}
can::Frame one_dps(std::uint8_t counter) {
  return frame_of(kIdA, {0x64, 0x00, counter});
}
can::Frame beyond_its_range(std::uint8_t counter) {
  return frame_of(kIdA, {0xFF, 0x7F, counter});
}
can::Frame too_short() {
  return frame_of(kIdA, {0x64});
}

class GyroIntakeTest : public testing::Test {
 protected:
  GyroIntake of(Timed timed) const { return {0, GyroInput(plan_), timed}; }
  GyroPlan plan_ = counted_plan();
  fusion::StampGuard guard_;
};

TEST_F(GyroIntakeTest, SaysTheValueAndItsTime) {
  GyroIntake intake = of(Timed::kValues);
  const GyroIntake::Result taken = intake.take(one_dps(1), at_ms(10), guard_);
  EXPECT_FALSE(taken.reject);
  EXPECT_TRUE(taken.stamp.believed());
  EXPECT_DOUBLE_EQ(taken.rate_dps, 1.0);
  EXPECT_EQ(taken.stamp.t, at_ms(10));
  EXPECT_EQ(intake.input().counter(), 1U);
}

TEST_F(GyroIntakeTest, SaysWhatIsWrongWithAStamp) {
  GyroIntake intake = of(Timed::kValues);
  intake.take(one_dps(1), at_ms(10), guard_);
  const GyroIntake::Result repeated = intake.take(one_dps(2), at_ms(10), guard_);
  EXPECT_EQ(repeated.reject, Reject::kStampRepeated);
  EXPECT_EQ(repeated.stamp.t, at_ms(10));
  const GyroIntake::Result jumped = intake.take(one_dps(3), at_ms(kFarAhead_ms), guard_);
  EXPECT_EQ(jumped.reject, Reject::kStampJump);
  EXPECT_FALSE(jumped.stamp.believed());
}

TEST_F(GyroIntakeTest, JudgesNoStampThatCannotBeTime) {
  GyroIntake intake = of(Timed::kValues);
  EXPECT_EQ(intake.take(one_dps(1), at_ms(-10), guard_).reject, Reject::kStampJump);
}

TEST_F(GyroIntakeTest, AsksForTheStampsOfSickFramesWhereTheyAreWanted) {
  GyroIntake live = of(Timed::kSickToo);
  const GyroIntake::Result sick = live.take(beyond_its_range(1), at_ms(10), guard_);
  EXPECT_EQ(sick.reject, Reject::kOutOfRange);
  EXPECT_TRUE(sick.stamp.believed());
  EXPECT_EQ(sick.stamp.t, at_ms(10));
  const GyroIntake::Result again = live.take(beyond_its_range(2), at_ms(10), guard_);
  EXPECT_EQ(again.reject, Reject::kOutOfRange) << "what the frame says comes first";
  EXPECT_EQ(again.stamp.reject, Reject::kStampRepeated);
}

TEST_F(GyroIntakeTest, AFrameWithoutAValueLeavesTheStampToTheNext) {
  GyroIntake reader = of(Timed::kValues);
  EXPECT_FALSE(reader.take(beyond_its_range(1), at_ms(10), guard_).stamp.judged);
  EXPECT_FALSE(reader.take(one_dps(2), at_ms(10), guard_).reject);
}

TEST_F(GyroIntakeTest, AFrameOfSomebodyElseHasNoStampForAnybody) {
  GyroIntake live = of(Timed::kSickToo);
  const GyroIntake::Result taken = live.take(too_short(), at_ms(10), guard_);
  EXPECT_EQ(taken.reject, Reject::kTruncated);
  EXPECT_FALSE(taken.stamp.judged);
  EXPECT_FALSE(live.take(one_dps(1), at_ms(10), guard_).reject);
}

TEST_F(GyroIntakeTest, TellsThatTheClockWasSetBack) {
  GyroIntake intake = of(Timed::kValues);
  std::uint8_t counter = 0;
  const TimePoint newest = at_ms(kFarAhead_ms);
  intake.take(one_dps(counter++), newest, guard_);
  GyroIntake::Result taken;
  for (int i = 0; i < fusion::StampGuard::kConfirmations; ++i) {
    EXPECT_FALSE(taken.stamp.clock_step);
    taken = intake.take(one_dps(counter++), at_ms(10 * (i + 1)), guard_);
  }
  EXPECT_TRUE(taken.stamp.clock_step);
  EXPECT_FALSE(taken.reject);
  EXPECT_GT(taken.stamp.t, newest);
}

TEST_F(GyroIntakeTest, CountsNothingMissingAcrossASilence) {
  GyroIntake intake = of(Timed::kValues);
  intake.take(one_dps(1), at_ms(10), guard_);
  EXPECT_EQ(intake.take(one_dps(4), at_ms(20), guard_).missing, 2U);
  intake.fall_silent();
  EXPECT_EQ(intake.take(one_dps(9), at_ms(30), guard_).missing, 0U);
}

// Three axes of one byte each, up to 100; a counter in byte 3.
AccelerometerPlan three_bytes() {
  const auto axis = [](std::uint16_t start) { return quantity_of(signal_of(start, 8), 100.0); };
  AccelerometerPlan plan{
      "can0", "ACCEL", {0, kIdA, can::kStandardIdMax, false}, {axis(0), axis(8), axis(16)}};
  plan.e2e.counter =
      AliveCounter{"Counter", codec_of(signal_of(24, 8, 1.0, 0.0, dbc::ValueType::kUnsigned)), 256};
  return plan;
}

TEST(AxesIntake, TakesAllAxesOrNone) {
  const AccelerometerPlan plan = three_bytes();
  fusion::StampGuard guard;
  AxesIntake intake = accelerometer_intake(plan);
  const auto taken = intake.take(frame_of(kIdA, {1, 2, 3, 0}), at_ms(0), guard);
  ASSERT_FALSE(taken.reject);
  EXPECT_EQ(taken.value, (std::array<double, 3>{1.0, 2.0, 3.0}));
  EXPECT_EQ(intake.take(frame_of(kIdA, {1, 2, 120, 1}), at_ms(10), guard).reject,
            Reject::kOutOfRange);
}

TEST(AxesIntake, AsksForTheCounterBeforeTheValues) {
  const AccelerometerPlan plan = three_bytes();
  fusion::StampGuard guard;
  AxesIntake intake = accelerometer_intake(plan);
  ASSERT_FALSE(intake.take(frame_of(kIdA, {1, 2, 3, 7}), at_ms(0), guard).reject);
  EXPECT_EQ(intake.take(frame_of(kIdA, {1, 2, 120, 7}), at_ms(10), guard).reject,
            Reject::kCounterRepeated);
}

TEST(ScalarIntake, StreamsOfOneGuardDoNotRepeatEachOther) {
  const ReferencePlan reference{"can0", "REFERENCE", {}, quantity_of(signal_of(0, 16, 0.01))};
  const SpeedPlan speed{"can0", "WHEEL", {}, quantity_of(signal_of(0, 16, 0.1))};
  fusion::StampGuard guard;
  ScalarIntake rates = reference_intake(reference);
  ScalarIntake speeds = speed_intake(speed);
  const can::Frame frame = frame_of(kIdA, {10, 0});
  const auto rate = rates.take(frame, at_ms(10), guard);
  const auto metres = speeds.take(frame, at_ms(10), guard);
  ASSERT_FALSE(rate.reject);
  ASSERT_FALSE(metres.reject);
  EXPECT_DOUBLE_EQ(rate.value[0], 0.1);
  EXPECT_DOUBLE_EQ(metres.value[0], 1.0);
  EXPECT_EQ(rates.take(frame, at_ms(10), guard).reject, Reject::kStampRepeated);
}

}  // namespace
}  // namespace vgyro::gateway
