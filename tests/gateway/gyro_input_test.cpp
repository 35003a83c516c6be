#include "gateway/gyro_input.h"

#include <bit>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using dbc::ByteOrder;
using dbc::ValueType;
using rig::codec_of;
using rig::frame_of;
using rig::kIdA;
using rig::quantity_of;
using rig::signal_of;

// Rate 16 bits from bit 0, 0.01 deg/s; then a counter in byte 2 and a status in byte 3.
GyroPlan small_plan() {
  GyroPlan plan = rig::gyro_plan(0, kIdA, "a");
  plan.rate = quantity_of(signal_of(0, 16, 0.01), 300.0);
  return plan;
}

GyroPlan counted_plan(std::uint16_t bits, std::uint32_t modulus) {
  GyroPlan plan = small_plan();
  plan.e2e.counter = AliveCounter{
      "Counter", codec_of(signal_of(16, bits, 1.0, 0.0, ValueType::kUnsigned)), modulus};
  return plan;
}

can::Frame counted(std::uint8_t counter) {
  return frame_of(kIdA, {0x64, 0x00, counter, 0});
}

ValidCondition condition(Comparison comparison, double value) {
  return {codec_of(signal_of(24, 8, 0.5, 0.0, ValueType::kUnsigned)), comparison, value, "test"};
}

can::Frame with_status(std::uint8_t raw) {
  return frame_of(kIdA, {0x64, 0x00, 0, raw});
}

can::Frame float_frame(float value) {
  const auto word = std::bit_cast<std::uint32_t>(value);
  return frame_of(kIdA,
                  {static_cast<std::uint8_t>(word >> 24U), static_cast<std::uint8_t>(word >> 16U),
                   static_cast<std::uint8_t>(word >> 8U), static_cast<std::uint8_t>(word)});
}

GyroPlan float_plan() {
  GyroPlan plan = small_plan();
  plan.rate =
      quantity_of(signal_of(7, 32, 1.0, 0.0, ValueType::kFloat32, ByteOrder::kMotorola), 1e5);
  return plan;
}

// The plain case: two bytes in, a rate in deg/s out, with the configured scale and sign.
TEST(GyroInput, DecodesTheRateInDegreesPerSecond) {
  const GyroPlan plan = small_plan();
  GyroPlan flipped = small_plan();
  flipped.rate.scale = -1.0;
  const can::Frame frame = frame_of(kIdA, {0x9C, 0xFF});  // -100
  const GyroInput::Result result = GyroInput(plan).decode(frame);
  EXPECT_FALSE(result.reject);
  EXPECT_DOUBLE_EQ(result.rate_dps, -1.0);
  EXPECT_DOUBLE_EQ(GyroInput(flipped).decode(frame).rate_dps, 1.0);
}

// The DBC's limits apply in its own unit, before the conversion to deg/s.
TEST(GyroInput, JudgesTheRangeInTheFilesOwnUnit) {
  GyroPlan plan = small_plan();
  plan.rate.scale = 180.0 / M_PI;
  plan.rate.minimum = -5.0;
  plan.rate.maximum = 5.0;
  GyroInput input(plan);
  EXPECT_NEAR(input.decode(frame_of(kIdA, {0xF4, 0x01})).rate_dps, 5.0 * 180.0 / M_PI, 1e-9);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0xF5, 0x01})).reject, Reject::kOutOfRange);
}

// A remote frame has a length and no data: its bytes would be those of an earlier frame.
TEST(GyroInput, RefusesRemoteAndErrorFrames) {
  const GyroPlan plan = small_plan();
  GyroInput input(plan);
  EXPECT_EQ(input.decode(frame_of(kIdA, {1, 2, 3, 4}, can::kRemote)).reject, Reject::kNotData);
  EXPECT_EQ(input.decode(frame_of(kIdA, {1, 2, 3, 4}, can::kError)).reject, Reject::kNotData);
}

