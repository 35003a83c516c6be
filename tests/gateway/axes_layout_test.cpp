// The rates about all axes in one foreign message: bytes computed by hand from what the makers
// publish, when a frame is due, and what is refused.

#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "gateway/config.h"
#include "gateway/output_layout.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::ms;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegPerRad = 57.295779513082320877;
const std::string kProfiles = std::string(VGYRO_DBC_DIR) + "/profiles/";

constexpr const char* kDbc = R"(VERSION ""

BU_: RIG

BO_ 257 IMU_A: 8 RIG
 SG_ X : 0|16@1- (0.01,0) [-320|320] "deg/s" RIG
 SG_ Y : 16|16@1- (0.01,0) [-320|320] "deg/s" RIG
 SG_ Z : 32|16@1- (0.01,0) [-320|320] "deg/s" RIG

BO_ 258 IMU_B: 8 RIG
 SG_ X : 0|16@1- (0.01,0) [-320|320] "deg/s" RIG
 SG_ Y : 16|16@1- (0.01,0) [-320|320] "deg/s" RIG
 SG_ Z : 32|16@1- (0.01,0) [-320|320] "deg/s" RIG

BO_ 259 Whole: 8 RIG
 SG_ X : 0|12@1- (0.1,0) [-200|200] "deg/s" RIG
 SG_ Y : 12|12@1- (0.1,0) [-200|200] "deg/s" RIG
 SG_ Z : 24|12@1- (0.1,0) [-200|200] "deg/s" RIG
 SG_ SigmaZ : 36|8@1+ (0.01,0) [0|2.55] "deg/s" RIG
 SG_ Status : 44|2@1+ (1,0) [0|3] "" RIG
 SG_ Alive : 48|4@1+ (1,0) [0|14] "" RIG
 SG_ Sum : 63|8@0+ (1,0) [0|255] "" RIG

BO_ 260 Pages: 8 RIG
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" RIG
 SG_ X m1 : 8|16@1- (0.01,0) [0|0] "deg/s" RIG
 SG_ Y m1 : 24|16@1- (0.01,0) [0|0] "deg/s" RIG
 SG_ Z m2 : 8|16@1- (0.01,0) [0|0] "deg/s" RIG
)";

std::string config_of(const std::string& axes, const std::string& layout) {
  std::string text;
  for (const char* message : {"IMU_A", "IMU_B"}) {
    text += fmt::format(
        "[[gyro]]\nname = \"{0}\"\nbus = \"can0\"\ndbc = \"rig.dbc\"\nmessage = "
        "\"{0}\"\n{1}",
        message, axes);
  }
  return text + "[output]\nbus = \"can1\"\n[[output.layout]]\n" + layout;
}

constexpr const char* kThree = "rate_x = \"X\"\nrate_y = \"Y\"\nrate_z = \"Z\"\n";
constexpr const char* kWhole =
    "dbc = \"rig.dbc\"\nmessage = \"Whole\"\nrate_x = \"X\"\nrate_y = \"Y\"\nrate_z = \"Z\"\n";

ConfigResult load(const std::string& layout, const std::string& axes = kThree) {
  std::string folder = std::filesystem::temp_directory_path() / "vgyro-axes-layout-XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr) std::abort();
  std::ofstream(folder + "/rig.dbc") << kDbc;
  std::ofstream(folder + "/vgyro.toml") << config_of(axes, layout);
  auto loaded = load_config(folder + "/vgyro.toml");
  std::filesystem::remove_all(folder);
  return loaded;
}

OutputPlan output_of(const std::string& layout) {
  auto loaded = load(layout);
  if (loaded) return loaded->plan.output;
  for (const Error& error : loaded.error())
    ADD_FAILURE() << error.message();
  std::abort();
}

/// Exactly one error, with its line, that contains all of these parts.
void expect_error(const std::string& layout, const std::vector<std::string>& parts,
                  const std::string& axes = kThree) {
  const auto loaded = load(layout, axes);
  ASSERT_FALSE(loaded) << layout;
  ASSERT_EQ(loaded.error().size(), 1U) << loaded.error().back().message();
  const std::string message = loaded.error()[0].message();
  EXPECT_NE(message.find("vgyro.toml:"), std::string::npos) << message;
  for (const std::string& part : parts)
    EXPECT_NE(message.find(part), std::string::npos) << part << " in " << message;
}

