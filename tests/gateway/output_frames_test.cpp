#include "gateway/output_frames.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "receiver.h"

namespace vgyro::gateway {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr unsigned kSeed = 20240610;

RateOutput good_rate(double rate_dps) {
  return {.valid = true,
          .rate_dps = rate_dps,
          .sigma_dps = 0.01,
          .corrected_dps = {rate_dps, rate_dps},
          .state = State::kRunning,
          .quality = Quality::kTwoGyros,
          .health = 0,
          .age = Duration::zero(),
          .instant = TimePoint{}};
}

class ClassicOutput : public ::testing::Test {
 protected:
  const Receiver receiver{"vgyro.dbc"};
  OutputEncoder encoder{OutputPlan{}};
};

class FdOutput : public ::testing::Test {
 protected:
  static OutputPlan fd_plan() {
    OutputPlan plan;
    plan.fd = true;
    return plan;
  }
  const Receiver receiver{"vgyro_fd.dbc"};
  OutputEncoder encoder{fd_plan()};
};

// Every value comes back from the published layout within half a step, field by field.
TEST_F(ClassicOutput, RateComesBackWithinHalfAStep) {
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> rate(-419.43, 419.43);
  std::uniform_real_distribution<double> sigma(0.0, 0.0818);
  std::uniform_int_distribution<std::int64_t> age_ns(0, 7'500'000);
  for (int i = 0; i < 2000; ++i) {
    RateOutput output = good_rate(rate(rng));
    output.sigma_dps = sigma(rng);
    output.state = static_cast<State>(i % 5);
    output.quality = i % 2 == 0 ? Quality::kTwoGyros : Quality::kOneGyro;
    output.age = Duration(age_ns(rng));
    Fields fields = receiver.decode(encoder.rate(output));
    ASSERT_NEAR(fields["VG_Rate"].value, output.rate_dps, 2.5e-5 + 1e-12) << "seed " << kSeed;
    ASSERT_NEAR(fields["VG_Sigma"].value, output.sigma_dps, 1e-5 + 1e-12);
    ASSERT_NEAR(fields["VG_Age"].value, to_seconds(output.age) * 1e3, 0.25 + 1e-9);
    ASSERT_EQ(fields["VG_State"].label, to_string(output.state));
    ASSERT_EQ(fields["VG_Quality"].raw, static_cast<std::int64_t>(output.quality));
    ASSERT_EQ(fields["VG_Valid"].raw, 1);
  }
}

// The largest rates that the field holds are sent; one step beyond is invalid, never clipped.
TEST_F(ClassicOutput, SendsExtremesAndCallsTheRestInvalid) {
  for (const double sign : {1.0, -1.0}) {
    const double most = sign * 8388607.0 / 20000.0;
    EXPECT_TRUE(encoder.can_carry(most));
    EXPECT_EQ(receiver.decode(encoder.rate(good_rate(most)))["VG_Rate"].raw, sign * 8388607.0);
    for (const double beyond : {most + sign * 5e-5, sign * 1e4, sign * 1e300, sign * kInfinity}) {
      EXPECT_FALSE(encoder.can_carry(beyond)) << beyond;
      Fields fields = receiver.decode(encoder.rate(good_rate(beyond)));
      EXPECT_EQ(fields["VG_Rate"].label, "invalid") << beyond;
      EXPECT_EQ(fields["VG_Valid"].raw, 0);
      EXPECT_EQ(fields["VG_Quality"].label, "unusable");
    }
  }
}

// NaN is no rate; and an invalid output carries no number, whatever it was given.
TEST_F(ClassicOutput, InvalidCarriesNothing) {
  RateOutput off = good_rate(1.5);
  off.valid = false;
  for (const RateOutput& output : {good_rate(kNaN), off}) {
    Fields fields = receiver.decode(encoder.rate(output));
    EXPECT_EQ(fields["VG_Rate"].raw, -0x800000);
    EXPECT_EQ(fields["VG_Sigma"].label, "not_available");
    EXPECT_EQ(fields["VG_Valid"].label, "invalid");
    EXPECT_EQ(fields["VG_Quality"].label, "unusable");
    EXPECT_EQ(fields["VG_State"].label, "running");
  }
}

// A σ that is unknown or too large for its field is "not available", not a smaller one.
TEST_F(ClassicOutput, SigmaBeyondItsFieldIsNotAvailable) {
  RateOutput output = good_rate(1.0);
  for (const double sigma : {kNaN, -1.0, 4095 * 2e-5, 1.0, kInfinity}) {
    output.sigma_dps = sigma;
    EXPECT_EQ(receiver.decode(encoder.rate(output))["VG_Sigma"].label, "not_available") << sigma;
  }
  output.sigma_dps = 4094 * 2e-5;
  EXPECT_EQ(receiver.decode(encoder.rate(output))["VG_Sigma"].raw, 4094);
}

// The age is rounded to half milliseconds; above the field's range it is the largest value.
TEST_F(ClassicOutput, AgeIsRoundedAndSaturates) {
  const auto raw_age = [&](std::int64_t age_ns) {
    RateOutput output = good_rate(0.0);
    output.age = Duration(age_ns);
    return receiver.decode(encoder.rate(output))["VG_Age"].raw;
  };
  EXPECT_EQ(raw_age(0), 0);
  EXPECT_EQ(raw_age(249'999), 0);
  EXPECT_EQ(raw_age(250'000), 1);
  EXPECT_EQ(raw_age(7'249'999), 14);
  EXPECT_EQ(raw_age(7'250'000), 15);
  EXPECT_EQ(raw_age(60'000'000'000), 15);
  EXPECT_EQ(raw_age(-60'000'000'000), 0);
}

// Every output frame carries a correct E2E header whose counter runs 0…14, separately for each
// message.
TEST_F(ClassicOutput, IsProtectedAndCounted) {
  const dbc::E2eProfile11C rate(0x610);
  const dbc::E2eProfile11C bias(0x611);
  const dbc::E2eProfile11C model(0x612);
  const auto payload = [](const can::Frame& frame) {
    return std::span<const std::uint8_t, 8>(frame.data.data(), 8);
  };
  for (std::int64_t i = 0; i < 40; ++i) {
    const can::Frame& rate_frame = encoder.rate(good_rate(static_cast<double>(i)));
    ASSERT_TRUE(rate.check(payload(rate_frame)));
    ASSERT_EQ(receiver.decode(rate_frame)["VG_Counter"].raw, i % 15);
    const can::Frame& bias_frame = encoder.bias({{0.1, 0.2}, BiasMode::kTracking, 0});
    ASSERT_TRUE(bias.check(payload(bias_frame)));
    ASSERT_EQ(receiver.decode(bias_frame)["VB_Counter"].raw, i % 15);
    const can::Frame& model_frame = encoder.model({1e-3, 1e-3, 1e-4});
    ASSERT_TRUE(model.check(payload(model_frame)));
    ASSERT_EQ(receiver.decode(model_frame)["VM_Counter"].raw, i % 15);
  }
}

// The identifiers can be configured; the data ID of the protection follows them.
TEST_F(ClassicOutput, ProtectionFollowsTheIdentifier) {
  OutputPlan plan;
  plan.rate_id = 0x123;
  OutputEncoder moved(plan);
  const can::Frame& frame = moved.rate(good_rate(1.0));
  EXPECT_EQ(frame.id, 0x123U);
  EXPECT_TRUE(
      dbc::E2eProfile11C(0x123).check(std::span<const std::uint8_t, 8>(frame.data.data(), 8)));
  EXPECT_EQ(frame.data[1] >> 4U, 0x1);
}

// Both biases, mode and health come back; values beyond their field are not available.
TEST_F(ClassicOutput, BiasComesBackOrIsNotAvailable) {
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> bias(-5.2428, 5.2428);
  for (int i = 0; i < 500; ++i) {
    const BiasOutput output{
        {bias(rng), bias(rng)}, static_cast<BiasMode>(i % 4), static_cast<std::uint8_t>(i % 32)};
    Fields fields = receiver.decode(encoder.bias(output));
    ASSERT_NEAR(fields["VB_Bias1"].value, output.bias_dps[0], 5e-6 + 1e-12) << "seed " << kSeed;
    ASSERT_NEAR(fields["VB_Bias2"].value, output.bias_dps[1], 5e-6 + 1e-12);
    ASSERT_EQ(fields["VB_Mode"].raw, static_cast<std::int64_t>(output.mode));
    ASSERT_EQ(fields["VB_Health"].raw, output.health);
  }
  for (const double none : {kNaN, 5.25, -5.25, kInfinity, -1e300}) {
    Fields fields = receiver.decode(encoder.bias({{none, 1.0}, BiasMode::kHold, 0}));
    EXPECT_EQ(fields["VB_Bias1"].label, "not_available") << none;
    EXPECT_NEAR(fields["VB_Bias2"].value, 1.0, 5e-6);
    fields = receiver.decode(encoder.bias({{1.0, none}, BiasMode::kHold, 0}));
    EXPECT_EQ(fields["VB_Bias2"].label, "not_available") << none;
  }
}

// Modes and health bits on the wire match the DBC file's labels.
TEST_F(ClassicOutput, ModeAndHealthCarryTheirNames) {
  const auto label = [&](BiasMode mode, std::uint8_t health, const char* signal) {
    return receiver.decode(encoder.bias({{0.0, 0.0}, mode, health}))[signal].label;
  };
  EXPECT_EQ(label(BiasMode::kNone, 0, "VB_Mode"), "none");
  EXPECT_EQ(label(BiasMode::kCalibrating, 0, "VB_Mode"), "calibrating");
  EXPECT_EQ(label(BiasMode::kTracking, 0, "VB_Mode"), "tracking");
  EXPECT_EQ(label(BiasMode::kHold, 0, "VB_Mode"), "hold");
  EXPECT_EQ(label(BiasMode::kNone, 0, "VB_Health"), "ok");
  EXPECT_EQ(label(BiasMode::kNone, kGyro1Missing, "VB_Health"), "gyro_1_missing");
  EXPECT_EQ(label(BiasMode::kNone, kGyro2Missing, "VB_Health"), "gyro_2_missing");
}

// Slope and σ of the drift model come back; NaN and values that do not fit are not available.
TEST_F(ClassicOutput, ModelComesBackOrIsNotAvailable) {
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> slope(-8.388, 8.388);
  std::uniform_real_distribution<double> sigma(0.0, 1.0);
  for (int i = 0; i < 500; ++i) {
    const ModelOutput output{slope(rng), 0.0409 * sigma(rng), 0.00409 * sigma(rng)};
    Fields fields = receiver.decode(encoder.model(output));
    ASSERT_NEAR(fields["VM_Slope"].value, output.slope_dps_s, 5e-7 + 1e-12) << "seed " << kSeed;
    ASSERT_NEAR(fields["VM_BiasSigma"].value, output.bias_sigma_dps, 5e-6 + 1e-12);
    ASSERT_NEAR(fields["VM_SlopeSigma"].value, output.slope_sigma_dps_s, 5e-7 + 1e-12);
  }
  for (const double none : {kNaN, 9.0, kInfinity}) {
    Fields fields = receiver.decode(encoder.model({none, none, none}));
    EXPECT_EQ(fields["VM_Slope"].label, "not_available") << none;
    EXPECT_EQ(fields["VM_BiasSigma"].label, "not_available") << none;
    EXPECT_EQ(fields["VM_SlopeSigma"].label, "not_available") << none;
  }
}

// The FD frame carries the same quantities finer, the instant itself, and both corrected rates.
TEST_F(FdOutput, RateComesBackWithinHalfAStep) {
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> rate(-2147.0, 2147.0);
  std::uniform_int_distribution<std::int64_t> age_us(0, 65'534);
  std::uniform_int_distribution<std::int64_t> instant_us(0, 9'000'000'000'000'000);
  for (int i = 0; i < 1000; ++i) {
    RateOutput output = good_rate(rate(rng));
    output.sigma_dps = std::abs(rate(rng)) / 6.0;
    output.corrected_dps = {rate(rng), rate(rng)};
    output.health = static_cast<std::uint8_t>(i % 4);
    const std::int64_t age = age_us(rng);
    const std::int64_t instant = instant_us(rng);
    output.age = std::chrono::microseconds(age);
    output.instant = TimePoint{std::chrono::microseconds(instant)};
    const can::Frame& frame = encoder.rate(output);
    Fields fields = receiver.decode(frame);
    ASSERT_NEAR(fields["VG_Rate"].value, output.rate_dps, 5e-7 + 1e-9) << "seed " << kSeed;
    ASSERT_NEAR(fields["VG_Rate1"].value, output.corrected_dps[0], 5e-7 + 1e-9);
    ASSERT_NEAR(fields["VG_Rate2"].value, output.corrected_dps[1], 5e-7 + 1e-9);
    ASSERT_NEAR(fields["VG_Sigma"].value, output.sigma_dps, 5e-8 + 1e-9);
    ASSERT_EQ(fields["VG_Time"].raw, instant);
    ASSERT_EQ(fields["VG_Age"].raw, age);
    ASSERT_EQ(fields["VG_Health"].raw, output.health);
    ASSERT_EQ(fields["VG_Counter"].raw, i % 256);
    ASSERT_TRUE(dbc::E2eProfile5(0x610).check(frame.payload()));
  }
}

// The rate is an FD frame of 32 bytes; bias and model are classic frames.
TEST_F(FdOutput, OnlyTheRateIsAnFdFrame) {
  EXPECT_TRUE(encoder.rate(good_rate(0.0)).has(can::kFd));
  EXPECT_EQ(encoder.rate(good_rate(0.0)).length, 32);
  EXPECT_FALSE(encoder.bias({}).has(can::kFd));
  EXPECT_EQ(encoder.model({}).length, 8);
}

// Beyond the field, NaN, or from one gyro only: invalid or not available, never clipped.
TEST_F(FdOutput, OutOfRangeIsInvalid) {
  for (const double beyond : {2147.4837, -2147.4837, 1e300, kNaN, kInfinity}) {
    EXPECT_FALSE(encoder.can_carry(beyond)) << beyond;
    Fields fields = receiver.decode(encoder.rate(good_rate(beyond)));
    EXPECT_EQ(fields["VG_Rate"].label, "invalid") << beyond;
    EXPECT_EQ(fields["VG_Valid"].raw, 0);
    EXPECT_EQ(fields["VG_Rate1"].label, "invalid");
    EXPECT_EQ(fields["VG_Sigma"].label, "not_available");
  }
  EXPECT_TRUE(encoder.can_carry(2147.483647));
  EXPECT_EQ(receiver.decode(encoder.rate(good_rate(-2147.483647)))["VG_Rate"].raw, -2147483647);
  RateOutput one_gyro = good_rate(1.0);
  one_gyro.corrected_dps = {1.0, kNaN};
  Fields fields = receiver.decode(encoder.rate(one_gyro));
  EXPECT_NEAR(fields["VG_Rate1"].value, 1.0, 1e-9);
  EXPECT_EQ(fields["VG_Rate2"].label, "invalid");
}

// The FD age holds at most 65.535 ms.
TEST_F(FdOutput, AgeSaturates) {
  RateOutput output = good_rate(0.0);
  output.age = std::chrono::milliseconds(100);
  EXPECT_EQ(receiver.decode(encoder.rate(output))["VG_Age"].raw, 65535);
  output.age = Duration(1499);
  EXPECT_EQ(receiver.decode(encoder.rate(output))["VG_Age"].raw, 1);
}

}  // namespace
}  // namespace vgyro::gateway