// A frame that is one byte too short for any of the signals read is refused.
TEST(GyroInput, RefusesFramesShorterThanAnySignalItReads) {
  const GyroPlan plain = small_plan();
  const GyroPlan counted_gyro = counted_plan(8, 256);
  GyroPlan judged = small_plan();
  judged.valid = condition(Comparison::kEqual, 0.0);
  GyroPlan with_sign = small_plan();
  with_sign.sign = codec_of(signal_of(24, 1, 1.0, 0.0, ValueType::kUnsigned));
  GyroPlan warm = small_plan();
  warm.temperature = quantity_of(signal_of(24, 8));
  const auto at_length = [](const GyroPlan& plan, std::size_t bytes) {
    return GyroInput(plan).decode(frame_of(kIdA, std::vector<std::uint8_t>(bytes))).reject;
  };
  EXPECT_EQ(at_length(plain, 0), Reject::kTruncated);
  EXPECT_EQ(at_length(plain, 1), Reject::kTruncated);
  EXPECT_FALSE(at_length(plain, 2));
  EXPECT_EQ(at_length(counted_gyro, 2), Reject::kTruncated);
  EXPECT_FALSE(at_length(counted_gyro, 3));
  for (const GyroPlan& plan : {judged, with_sign, warm}) {
    EXPECT_EQ(at_length(plan, 3), Reject::kTruncated);
    EXPECT_FALSE(at_length(plan, 4));
  }
}

// Every operator of `valid`, below, at and above its number; the physical value is compared.
TEST(GyroInput, UsesAFrameOnlyWhileItsComparisonHolds) {
  struct Case {
    Comparison comparison;
    bool below, at, above;
  };
  constexpr Case kCases[] = {
      {Comparison::kEqual, false, true, false},   {Comparison::kNotEqual, true, false, true},
      {Comparison::kLess, true, false, false},    {Comparison::kLessEqual, true, true, false},
      {Comparison::kGreater, false, false, true}, {Comparison::kGreaterEqual, false, true, true}};
  for (const Case& c : kCases) {
    GyroPlan plan = small_plan();
    plan.valid = condition(c.comparison, 2.0);
    GyroInput input(plan);
    const auto used = [&](std::uint8_t raw) { return !input.decode(with_status(raw)).reject; };
    const auto name = static_cast<int>(c.comparison);
    EXPECT_EQ(used(3), c.below) << name;
    EXPECT_EQ(used(4), c.at) << name;
    EXPECT_EQ(used(5), c.above) << name;
    for (std::uint8_t raw = 3; raw <= 5; ++raw) {
      const auto reject = input.decode(with_status(raw)).reject;
      EXPECT_TRUE(!reject || *reject == Reject::kFlaggedInvalid) << name;
    }
  }
}

// A sensor that hangs repeats its last frame; the counter shows it although the value looks fine.
TEST(GyroInput, DropsFrameWhenCounterRepeats) {
  const GyroPlan plan = counted_plan(8, 256);
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(counted(7)).reject);
  EXPECT_EQ(input.decode(counted(7)).reject, Reject::kCounterRepeated);
  EXPECT_EQ(input.decode(counted(7)).reject, Reject::kCounterRepeated);
  EXPECT_FALSE(input.decode(counted(8)).reject);
}

// The counter is followed through frames that other checks refuse, since they did arrive.
TEST(GyroInput, FollowsTheCounterThroughRefusedFrames) {
  GyroPlan plan = counted_plan(8, 256);
  plan.valid = condition(Comparison::kEqual, 0.0);
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(frame_of(kIdA, {0, 0, 1, 0})).reject);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0, 0, 2, 1})).reject, Reject::kFlaggedInvalid);
  const GyroInput::Result next = input.decode(frame_of(kIdA, {0, 0, 3, 0}));
  EXPECT_FALSE(next.reject);
  EXPECT_EQ(next.missing, 0U);
}