RateOutput rate_of(double rate_dps, TimePoint instant = at_ms(0), double sigma_dps = 0.004) {
  RateOutput output;
  output.valid = true;
  output.rate_dps = rate_dps;
  output.sigma_dps = sigma_dps;
  output.instant = instant;
  return output;
}

RateOutput invalid() {
  RateOutput output = rate_of(12.5);
  output.valid = false;
  return output;
}

std::string text_of(const can::Frame* frame) {
  if (frame == nullptr) return {};
  std::string text = fmt::format("{:X}#", frame->id);
  for (const std::uint8_t byte : frame->payload())
    text += fmt::format("{:02X}", byte);
  return text;
}

std::string once(LayoutEncoder& encoder, const std::array<RateOutput, 3>& rates) {
  return text_of(encoder.rates({&rates[0], &rates[1], &rates[2]}, at_ms(0)));
}

// --- golden frames -------------------------------------------------------------------------------

// J1939-71: (rate + 250) · 128; roll is about x, pitch about y. -2 deg/s is 0x7C00, 1 is 0x7D80,
// 3 is 0x7E80; each has a merit of its own, 0 or "not available".
TEST(AxesLayout, J1939AngularRate) {
  const OutputPlan plan =
      output_of(fmt::format("dbc = \"{}j1939_ari.dbc\"\nmessage = \"ARI\"\nsource_address = 0xE2\n"
                            "rate_x = \"RollRate\"\nvalid_x = \"RollRateMerit == 0\"\n"
                            "rate_y = \"PitchRate\"\nvalid_y = \"PitchRateMerit == 0\"\n"
                            "rate_z = \"YawRate\"\nvalid_z = \"YawRateMerit == 0\"\n",
                            kProfiles));
  LayoutEncoder encoder(plan.layouts.at(0));
  EXPECT_EQ(once(encoder, {rate_of(1.0), rate_of(-2.0), rate_of(3.0)}), "CF02AE2#007C807D807EC0FF");
  EXPECT_EQ(once(encoder, {rate_of(1.0), rate_of(-2.0), invalid()}), "CF02AE2#007C807DFFFFF0FF");
  EXPECT_EQ(once(encoder, {rate_of(300.0), rate_of(-2.0), rate_of(3.0)}),
            "CF02AE2#007CFFFF807ECCFF")
      << "beyond what can be said";
  const RateOutput alone = rate_of(1.0);
  EXPECT_EQ(text_of(encoder.rates({&alone, nullptr, nullptr}, at_ms(1))),
            "CF02AE2#FFFF807DFFFFF3FF")
      << "axes of which there is nothing";
  EXPECT_EQ(encoder.counts(), (LayoutCounts{.frames = 4, .valid = 1, .out_of_range = 1}));
}

// x forward, y to the right, z down: two axes are reversed against the vehicle's. 0.25 rad/s is
// 250, 0.1 is 100.
TEST(AxesLayout, SbgEllipseCountsTwoAxesTheOtherWay) {
  const OutputPlan plan = output_of(fmt::format(
      "dbc = \"{}sbg_ellipse.dbc\"\nmessage = \"SBG_ImuGyro\"\nrate_not_available = -32768\n"
      "rate_x = \"RateX\"\nrate_y = \"RateY\"\nsign_y = -1\nrate_z = \"RateZ\"\nsign_z = -1\n",
      kProfiles));
  LayoutEncoder encoder(plan.layouts.at(0));
  const double rad = kDegPerRad;
  EXPECT_EQ(once(encoder, {rate_of(0.25 * rad), rate_of(0.1 * rad), rate_of(-rad)}),
            "122#FA009CFFE803");
  EXPECT_EQ(once(encoder, {rate_of(0.25 * rad), invalid(), rate_of(-rad)}), "122#FA000080E803");
}

// `sign` applies to all axes; the sign of an axis is multiplied with it.
TEST(AxesLayout, OneSignForAll) {
  const OutputPlan plan = output_of(
      fmt::format("dbc = \"{}oxts_rt.dbc\"\nmessage = \"RT_RateVehicle\"\nsign = -1\nsign_x = -1\n"
                  "rate_x = \"RateX\"\nrate_y = \"RateY\"\nrate_z = \"RateZ\"\n",
                  kProfiles));
  LayoutEncoder encoder(plan.layouts.at(0));
  EXPECT_EQ(once(encoder, {rate_of(0.01), rate_of(0.02), rate_of(0.03)}), "608#0100FEFFFDFF0000");
  // The layout has no code for an invalid rate, and so none for a missing one.
  EXPECT_EQ(once(encoder, {rate_of(0.01), invalid(), rate_of(0.03)}), "");
  EXPECT_EQ(once(encoder, {rate_of(0.01), rate_of(0.02), rate_of(400.0)}), "");
  EXPECT_EQ(encoder.counts(),
            (LayoutCounts{.frames = 1, .valid = 1, .out_of_range = 1, .withheld = 2}));
}

