#include "gateway/input_frames.h"

#include <gtest/gtest.h>

#include "dbc/parser.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using dbc::ValueType;
using rig::codec_of;
using rig::kIdA;
using rig::quantity_of;
using rig::signal_of;

std::vector<int> bytes_of(const can::Frame& frame) {
  const auto payload = frame.payload();
  return {payload.begin(), payload.end()};
}

// Rate 16 bits from bit 0, 0.01 deg/s.
GyroPlan small_plan() {
  GyroPlan plan = rig::gyro_plan(0, kIdA, "a");
  plan.rate = quantity_of(signal_of(0, 16, 0.01), 300.0);
  plan.match.bytes = 4;
  return plan;
}

can::Frame gyro_frame(const GyroPlan& plan, double rate_dps, std::uint64_t count = 0) {
  can::Frame frame = empty_frame(plan.match);
  put_gyro(plan, rate_dps, count, frame);
  return frame;
}

TEST(InputFrames, HaveTheMessagesIdentifierAndLength) {
  const can::Frame small = empty_frame({0, 0x101, 0x7FF, false, 3});
  EXPECT_EQ(small.id, 0x101U);
  EXPECT_EQ(small.length, 3U);
  EXPECT_EQ(small.flags, 0U);
  const can::Frame large = empty_frame({0, 0x0CF02A00, 0x03FFFF00, true, 13});
  EXPECT_EQ(large.length, 16U) << "the next that CAN FD has";
  EXPECT_TRUE(large.has(can::kExtended));
  EXPECT_TRUE(large.has(can::kFd));
}

TEST(InputFrames, RoundTheRateAndStopAtTheSignalsEnds) {
  EXPECT_EQ(bytes_of(gyro_frame(small_plan(), 1.004)), (std::vector<int>{100, 0, 0, 0}));
  EXPECT_EQ(bytes_of(gyro_frame(small_plan(), -1.006)), (std::vector<int>{0x9B, 0xFF, 0, 0}));
  EXPECT_EQ(bytes_of(gyro_frame(small_plan(), 1e6)), (std::vector<int>{0xFF, 0x7F, 0, 0}));
  EXPECT_EQ(bytes_of(gyro_frame(small_plan(), -1e6)), (std::vector<int>{0x00, 0x80, 0, 0}));
  EXPECT_DOUBLE_EQ(carried_dps(small_plan()), 327.67);
}

TEST(InputFrames, TurnUnitAndSignBack) {
  GyroPlan plan = small_plan();
  plan.rate.scale = -57.29577951308232;  // rad/s, sign = -1
  EXPECT_EQ(bytes_of(gyro_frame(plan, 57.29577951308232)), (std::vector<int>{0x9C, 0xFF, 0, 0}));
  plan.sign = codec_of(signal_of(31, 1, 1.0, 0.0, ValueType::kUnsigned), 4);
  EXPECT_EQ(bytes_of(gyro_frame(plan, 57.29577951308232)), (std::vector<int>{100, 0, 0, 0x80}));
  EXPECT_EQ(bytes_of(gyro_frame(plan, -57.29577951308232)), (std::vector<int>{100, 0, 0, 0}));
}