// A full turn of the counter without loss counts nothing as missing, at 256 and at AUTOSAR's 15.
TEST(GyroInput, CountsNothingMissingWhenTheCounterTurnsOver) {
  for (const std::uint32_t modulus : {256U, 15U}) {
    const GyroPlan plan = counted_plan(modulus == 15 ? 4 : 8, modulus);
    GyroInput input(plan);
    for (std::uint32_t i = 0; i < 3 * modulus; ++i) {
      const GyroInput::Result result =
          input.decode(counted(static_cast<std::uint8_t>(i % modulus)));
      ASSERT_FALSE(result.reject) << i;
      ASSERT_EQ(result.missing, 0U) << i;
    }
  }
}

// A step of n means n − 1 lost frames, also across the wrap of the counter.
TEST(GyroInput, CountsMissingFramesByTheCounter) {
  const GyroPlan wide = counted_plan(8, 256);
  GyroInput input(wide);
  EXPECT_EQ(input.decode(counted(250)).missing, 0U);
  EXPECT_EQ(input.decode(counted(253)).missing, 2U);
  EXPECT_EQ(input.decode(counted(2)).missing, 4U);
  const GyroPlan narrow = counted_plan(4, 15);
  GyroInput autosar(narrow);
  EXPECT_EQ(autosar.decode(counted(13)).missing, 0U);
  EXPECT_EQ(autosar.decode(counted(1)).missing, 2U);
}

// The value 15 of a counter that runs 0…14 means an error at the sender; counting must survive it.
TEST(GyroInput, SurvivesACounterValueThatDoesNotExist) {
  const GyroPlan plan = counted_plan(4, 15);
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(counted(14)).reject);
  EXPECT_LT(input.decode(counted(15)).missing, 15U);
  EXPECT_LT(input.decode(counted(3)).missing, 15U);
}

// After a silence the number of turns of the counter is unknown, so the first frame counts nothing
// as missing. But a sender that hangs and recovers may repeat its last frame.
TEST(GyroInput, CountsNothingAcrossASilenceAndStillRefusesTheLastFrame) {
  const GyroPlan plan = counted_plan(8, 256);
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(counted(7)).reject);
  input.fall_silent();
  EXPECT_EQ(input.decode(counted(7)).reject, Reject::kCounterRepeated);
  const GyroInput::Result again = input.decode(counted(11));
  EXPECT_FALSE(again.reject);
  EXPECT_EQ(again.missing, 0U);
  EXPECT_EQ(input.decode(counted(13)).missing, 1U);
}

// Some cars send magnitude and sign separately; 1 is negative.
TEST(GyroInput, TakesTheSignFromASignalOfItsOwn) {
  GyroPlan plan = small_plan();
  plan.rate = quantity_of(signal_of(0, 14, 0.01, 0.0, ValueType::kUnsigned));
  plan.sign = codec_of(signal_of(14, 1, 1.0, 0.0, ValueType::kUnsigned));
  GyroInput input(plan);
  EXPECT_DOUBLE_EQ(input.decode(frame_of(kIdA, {0x64, 0x00})).rate_dps, 1.0);
  EXPECT_DOUBLE_EQ(input.decode(frame_of(kIdA, {0x64, 0x40})).rate_dps, -1.0);
}

// On another page of a multiplexed message the rate's bits have another meaning.
TEST(GyroInput, ReadsAMultiplexedRateOnItsOwnPageOnly) {
  dbc::Message message;
  message.name = "M";
  message.size_bytes = 8;
  dbc::Signal page = signal_of(56, 8, 1.0, 0.0, ValueType::kUnsigned);
  page.name = "Page";
  page.is_multiplexor = true;
  dbc::Signal rate = signal_of(0, 16, 0.01);
  rate.name = "Rate";
  rate.condition = dbc::MultiplexCondition{"Page", {{2, 3}}};
  message.signals = {page, rate};
  GyroPlan plan = small_plan();
  plan.rate = quantity_of(rate);
  plan.rate.presence = dbc::Presence::make(message, rate, "test").value();
  GyroInput input(plan);
  for (std::uint8_t shown = 0; shown < 6; ++shown) {
    const auto result = input.decode(frame_of(kIdA, {0x64, 0, 0, 0, 0, 0, 0, shown}));
    if (shown == 2 || shown == 3) {
      EXPECT_FALSE(result.reject) << unsigned{shown};
      EXPECT_DOUBLE_EQ(result.rate_dps, 1.0);
    } else {
      EXPECT_EQ(result.reject, Reject::kOtherPage) << unsigned{shown};
    }
  }
  // Too short to hold its page number: refused, and nothing is read beyond the end.
  EXPECT_TRUE(input.decode(frame_of(kIdA, {0x64, 0})).reject);
}