// One status for the frame: good only if all rates are. 1 deg/s is 10, -2 is 0xFEC of 12 bits, 3 is
// 0x1E; σ of 0.004 is rounded up to a step. Toyota's sum: 1 + 3 + 8 + the bytes.
TEST(AxesLayout, OneStatusOneCounterOneCheckValueForAll) {
  const OutputPlan plan =
      output_of(std::string(kWhole) +
                "sigma_z = \"SigmaZ\"\nvalid = \"Status == 1\"\ninvalid = 2\ncounter = \"Alive\"\n"
                "crc = \"Sum\"\ne2e = \"toyota\"\n");
  LayoutEncoder encoder(plan.layouts.at(0));
  EXPECT_EQ(once(encoder, {rate_of(1.0), rate_of(-2.0), rate_of(3.0)}), "103#0AC0FE1E10100012");
  EXPECT_EQ(once(encoder, {rate_of(1.0), rate_of(-2.0), invalid()}), "103#0AC0FE00F02F01F4");
}

// A layout of two of three axes, and one of a single axis, which is sent with that rate.
TEST(AxesLayout, SomeOfTheAxes) {
  const OutputPlan two = output_of(
      "dbc = \"rig.dbc\"\nmessage = \"IMU_B\"\nid = 0x300\n"
      "rate_x = \"X\"\nrate_z = \"Z\"\nrate_not_available = 0x8000\n");
  ASSERT_EQ(two.layouts.at(0).rates.size(), 2U);
  LayoutEncoder encoder(two.layouts[0]);
  EXPECT_EQ(once(encoder, {rate_of(1.0), rate_of(5.0), rate_of(2.0)}), "300#64000000C8000000");
  const OutputPlan one = output_of(
      "dbc = \"rig.dbc\"\nmessage = \"IMU_B\"\nid = 0x300\n"
      "rate_z = \"Z\"\n");
  const OutputPlan named = output_of(
      "dbc = \"rig.dbc\"\nmessage = \"IMU_B\"\nid = 0x300\n"
      "rate = \"Z\"\naxis = \"z\"\n");
  EXPECT_EQ(one.layouts, named.layouts);
}

// --- when ----------------------------------------------------------------------------------------

/// Records each frame with the instants of its rates: the rate encodes the instant, in steps of 0.1
/// deg/s.
class Reader final : public FrameSink {
 public:
  void put(const can::Frame&, TimePoint) override { ADD_FAILURE() << "not on this bus"; }
  void put_on(can::BusIndex, const can::Frame& frame, TimePoint stamp) override {
    std::string text = fmt::format("{:g}:", to_seconds(stamp - TimePoint{}) * 1e3);
    for (unsigned bit = 0; bit < 36; bit += 12) {
      const std::int64_t raw = rig::signed_bits(frame, bit, 12);
      text += raw == -2048 ? " -" : fmt::format(" {:g}", static_cast<double>(raw) / 10.0);
    }
    frames.push_back(text);
  }
  std::vector<std::string> frames;
};

class AxesLayoutTime : public ::testing::Test {
 protected:
  /// Gives these axes a new rate of one instant, in ms, as from one frame of a gyro.
  void hear(double t_ms, const std::vector<std::size_t>& axes) {
    const TimePoint t =
        TimePoint{std::chrono::microseconds(static_cast<std::int64_t>(1000.0 * t_ms))};
    for (const std::size_t axis : axes)
      set.take(axis, rate_of(t_ms, t), t, reader);
    set.settle(t, reader);
  }
  LayoutSet set{[] {
    OutputPlan plan = output_of(std::string(kWhole) + "rate_not_available = 0x800\n");
    plan.bus = 99;
    return plan;
  }()};
  Reader reader;
};

using Frames = std::vector<std::string>;