TEST(InputFrames, CountTheFrames) {
  GyroPlan plan = small_plan();
  plan.e2e.counter =
      AliveCounter{"C", codec_of(signal_of(16, 4, 1.0, 0.0, ValueType::kUnsigned), 4), 15};
  EXPECT_EQ(gyro_frame(plan, 0.0, 14).data[2], 14);
  EXPECT_EQ(gyro_frame(plan, 0.0, 15).data[2], 0);
  EXPECT_EQ(gyro_frame(plan, 0.0, 15'000'000'007).data[2], 7);
}

TEST(InputFrames, FulfilTheConditionThatTheyAreJudgedBy) {
  GyroPlan plan = small_plan();
  const auto status = [&](Comparison comparison, double value) {
    plan.valid = ValidCondition{codec_of(signal_of(24, 2, 1.0, 0.0, ValueType::kUnsigned), 4),
                                comparison, value, "Status"};
    EXPECT_TRUE(check_valid(plan)) << value;
    return gyro_frame(plan, 0.0).data[3];
  };
  EXPECT_EQ(status(Comparison::kEqual, 0), 0);
  EXPECT_EQ(status(Comparison::kEqual, 2), 2);
  EXPECT_EQ(status(Comparison::kNotEqual, 0), 1);
  EXPECT_EQ(status(Comparison::kNotEqual, 3), 0) << "what is 0 already may stay";
  EXPECT_EQ(status(Comparison::kGreater, 1), 2);
  EXPECT_EQ(status(Comparison::kGreaterEqual, 3), 3);
  EXPECT_EQ(status(Comparison::kLess, 1), 0);
  plan.valid->comparison = Comparison::kGreater;
  plan.valid->value = 3.0;
  ASSERT_FALSE(check_valid(plan)) << "two bits hold no more than 3";
  EXPECT_NE(check_valid(plan).error().message().find("Status"), std::string::npos);
}

TEST(InputFrames, TurnToTheQuantitysPage) {
  const dbc::Database database = dbc::parse(
      "BO_ 1 M: 4 E\n"
      " SG_ Page M : 0|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ Rate m3 : 8|16@1- (0.01,0) [0|0] \"deg/s\" E\n"
      " SG_ Near m3 : 24|8@1+ (1,0) [0|0] \"degC\" E\n"
      " SG_ Far m4 : 8|8@1+ (1,0) [0|0] \"degC\" E\n",
      "test.dbc");
  const dbc::Message& message = database.messages.at(0);
  const auto quantity = [&](const char* name) {
    const dbc::Signal& signal = *message.find_signal(name);
    Quantity result = quantity_of(signal, 1e5, 4);
    result.presence = dbc::Presence::make(message, signal, "test").value();
    return result;
  };
  GyroPlan plan = small_plan();
  plan.rate = quantity("Rate");
  plan.temperature = quantity("Near");
  can::Frame frame = gyro_frame(plan, 1.0);
  EXPECT_EQ(bytes_of(frame), (std::vector<int>{3, 100, 0, 0}));
  EXPECT_TRUE(carries(plan, *plan.temperature, frame));
  put_quantity(*plan.temperature, 21.0, frame);
  EXPECT_EQ(bytes_of(frame), (std::vector<int>{3, 100, 0, 21}));
  plan.temperature = quantity("Far");
  EXPECT_FALSE(carries(plan, *plan.temperature, frame));
  can::Frame other = empty_frame(plan.match);
  put_quantity(*plan.temperature, 21.0, other);
  EXPECT_EQ(bytes_of(other), (std::vector<int>{4, 21, 0, 0}));
}

// J1939, 1/128 deg/s from -250: 300 deg/s would be the code for "error".
TEST(InputFrames, StopBelowTheCodesOfAProtocol) {
  GyroPlan plan = small_plan();
  dbc::Signal signal = signal_of(0, 16, 1.0 / 128, -250.0, ValueType::kUnsigned);
  plan.rate = quantity_of(signal, 1e5);
  plan.rate.codes = dbc::codes_of(signal, dbc::CodeRules::kJ1939);
  EXPECT_EQ(bytes_of(gyro_frame(plan, 300.0)), (std::vector<int>{0xFF, 0xFA, 0, 0}));
  EXPECT_EQ(bytes_of(gyro_frame(plan, 0.0)), (std::vector<int>{0x00, 0x7D, 0, 0}));
  EXPECT_EQ(bytes_of(gyro_frame(plan, -300.0)), (std::vector<int>{0, 0, 0, 0}));
  EXPECT_DOUBLE_EQ(carried_dps(plan), 250.0);
}

}  // namespace
}  // namespace vgyro::gateway