// J1939: 0xFAFF is the last measurement. Values outside the DBC file's range are out of range.
TEST(GyroInput, RefusesTheCodesOfAProtocol) {
  dbc::Signal signal = signal_of(0, 16, 1.0 / 128, -250.0, ValueType::kUnsigned);
  GyroPlan plan = small_plan();
  plan.rate = quantity_of(signal, 1e5);
  plan.rate.codes = dbc::codes_of(signal, dbc::CodeRules::kJ1939);
  plan.rate.codes_in_range = true;
  plan.rate.maximum = plan.rate.highest();
  GyroInput input(plan);
  EXPECT_DOUBLE_EQ(input.decode(frame_of(kIdA, {0xFF, 0xFA})).rate_dps, 0xFAFF / 128.0 - 250);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0x00, 0xFB})).reject, Reject::kNoMeasurement);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0x00, 0xFE})).reject, Reject::kNoMeasurement);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0xFF, 0xFF})).reject, Reject::kNoMeasurement);
  plan.rate.codes_in_range = false;
  EXPECT_EQ(input.decode(frame_of(kIdA, {0x00, 0xFE})).reject, Reject::kOutOfRange);
}

// Motorola order counts from the most significant bit.
TEST(GyroInput, ReadsMotorolaOrder) {
  GyroPlan plan = small_plan();
  plan.rate = quantity_of(signal_of(7, 16, 0.01, 0.0, ValueType::kSigned, ByteOrder::kMotorola));
  EXPECT_DOUBLE_EQ(GyroInput(plan).decode(frame_of(kIdA, {0xFF, 0x9C})).rate_dps, -1.0);
}

// Float signals can hold values that no gyro measures; each has its own cause.
TEST(GyroInput, RefusesFloatsThatAreNoRate) {
  const GyroPlan plan = float_plan();
  GyroInput input(plan);
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_DOUBLE_EQ(input.decode(float_frame(-12.5F)).rate_dps, -12.5);
  EXPECT_EQ(input.decode(float_frame(std::nanf(""))).reject, Reject::kNotFinite);
  EXPECT_EQ(input.decode(float_frame(kInfinity)).reject, Reject::kNotFinite);
  EXPECT_EQ(input.decode(float_frame(-kInfinity)).reject, Reject::kNotFinite);
  EXPECT_EQ(input.decode(float_frame(1e30F)).reject, Reject::kOutOfRange);
  EXPECT_EQ(input.decode(float_frame(-1e30F)).reject, Reject::kOutOfRange);
}

// The limits themselves are inside.
TEST(GyroInput, RefusesRatesOutsideTheRange) {
  const GyroPlan plan = small_plan();  // ± 300 deg/s
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(frame_of(kIdA, {0x30, 0x75})).reject);                    // 300
  EXPECT_EQ(input.decode(frame_of(kIdA, {0x31, 0x75})).reject, Reject::kOutOfRange);  // 300.01
  EXPECT_FALSE(input.decode(frame_of(kIdA, {0xD0, 0x8A})).reject);                    // -300
  EXPECT_EQ(input.decode(frame_of(kIdA, {0xCF, 0x8A})).reject, Reject::kOutOfRange);
}