TEST_F(AxesLayoutTime, AxesOfOneInstantStandInOneFrame) {
  hear(10, {0, 1, 2});
  hear(20, {0, 1, 2});
  EXPECT_EQ(reader.frames, (Frames{"10: 10 10 10", "20: 20 20 20"}));
}

// The frame is sent with the last of the axes, which is known after the first pause.
TEST_F(AxesLayoutTime, AxesInMessagesOfTheirOwnStandInOneFrame) {
  for (int t = 10; t < 40; t += 10) {
    hear(t, {1});
    hear(t + 1, {2});
    hear(t + 2, {0});
  }
  EXPECT_EQ(reader.frames, (Frames{"10: - 10 -", "22: 22 20 21", "32: 32 30 31"}));
}

// A silent axis delays the frame no longer than its rate may be old.
TEST_F(AxesLayoutTime, AnAxisThatFallsSilentIsNotAvailable) {
  hear(10, {0, 1, 2});
  for (int t = 20; t < 80; t += 10)
    hear(t, {0, 2});
  hear(80, {0, 1, 2});
  EXPECT_EQ(reader.frames, (Frames{"10: 10 10 10", "30: 20 10 20", "40: 30 10 30", "40: 40 - 40",
                                   "50: 50 - 50", "60: 60 - 60", "70: 70 - 70", "80: 80 80 80"}));
}

// While an axis has a single gyro, its instants differ from those of the pairs.
TEST_F(AxesLayoutTime, AnAxisOfAnotherPhaseStandsInTheSameFrame) {
  hear(10, {0, 1, 2});
  for (int t = 20; t < 50; t += 10) {
    hear(t, {0, 1});
    hear(t + 6, {2});
  }
  EXPECT_EQ(reader.frames,
            (Frames{"10: 10 10 10", "26: 20 20 26", "36: 30 30 36", "46: 40 40 46"}));
}

TEST_F(AxesLayoutTime, AClockThatIsSetBackLeavesNoRateOfATimeToCome) {
  hear(5000, {0, 1, 2});
  hear(10, {0, 2});
  EXPECT_EQ(reader.frames.back(), "10: 10 - 10");
}

// --- what is refused -----------------------------------------------------------------------------

TEST(AxesLayout, RefusesWhatCannotBeMeant) {
  const std::string whole = kWhole;
  expect_error(whole + "rate = \"X\"\n",
               {"rate cannot be combined with rate_x", "rate_z for the axis"});
  expect_error(whole + "sigma = \"SigmaZ\"\n", {"sigma cannot be combined with rate_x", "sigma_z"});
  expect_error("dbc = \"rig.dbc\"\nmessage = \"Whole\"\nrate = \"Z\"\naxis = \"z\"\nsign_x = -1\n",
               {"sign_x without rate_x", "rate_x = \"SIGNAL\""});
  expect_error(whole + "axis = \"z\"\n", {"axis cannot be combined with rate_x", "leave it out"});
  expect_error(whole + "sign_y = 2\n", {"sign_y is 2", "-1 to flip"});
  expect_error(whole + "sign = 0\n", {"sign is 0", "-1 to flip"});
  expect_error(whole + "valid_y = \"Status\"\n", {"\"Status\" is not a comparison", "valid_y = "});
  expect_error(whole + "valid_y = \"Status == 1\"\nvalid_z = \"Status == 1\"\n",
               {"valid_z shares bits of Whole"});
  expect_error(whole + "invalid_y = 1\n", {"invalid_y without valid_y"});
  expect_error("dbc = \"rig.dbc\"\nmessage = \"Whole\"\nrate_x = \"X\"\nrate_y = \"X\"\n",
               {"rate_y shares bits of Whole", "a signal of its own"});
  expect_error("dbc = \"rig.dbc\"\nmessage = \"Whole\"\nrate_x = \"X\"\nrate_y = \"Yaw\"\n",
               {"no signal \"Yaw\"", "did you mean"});
  expect_error("dbc = \"rig.dbc\"\nmessage = \"Pages\"\nrate_x = \"X\"\nrate_z = \"Z\"\n",
               {"Z is not on the page of X"});
  expect_error(whole, {"the units have no axis \"y\"", "leave rate_y out"},
               "rate_x = \"X\"\nrate_z = \"Z\"\n");
  expect_error(whole, {"rate_x is of a platform of several axes", "rate = \"SIGNAL\""},
               "rate = \"Z\"\n");
}

}  // namespace
}  // namespace vgyro::gateway