// The temperature is that of the newest frame that was used, in degC; NaN before there is one.
TEST(GyroInput, TellsTheTemperatureOfTheNewestUsedFrame) {
  GyroPlan plan = small_plan();
  plan.temperature = quantity_of(signal_of(16, 8, 1.0, -50.0, ValueType::kUnsigned));
  GyroInput input(plan);
  EXPECT_TRUE(std::isnan(input.temperature_c()));
  EXPECT_FALSE(input.decode(frame_of(kIdA, {0, 0, 75})).reject);
  EXPECT_DOUBLE_EQ(input.temperature_c(), 25.0);
  EXPECT_TRUE(input.decode(frame_of(kIdA, {0xFF, 0x7F, 99})).reject);
  EXPECT_DOUBLE_EQ(input.temperature_c(), 25.0);
  const GyroPlan cold = small_plan();
  GyroInput without(cold);
  EXPECT_FALSE(without.decode(frame_of(kIdA, {0, 0, 75})).reject);
  EXPECT_TRUE(std::isnan(without.temperature_c()));
}

// Each quantity beside the rate is from the newest frame that carried it.
TEST(GyroInput, TellsTheSupplyVoltageBesideTheTemperature) {
  GyroPlan plan = small_plan();
  plan.temperature = quantity_of(signal_of(16, 8, 1.0, -50.0, ValueType::kUnsigned));
  plan.supply_voltage = quantity_of(signal_of(24, 8, 0.05, 0.0, ValueType::kUnsigned), 10.0);
  GyroInput input(plan);
  EXPECT_TRUE(std::isnan(input.supply_v()));
  EXPECT_FALSE(input.decode(frame_of(kIdA, {1, 0, 75, 98})).reject);
  EXPECT_NEAR(input.supply_v(), 4.9, 1e-12);
  EXPECT_DOUBLE_EQ(input.temperature_c(), 25.0);
  EXPECT_EQ(input.decode(frame_of(kIdA, {1, 0, 76})).reject, Reject::kTruncated);
  EXPECT_FALSE(input.decode(frame_of(kIdA, {1, 0, 76, 255})).reject);
  EXPECT_TRUE(std::isnan(input.supply_v())) << "12.75 V are out of range";
  EXPECT_DOUBLE_EQ(input.temperature_c(), 26.0);
}

// An implausible temperature is unknown, and does not cost the rate.
TEST(GyroInput, KeepsTheRateWhenTheTemperatureIsOutOfRange) {
  GyroPlan plan = small_plan();
  plan.temperature = quantity_of(signal_of(16, 8, 1.0, 0.0, ValueType::kUnsigned), 100.0);
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(frame_of(kIdA, {0, 0, 255})).reject);
  EXPECT_TRUE(std::isnan(input.temperature_c()));
}

// A corrupted frame yields neither rate nor temperature, and does not advance the counter.
TEST(GyroInput, UsesNothingOfAFrameWithAWrongCheckValue) {
  GyroPlan plan = counted_plan(8, 256);
  plan.temperature = quantity_of(signal_of(24, 8, 1.0), 200.0);
  plan.e2e.crc =
      CheckValue{"Sum", "toyota",
                 dbc::E2eProtection({.kind = dbc::E2eKind::kToyota, .crc_byte = 4, .bytes = 5})};
  GyroInput input(plan);
  EXPECT_FALSE(input.decode(frame_of(kIdA, {0x64, 0x00, 1, 20, 0x7E})).reject);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0x64, 0x00, 2, 99, 0x7E})).reject, Reject::kCrcWrong);
  EXPECT_EQ(input.decode(frame_of(kIdA, {0x64, 0x00, 2, 99})).reject, Reject::kTruncated);
  EXPECT_DOUBLE_EQ(input.temperature_c(), 20.0);
  const GyroInput::Result good = input.decode(frame_of(kIdA, {0x65, 0x00, 2, 20, 0x80}));
  EXPECT_FALSE(good.reject);
  EXPECT_EQ(good.missing, 0U);
  EXPECT_DOUBLE_EQ(good.rate_dps, 1.01);
}

}  // namespace
}  // namespace vgyro::gateway
