// The virtual rate in foreign layouts: bytes computed by hand from what the makers publish, and
// properties that must hold for every layout and every rate.

#include "gateway/output_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "gateway/config.h"
#include "gateway/gyro_input.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::ms;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDegPerRad = 57.295779513082320877;
constexpr std::uint32_t kSeed = 20240713;

// NMEA 2000 rate of turn, PGN 127251 = 0x1F113: priority 2, any sender.
constexpr const char* kDbc = R"(VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ RateZ : 0|32@1- (0.000001,0) [-2000|2000] "deg/s" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ RateZ : 0|32@1- (0.000001,0) [-2000|2000] "deg/s" RIG

BO_ 2314277886 RateOfTurn: 8 RIG
 SG_ SID : 0|8@1+ (1,0) [0|252] "" RIG
 SG_ Rate : 8|32@1- (0.00000003125,0) [-67.108863|67.108863] "rad/s" RIG

BO_ 291 Guarded: 8 RIG
 SG_ Crc : 0|8@1+ (1,0) [0|255] "" RIG
 SG_ Counter : 8|4@1+ (1,0) [0|14] "" RIG
 SG_ Rate : 16|16@1- (0.01,0) [-320|320] "deg/s" RIG
 SG_ Sigma : 32|8@1+ (0.01,0) [0|2.55] "deg/s" RIG
 SG_ Fine : 40|8@1+ (0.01,0) [0|2.54] "deg/s" RIG
 SG_ Quality : 48|2@1+ (1,0) [0|3] "" RIG
 SG_ Start : 50|6@1- (1,0) [-32|31] "" RIG
 SG_ Sum : 63|8@0+ (1,0) [0|255] "" RIG

BO_ 292 Long: 20 RIG
 SG_ Crc : 0|16@1+ (1,0) [0|65535] "" RIG
 SG_ Counter : 16|8@1+ (1,0) [0|255] "" RIG
 SG_ Rate : 24|32@1- (0.000001,0) [-2000|2000] "deg/s" RIG
 SG_ Valid : 159|1@0+ (1,0) [0|1] "" RIG

BO_ 293 Pages: 8 RIG
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" RIG
 SG_ RateX m2 : 8|16@1- (0.01,0) [0|0] "deg/s" RIG
 SG_ RateZ m7 : 8|16@1- (0.01,0) [0|0] "deg/s" RIG
 SG_ Good m7 : 24|1@1+ (1,0) [0|1] "" RIG
 SG_ Other m2 : 24|1@1+ (1,0) [0|1] "" RIG

BO_ 294 Upside: 8 RIG
 SG_ Rate : 0|16@1+ (-0.01,300) [-300|300] "deg/s" RIG

BO_ 2565800190 ToOne: 8 RIG
 SG_ Rate : 0|16@1+ (0.01,-300) [-300|300] "deg/s" RIG

BO_ 295 ShortFd: 8 RIG
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" RIG

BO_ 2566842366 Packets: 20 RIG
 SG_ Rate : 0|16@1+ (0.01,-300) [-300|300] "deg/s" RIG

BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG","StandardCAN_FD";
BA_DEF_ SG_ "GenSigStartValue" FLOAT -100000 100000;
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "GenSigStartValue" SG_ 291 Start -5;
BA_ "VFrameFormat" BO_ 295 4;
VAL_ 291 Fine 255 "not available" ;
VAL_ 291 Quality 0 "none" 1 "poor" 2 "good" 3 "best" ;
)";

constexpr const char* kConfig = R"([[gyro]]
name = "a"
bus = "can0"
dbc = "rig.dbc"
message = "GYRO_A"
rate = "RateZ"

[[gyro]]
name = "b"
bus = "can0"
dbc = "rig.dbc"
message = "GYRO_B"
rate = "RateZ"

[output]
bus = "can1"
)";

const std::string kProfiles = std::string(VGYRO_DBC_DIR) + "/profiles/";

RateOutput rate_of(double rate_dps, double sigma_dps = 0.004) {
  return {.valid = true,
          .rate_dps = rate_dps,
          .sigma_dps = sigma_dps,
          .corrected_dps = {rate_dps, rate_dps},
          .state = State::kRunning,
          .quality = Quality::kTwoGyros,
          .health = 0,
          .age = ms(3),
          .instant = at_ms(0)};
}

RateOutput invalid() {
  RateOutput output = rate_of(12.5);
  output.valid = false;
  return output;
}

/// "174#0080..." as candump prints it; empty for no frame.
std::string text_of(const can::Frame* frame) {
  if (frame == nullptr) return {};
  std::string text = frame->has(can::kExtended) ? fmt::format("{:08X}", frame->id)
                                                : fmt::format("{:03X}", frame->id);
  text += frame->has(can::kFd) ? "##" : "#";
  for (const std::uint8_t byte : frame->payload())
    text += fmt::format("{:02X}", byte);
  return text;
}

class OutputLayoutTest : public ::testing::Test {
 protected:
  OutputLayoutTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "vgyro-layout-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    write("rig.dbc", kDbc);
  }
  ~OutputLayoutTest() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] ConfigResult load(const std::string& keys, const std::string& output = {}) const {
    write("vgyro.toml", kConfig + output + "\n[[output.layout]]\n" + keys);
    return load_config((folder_ / "vgyro.toml").string());
  }
  [[nodiscard]] Resolved resolved(const std::string& keys) const {
    auto loaded = load(keys);
    if (loaded) return std::move(*loaded);
    for (const Error& error : loaded.error())
      ADD_FAILURE() << error.message();
    std::abort();
  }
  [[nodiscard]] OutputLayout layout(const std::string& keys) const {
    return resolved(keys).plan.output.layouts.at(0);
  }
  [[nodiscard]] OutputLayout profile(const std::string& file, const std::string& keys) const {
    return layout(fmt::format("dbc = \"{}{}\"\n{}", kProfiles, file, keys));
  }
  [[nodiscard]] OutputLayout rig_layout(const std::string& keys) const {
    return layout("dbc = \"rig.dbc\"\n" + keys);
  }
  /// Exactly one error, which contains all of these parts.
  void expect_error(const std::string& keys, const std::vector<std::string>& parts,
                    const std::string& output = {}) const {
    const auto loaded = load("dbc = \"rig.dbc\"\n" + keys, output);
    ASSERT_FALSE(loaded) << keys;
    ASSERT_EQ(loaded.error().size(), 1U) << loaded.error().back().message();
    const std::string message = loaded.error()[0].message();
    EXPECT_NE(message.find("vgyro.toml:"), std::string::npos) << message;
    for (const std::string& part : parts)
      EXPECT_NE(message.find(part), std::string::npos) << part << " in " << message;
  }

  std::filesystem::path folder_;
};

std::string once(const OutputLayout& plan, const RateOutput& output) {
  LayoutEncoder encoder(plan);
  return text_of(encoder.rate(output, at_ms(0)));
}

// --- golden frames -------------------------------------------------------------------------------

const std::string kMm7 =
    "message = \"MM7_Yaw\"\nrate = \"YawRate\"\nvalid = \"YawStatus == 0\"\n"
    "counter = \"YawCounter\"\ncrc = \"YawCrc\"\ne2e = \"crc8_j1850\"\n";

// (1 deg/s + 163.84) / 0.005 = 0x80C8; the CRC is from a bit-by-bit SAE J1850 that gives 0x4B for
// "123456789". Not valid: all status bits set, and the rate that means no rotation.
TEST_F(OutputLayoutTest, BoschMm7) {
  LayoutEncoder encoder(profile("bosch_mm7.dbc", kMm7));
  EXPECT_EQ(text_of(encoder.rate(rate_of(1.0), at_ms(0))), "174#C880000000000007");
  EXPECT_EQ(text_of(encoder.rate(rate_of(1.0), at_ms(10))), "174#C88000000000011A");
  EXPECT_EQ(text_of(encoder.rate(invalid(), at_ms(20))), "174#0080F00000000203");
  EXPECT_EQ(once(profile("bosch_mm7.dbc", kMm7 + "fill = { Temperature = 25 }\n"), rate_of(1.0)),
            "174#C880004B000000B5");
}

const std::string kAri =
    "message = \"ARI\"\nrate = \"YawRate\"\nvalid = \"YawRateMerit == 0\"\nsource_address = 0xE2\n";

// The yaw rate of the makers' own frame CF02AE2#007D007D007D0005 (0 deg/s); unused signals are "not
// available", undefined bits are 1 (J1939-71).
TEST_F(OutputLayoutTest, J1939AngularRate) {
  const OutputLayout plan = profile("j1939_ari.dbc", kAri);
  EXPECT_EQ(once(plan, rate_of(0.0)), "0CF02AE2#FFFFFFFF007DCFFF");
  EXPECT_EQ(once(plan, rate_of(1.0)), "0CF02AE2#FFFFFFFF807DCFFF");
  EXPECT_EQ(once(plan, invalid()), "0CF02AE2#FFFFFFFFFFFFFFFF");
  EXPECT_EQ(once(profile("j1939_ari.dbc",
                         kAri + "fill = { PitchRate = 0, RollRate = 0, PitchRateMerit = 0, "
                                "RollRateMerit = 0 }\n"),
                 rate_of(0.0)),
            "0CF02AE2#007D007D007DC0FF");
}

// Rates end at 0xFAFF, 251.992 deg/s: higher values have other meanings.
TEST_F(OutputLayoutTest, J1939KeepsItsCodes) {
  const OutputLayout plan = profile("j1939_ari.dbc", kAri);
  EXPECT_EQ(once(plan, rate_of(251.9921875)), "0CF02AE2#FFFFFFFFFFFACFFF");
  for (const double beyond : {252.0, 261.0, -250.1, 1e9, -1e9, kInfinity, -kInfinity, kNaN})
    EXPECT_EQ(once(plan, rate_of(beyond)), "0CF02AE2#FFFFFFFFFFFFFFFF") << beyond;
}

// A real frame of a boat, as canboat publishes it: 127251,36,255,8,7d,0b,7d,02,00,ff,ff,ff with the
// sequence number 0x7D.
TEST_F(OutputLayoutTest, Nmea2000RateOfTurn) {
  const OutputLayout plan = rig_layout(
      "message = \"RateOfTurn\"\nrate = \"Rate\"\ncounter = \"SID\"\nsource_address = 36\n");
  LayoutEncoder encoder(plan);
  const RateOutput boat = rate_of(163083 * 3.125e-8 * kDegPerRad);
  for (int i = 0; i < 0x7D; ++i)
    encoder.rate(boat, at_ms(i));
  EXPECT_EQ(text_of(encoder.rate(boat, at_ms(0x7D))), "09F11324#7D0B7D0200FFFFFF");
  EXPECT_EQ(text_of(encoder.rate(invalid(), at_ms(200))), "09F11324#7EFFFFFF7FFFFFFF");
  EXPECT_EQ(text_of(encoder.rate(rate_of(4000.0), at_ms(300))), "09F11324#7FFEFFFF7FFFFFFF");
  EXPECT_EQ(text_of(encoder.rate(rate_of(-4000.0), at_ms(300))), "09F11324#80FEFFFF7FFFFFFF");
  for (int i = 0x81; i <= 252; ++i)
    encoder.rate(boat, at_ms(i));
  EXPECT_EQ(text_of(encoder.rate(boat, at_ms(999))).substr(0, 11), "09F11324#00")
      << "253 to 255 are no sequence numbers";
}

// Magnitude and sign are separate: -1.23 deg/s is 0x7B from bit 40, and bit 54.
TEST_F(OutputLayoutTest, VolkswagenEsp02) {
  const OutputLayout plan =
      profile("vw_esp_02.dbc",
              "message = \"ESP_02\"\nrate = \"YawRateMagnitude\"\nsign_signal = \"YawRateSign\"\n"
              "bus = \"can2\"\n");
  EXPECT_EQ(once(plan, rate_of(-1.23)), "101#00000000007B4000");
  EXPECT_EQ(once(plan, rate_of(1.23)), "101#00000000007B0000");
  EXPECT_EQ(once(plan, rate_of(-0.004)), "101#0000000000000000") << "zero has no sign";
  EXPECT_EQ(once(plan, rate_of(-163.83)), "101#0000000000FF7F00");
  EXPECT_EQ(once(plan, rate_of(-163.84)), "");
}

// (0.1 rad/s + 6.5) / 0.0002 = 0x80E8, Motorola.
TEST_F(OutputLayoutTest, Ford) {
  EXPECT_EQ(once(profile("ford_yaw.dbc", "message = \"Yaw_Data_FD1\"\nrate = \"YawRate\"\n"),
                 rate_of(0.1 * kDegPerRad)),
            "091#000080E800000000");
}

TEST_F(OutputLayoutTest, XsensSbgOxtsRacelogicHoneywell) {
  EXPECT_EQ(once(profile("xsens_mti.dbc", "message = \"MTi_RateOfTurn\"\nrate = \"RateZ\"\n"),
                 rate_of(kDegPerRad)),
            "032#000000000200")
      << "1 rad/s is 512, Motorola";
  EXPECT_EQ(once(profile("sbg_ellipse.dbc", "message = \"SBG_ImuGyro\"\nrate = \"RateZ\"\n"),
                 rate_of(0.25 * kDegPerRad)),
            "122#00000000FA00")
      << "250, Intel";
  EXPECT_EQ(once(profile("oxts_rt.dbc", "message = \"RT_RateVehicle\"\nrate = \"RateZ\"\n"),
                 rate_of(-12.34)),
            "608#000000002EFB0000")
      << "-1234, Intel";
  EXPECT_EQ(
      once(profile("racelogic_imu04.dbc", "message = \"IMU04_YawAccX\"\nrate = \"YawRate\"\n"),
           rate_of(1.5)),
      "600#3FC0000000000000")
      << "IEEE 754, Motorola";
  EXPECT_EQ(
      once(profile("honeywell_hg1120.dbc", "message = \"HG1120_InertialZ\"\nrate = \"RateZ\"\n"),
           rate_of(kDegPerRad)),
      "125#52B81E0500000000")
      << "2^33 / 100 = 0x051EB852, Intel";
}

// AUTOSAR's test vectors: data ID 0x123, eight zero bytes: 2A 10, then 77 11.
TEST_F(OutputLayoutTest, Profile11C) {
  LayoutEncoder encoder(
      rig_layout("message = \"Guarded\"\nrate = \"Rate\"\ncrc = \"Crc\"\ncounter = \"Counter\"\n"
                 "e2e = \"profile_11c\"\ndata_id = 0x123\n"
                 "fill = { Sigma = 0, Fine = 0, Quality = 0, Start = 0, Sum = 0 }\n"));
  EXPECT_EQ(text_of(encoder.rate(rate_of(0.0), at_ms(0))), "123#2A10000000000000");
  EXPECT_EQ(text_of(encoder.rate(rate_of(0.0), at_ms(1))), "123#7711000000000000");
  for (int i = 2; i < 15; ++i)
    encoder.rate(rate_of(0.0), at_ms(i));
  EXPECT_EQ(text_of(encoder.rate(rate_of(0.0), at_ms(15))), "123#2A10000000000000") << "modulo 15";
}

// 20 bytes are sent as CAN FD; bytes beyond the message's own are zero.
TEST_F(OutputLayoutTest, CanFd) {
  const OutputLayout plan =
      rig_layout("message = \"Long\"\nrate = \"Rate\"\nvalid = \"Valid == 1\"\n");
  EXPECT_EQ(once(plan, rate_of(-0.000002)), "124##000000FEFFFFFF" + std::string(24, '0') + "80");
  EXPECT_EQ(once(plan, invalid()), "124##" + std::string(40, '0'));
}

// Eight bytes are sent as CAN FD if the DBC file or the configuration says so.
TEST_F(OutputLayoutTest, ShortCanFd) {
  EXPECT_EQ(once(rig_layout("message = \"ShortFd\"\nrate = \"Rate\"\n"), rate_of(2.58)),
            "127##0201000000000000");
  EXPECT_EQ(once(rig_layout("message = \"ShortFd\"\nrate = \"Rate\"\nfd = false\n"), rate_of(2.58)),
            "127#0201000000000000");
  EXPECT_EQ(once(rig_layout("message = \"Upside\"\nrate = \"Rate\"\nfd = true\n"), rate_of(300.0)),
            "126##0000000000000000");
}

// The frame selects the page of the rate; a sum over identifier, length and bytes (Toyota's) uses
// the identifier that is sent.
TEST_F(OutputLayoutTest, PagesAndIdentifiers) {
  EXPECT_EQ(once(rig_layout("message = \"Pages\"\nrate = \"RateZ\"\nvalid = \"Good == 1\"\n"),
                 rate_of(2.58)),
            "125#0702010100000000");
  EXPECT_EQ(
      once(rig_layout("message = \"Guarded\"\nrate = \"Rate\"\ncrc = \"Sum\"\ne2e = \"toyota\"\n"
                      "id = 0x321\nfill = { Start = 0, Fine = 0 }\n"),
           rate_of(2.58)),
      "321#000002010000002F")
      << "3 + 0x21 + 8 + 2 + 1";
}

// --- what must hold of every layout --------------------------------------------------------------

class EveryLayout : public OutputLayoutTest {
 protected:
  [[nodiscard]] std::vector<OutputLayout> layouts() const {
    return {
        profile("bosch_mm7.dbc", kMm7),
        profile("j1939_ari.dbc", kAri),
        profile("j1939_ari.dbc",
                "message = \"ARI\"\nrate = \"YawRate\"\nsource_address = 1\nsign = -1\n"),
        profile("ford_yaw.dbc", "message = \"Yaw_Data_FD1\"\nrate = \"YawRate\"\n"),
        profile("xsens_mti.dbc",
                "message = \"MTi_RateOfTurn\"\nrate = \"RateZ\"\nrate_not_available = 0x8000\n"),
        profile("racelogic_imu04.dbc", "message = \"IMU04_YawAccX\"\nrate = \"YawRate\"\n"),
        rig_layout("message = \"RateOfTurn\"\nrate = \"Rate\"\nsource_address = 1\n"),
        rig_layout("message = \"Upside\"\nrate = \"Rate\"\n"),
        rig_layout("message = \"Pages\"\nrate = \"RateZ\"\nvalid = \"Good == 1\"\n")};
  }
};

double decoded_dps(const OutputLayout& plan, const can::Frame& frame) {
  const double value = plan.rates[0].rate.codec.decode(frame.payload()).value;
  return value * plan.rates[0].rate.scale + plan.rates[0].rate.shift;
}

// To the nearest step, with the order preserved.
TEST_F(EveryLayout, RoundsToTheNearestStepAndKeepsTheOrder) {
  for (const OutputLayout& plan : layouts()) {
    LayoutEncoder encoder(plan);
    rig::Dice dice(kSeed);
    std::vector<double> rates{0.0, -0.0, 1e-9, -1e-9, 0.0025, -0.0025};
    for (int i = 0; i < 5000; ++i)
      rates.push_back((static_cast<double>(dice.below(2'000'001)) - 1e6) * 1.5e-4);
    std::sort(rates.begin(), rates.end());
    double before = -kInfinity;
    for (const double rate_dps : rates) {
      const can::Frame* frame = encoder.rate(rate_of(rate_dps), at_ms(0));
      ASSERT_NE(frame, nullptr) << plan.message << ' ' << rate_dps;
      const double seen_dps = decoded_dps(plan, *frame);
      const double off = std::abs(seen_dps - rate_dps);
      EXPECT_LE(off, 0.5 * plan.rates[0].rate.step + 1e-6 * std::abs(rate_dps)) << plan.message;
      EXPECT_GE(seen_dps, before) << plan.message << ' ' << rate_dps;
      before = seen_dps;
    }
    EXPECT_EQ(encoder.counts().valid, rates.size());
    EXPECT_EQ(encoder.counts().out_of_range, 0U);
  }
}

/// A reader that follows the profile: does the frame carry a usable rate?
bool readable_as_valid(const OutputLayout& plan, const can::Frame& frame) {
  const std::int64_t raw = plan.rates[0].rate.codec.decode(frame.payload()).raw;
  const auto bits = static_cast<std::uint64_t>(raw);
  if (plan.message == "MM7_Yaw") return rig::bits(frame, 20, 4) == 0;
  if (plan.message == "ARI") return bits <= 0xFAFF && (!plan.valid || rig::bits(frame, 52, 2) == 0);
  if (plan.message == "RateOfTurn") return raw < 0x7FFFFFFD;
  if (plan.message == "MTi_RateOfTurn") return raw != -0x8000;
  if (plan.message == "Pages") return rig::bits(frame, 24, 1) == 1;
  return true;
}

// A rate that is not valid, or that the signal cannot carry, is not sent or cannot be read as a
// rate.
TEST_F(EveryLayout, IsNeverReadAsValidWhenItIsNot) {
  for (const OutputLayout& plan : layouts()) {
    LayoutEncoder encoder(plan);
    rig::Dice dice(kSeed);
    std::uint64_t frames = 0;
    for (int i = 0; i < 20'000; ++i) {
      RateOutput output = rate_of((static_cast<double>(dice.below(4'000'001)) - 2e6) * 1e-2);
      constexpr std::array kOdd{kNaN, kInfinity, -kInfinity, 1e300, -1e300};
      if (dice.one_in(50)) output.rate_dps = kOdd[dice.below(kOdd.size())];
      output.valid = !dice.one_in(3);
      output.sigma_dps = dice.one_in(5) ? kNaN : 0.01;
      const can::Frame* frame = encoder.rate(output, at_ms(i));
      if (frame == nullptr) continue;
      ++frames;
      if (!readable_as_valid(plan, *frame)) continue;
      EXPECT_TRUE(output.valid) << plan.message << ' ' << text_of(frame);
      const double off = std::abs(decoded_dps(plan, *frame) - output.rate_dps);
      EXPECT_LE(off, 0.5 * plan.rates[0].rate.step + 1e-6 * std::abs(output.rate_dps))
          << plan.message << ' ' << output.rate_dps << ' ' << text_of(frame);
    }
    EXPECT_EQ(encoder.counts().frames, frames);
    EXPECT_GT(encoder.counts().valid, 0U) << plan.message;
    EXPECT_GT(encoder.counts().out_of_range + (plan.message == "IMU04_YawAccX" ? 1U : 0U), 0U);
    EXPECT_EQ(encoder.counts().withheld > 0, !plan.can_say_invalid()) << plan.message;
  }
}

// --- σ, time, the rest of the frame --------------------------------------------------------------

// Never 0, and never understated. If the signal cannot carry σ, it is "not available"; if the
// signal has no code for that, the rate is not valid either, since a reader would trust it too
// much.
TEST_F(OutputLayoutTest, SigmaIsNeverUnderstated) {
  LayoutEncoder plain(
      rig_layout("message = \"Guarded\"\nrate = \"Rate\"\nsigma = \"Sigma\"\n"
                 "valid = \"Quality >= 2\"\n"));
  LayoutEncoder coded(
      rig_layout("message = \"Guarded\"\nrate = \"Rate\"\nsigma = \"Fine\"\n"
                 "valid = \"Quality >= 2\"\n"));
  const auto sigma_of = [](LayoutEncoder& encoder, const RateOutput& output, unsigned bit) {
    return rig::bits(*encoder.rate(output, at_ms(0)), bit, 8);
  };
  EXPECT_EQ(sigma_of(plain, rate_of(1.0, 0.126), 32), 13U);
  EXPECT_EQ(sigma_of(plain, rate_of(1.0, 0.1201), 32), 13U);
  EXPECT_EQ(sigma_of(plain, rate_of(1.0, 0.12), 32), 12U);
  EXPECT_EQ(sigma_of(plain, rate_of(1.0, 0.0001), 32), 1U);
  EXPECT_EQ(sigma_of(plain, rate_of(1.0, 0.0), 32), 1U);
  EXPECT_EQ(sigma_of(plain, rate_of(1.0, 2.545), 32), 255U);
  EXPECT_EQ(plain.counts().valid, 6U);
  for (const double none : {2.56, 1e9, kInfinity, kNaN}) {
    const can::Frame* frame = plain.rate(rate_of(1.0, none), at_ms(0));
    EXPECT_EQ(rig::bits(*frame, 48, 2), 0U) << none << ": not valid";
    EXPECT_EQ(rig::bits(*frame, 16, 16), 0U) << none;
    EXPECT_EQ(rig::bits(*frame, 32, 8), 255U) << none;
    EXPECT_EQ(sigma_of(coded, rate_of(1.0, none), 40), 255U) << none;
    EXPECT_EQ(rig::bits(*coded.rate(rate_of(1.0, none), at_ms(0)), 48, 2), 2U) << none << ": valid";
  }
  EXPECT_EQ(plain.counts().valid, 6U);
  EXPECT_EQ(plain.counts().out_of_range, 4U);
  EXPECT_EQ(sigma_of(coded, rate_of(1.0, 2.54), 40), 254U);
  EXPECT_EQ(sigma_of(coded, rate_of(1.0, 2.541), 40), 255U);
  EXPECT_EQ(sigma_of(coded, invalid(), 40), 255U);
  EXPECT_EQ(coded.counts().out_of_range, 0U);
}

// A method that states no σ cannot fill a signal that has no code for "not available".
TEST_F(OutputLayoutTest, MethodWithoutSigmaNeedsACode) {
  const std::string keys = "message = \"Guarded\"\nrate = \"Rate\"\nvalid = \"Quality >= 2\"\n";
  const std::string mutual = "\n[corrector]\nmethod = \"mutual\"\n";
  expect_error(keys + "sigma = \"Sigma\"\n" + mutual,
               {"mutual states no σ", "Sigma has no code", "leave sigma out"});
  EXPECT_TRUE(load("dbc = \"rig.dbc\"\n" + keys + "sigma = \"Fine\"\n" + mutual));
}

// "Quality >= 2": 2 if valid; 0 if not, because all ones would be valid.
TEST_F(OutputLayoutTest, FlagThatIsNotEqual) {
  LayoutEncoder encoder(
      rig_layout("message = \"Guarded\"\nrate = \"Rate\"\nvalid = \"Quality >= 2\"\n"));
  EXPECT_EQ(rig::bits(*encoder.rate(rate_of(1.0), at_ms(0)), 48, 2), 2U);
  EXPECT_EQ(rig::bits(*encoder.rate(invalid(), at_ms(0)), 48, 2), 0U);
  LayoutEncoder other(rig_layout(
      "message = \"Guarded\"\nrate = \"Rate\"\nvalid = \"Quality >= 2\"\ninvalid = 1\n"));
  EXPECT_EQ(rig::bits(*other.rate(invalid(), at_ms(0)), 48, 2), 1U);
  EXPECT_EQ(rig::signed_bits(*other.rate(invalid(), at_ms(0)), 50, 6), -5) << "its start value";
}

// The first rate at or after each grid point; a clock that is set back moves the grid.
TEST_F(OutputLayoutTest, EveryKeepsItsDistance) {
  LayoutEncoder encoder(rig_layout(
      "message = \"RateOfTurn\"\nrate = \"Rate\"\nsource_address = 1\nevery_ms = 100\n"));
  std::vector<int> sent;
  for (int t = 1003; t < 1500; t += 8) {
    if (encoder.rate(rate_of(1.0), at_ms(t)) != nullptr) sent.push_back(t);
  }
  EXPECT_EQ(sent, (std::vector<int>{1003, 1107, 1203, 1307, 1403}));
  EXPECT_NE(encoder.rate(rate_of(1.0), at_ms(500)), nullptr);
  EXPECT_EQ(encoder.rate(rate_of(1.0), at_ms(501)), nullptr);
  EXPECT_EQ(encoder.counts().frames, 6U);
}

// Sensors as frequent as the wanted frames, at any phase of the grid, a little early or late: every
// rate is sent.
TEST_F(OutputLayoutTest, EveryLosesNothingToJitter) {
  for (int phase_us = 0; phase_us < 10'000; phase_us += 250) {
    LayoutEncoder encoder(rig_layout(
        "message = \"RateOfTurn\"\nrate = \"Rate\"\nsource_address = 1\nevery_ms = 10\n"));
    rig::Dice dice(kSeed);
    int missed = 0;
    for (int i = 100; i < 600; ++i) {
      const auto late_us = static_cast<int>(dice.below(1001)) - 500;
      const TimePoint stamp = time_from_ns(1'000LL * (10'000 * i + phase_us + late_us));
      missed += encoder.rate(rate_of(1.0), stamp) == nullptr ? 1 : 0;
    }
    EXPECT_EQ(missed, 0) << phase_us;
  }
}

// The number of frames follows from the period, whatever the interval of the rates; no burst after
// a silence.
TEST_F(OutputLayoutTest, EveryIsKeptOnAverage) {
  for (const int interval_us : {125, 1000, 2000, 3000, 4100, 4999}) {
    LayoutEncoder encoder(rig_layout(
        "message = \"RateOfTurn\"\nrate = \"Rate\"\nsource_address = 1\nevery_ms = 10\n"));
    constexpr int kSeconds = 20;
    int before_us = -1'000'000;
    int closest_us = 1'000'000;
    for (int t_us = 0; t_us < kSeconds * 1'000'000; t_us += interval_us) {
      if (t_us / 1'000'000 == 7) continue;
      if (encoder.rate(rate_of(1.0), time_from_ns(1'000'000'000 + 1'000LL * t_us)) == nullptr)
        continue;
      closest_us = std::min(closest_us, t_us - before_us);
      before_us = t_us;
    }
    EXPECT_NEAR(static_cast<double>(encoder.counts().frames), (kSeconds - 1) * 100.0, 2.0)
        << interval_us;
    EXPECT_GE(closest_us, 3000) << interval_us;
  }
}

// After a reload the counter of the same frame continues.
TEST_F(OutputLayoutTest, CounterGoesOnForTheSameFrame) {
  const OutputLayout plan = profile("bosch_mm7.dbc", kMm7);
  LayoutEncoder before(plan);
  for (int i = 0; i < 21; ++i)
    before.rate(rate_of(1.0), at_ms(i));
  LayoutEncoder after(plan);
  ASSERT_TRUE(after.sends_same_frame(before));
  after.go_on_from(before);
  EXPECT_EQ(rig::bits(*after.rate(rate_of(1.0), at_ms(30)), 48, 4), 21U % 16U);
  LayoutEncoder other(profile("bosch_mm7.dbc", kMm7 + "id = 0x175\n"));
  EXPECT_FALSE(other.sends_same_frame(before));
}

// PDU 1 has a receiver: here all nodes. Priority and number are from the DBC file.
TEST_F(OutputLayoutTest, J1939ToEverybody) {
  const OutputLayout plan =
      rig_layout("message = \"ToOne\"\nrate = \"Rate\"\nsource_address = 0x21\n");
  EXPECT_EQ(plan.id, 0x18EFFF21U);
  EXPECT_EQ(
      rig_layout("message = \"ToOne\"\nrate = \"Rate\"\nid = 0x0CEF1000\nsource_address = 0x21\n")
          .id,
      0x0CEF1021U)
      << "whoever gives the whole identifier says to whom";
}

// An input of the gateway reads such frames as the rate that the virtual gyro sent.
TEST_F(OutputLayoutTest, GatewayReadsWhatAnotherGatewaySends) {
  write("back.toml", fmt::format(R"([[gyro]]
name = "a"
bus = "can0"
dbc = "{0}bosch_mm7.dbc"
message = "MM7_Yaw"
rate = "YawRate"
valid = "YawStatus == 0"
counter = "YawCounter"
crc = "YawCrc"
e2e = "crc8_j1850"

[[gyro]]
name = "b"
bus = "can0"
dbc = "{0}j1939_ari.dbc"
message = "ARI"
rate = "YawRate"

[output]
bus = "can1"
)",
                                 kProfiles));
  const auto back = load_config((folder_ / "back.toml").string());
  ASSERT_TRUE(back) << back.error().front().message();
  GyroInput mm7(back->plan.gyros[0]);
  LayoutEncoder encoder(profile("bosch_mm7.dbc", kMm7));
  for (int i = 0; i < 40; ++i) {
    const bool valid = i % 7 != 3;
    const RateOutput output = valid ? rate_of(i - 20.0) : invalid();
    const GyroInput::Result result = mm7.decode(*encoder.rate(output, at_ms(i)));
    EXPECT_EQ(result.reject.has_value(), !valid) << i;
    if (valid) {
      EXPECT_NEAR(result.rate_dps, i - 20.0, 1e-9);
    } else {
      EXPECT_EQ(result.reject, Reject::kFlaggedInvalid);
    }
    EXPECT_EQ(result.missing, 0U);
  }
}

// --- what is refused -----------------------------------------------------------------------------

TEST_F(OutputLayoutTest, RefusesWhatItWouldReadBack) {
  expect_error("message = \"GYRO_A\"\nrate = \"RateZ\"\nbus = \"can0\"\n",
               {"0x101 is also an input on can0", "another id, or another bus"});
  EXPECT_TRUE(load("dbc = \"rig.dbc\"\nmessage = \"GYRO_A\"\nrate = \"RateZ\"\n"));
  EXPECT_TRUE(load(
      "dbc = \"rig.dbc\"\nmessage = \"GYRO_A\"\nrate = \"RateZ\"\nbus = \"can0\"\nid = 0x103\n"));
}

TEST_F(OutputLayoutTest, RefusesTwoFramesOfOneIdentifier) {
  expect_error("message = \"GYRO_A\"\nrate = \"RateZ\"\nid = 0x610\n",
               {"two output frames have the same identifier", "0x610 on can1"});
  EXPECT_TRUE(load("dbc = \"rig.dbc\"\nmessage = \"GYRO_A\"\nrate = \"RateZ\"\nid = 0x610\n",
                   "vgyro_frames = false\n"));
}

TEST_F(OutputLayoutTest, RefusesWhatCannotBeMeant) {
  const std::string guarded = "message = \"Guarded\"\nrate = \"Rate\"\n";
  expect_error("message = \"Guarded\"\nrate = \"Quality\"\n", {"Quality", "unit"});
  expect_error(guarded + "valid = \"Rate == 0\"\n", {"shares bits of Guarded"});
  expect_error(guarded + "valid = \"Quality >= 0\"\n", {"every value fulfils"});
  expect_error(guarded + "valid = \"Quality == 9\"\n", {"no value of the signal fulfils"});
  expect_error(guarded + "valid = \"Quality == 1\"\ninvalid = 1\n", {"calls valid"});
  expect_error(guarded + "invalid = 1\n", {"invalid without valid"});
  expect_error(guarded + "rate_not_available = 0\n", {"is 0 deg/s", "end of the signal's range"});
  expect_error(guarded + "rate_not_available = 0x12345\n", {"has no raw value 0x12345"});
  expect_error(guarded + "sign = 2\n", {"sign is 2"});
  expect_error(guarded + "id = 0x800\n", {"id is 0x800", "11 bits"});
  expect_error(guarded + "every_ms = 0\n", {"every_ms is 0"});
  expect_error(guarded + "source_address = 1\n", {"for a J1939 message"});
  expect_error(guarded + "max_delta_counter = 1\ncounter = \"Counter\"\n", {"is for inputs"});
  expect_error(guarded + "fill = { Rate = 1 }\n", {"Rate is written by another key"});
  expect_error(guarded + "fill = { Start = 99 }\n", {"Start cannot carry this value"});
  expect_error(guarded + "fill = { Strat = 9 }\n", {"did you mean \"Start\""});
  expect_error(guarded + "ratte = 1\n", {"unknown key \"ratte\""});
  expect_error(guarded + "crc = \"Crc\"\ne2e = \"profile_11c\"\ndata_id = 1\n",
               {"has its counter in the low nibble of byte 1"});
  expect_error("message = \"RateOfTurn\"\nrate = \"Rate\"\n", {"sent from an address"});
  expect_error("message = \"Packets\"\nrate = \"Rate\"\nsource_address = 1\n",
               {"Packets has 20 bytes", "several frames"});
  expect_error("message = \"Long\"\nrate = \"Rate\"\nfd = false\n",
               {"Long has 20 bytes", "holds 8 bytes"});
  expect_error("message = \"RateOfTurn\"\nrate = \"Rate\"\nsource_address = 254\n", {"0 to 253"});
  expect_error("message = \"Pages\"\nrate = \"RateZ\"\nvalid = \"Other == 1\"\n",
               {"Other is not on the page of RateZ"});
}

TEST_F(OutputLayoutTest, RefusesToSendNothing) {
  write("vgyro.toml", std::string(kConfig) + "vgyro_frames = false\n");
  const auto loaded = load_config((folder_ / "vgyro.toml").string());
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.error()[0].message().find("nothing would be sent"), std::string::npos);
}

TEST_F(OutputLayoutTest, WarnsOfWhatIsCoarseOrNarrow) {
  const auto warnings_of = [&](const std::string& keys) {
    std::string text;
    for (const Error& warning : resolved(keys).warnings)
      text += warning.message() + "\n";
    return text;
  };
  const std::string xsens = warnings_of(fmt::format(
      "dbc = \"{}xsens_mti.dbc\"\nmessage = \"MTi_RateOfTurn\"\nrate = \"RateZ\"\n", kProfiles));
  EXPECT_NE(xsens.find("one step of RateZ is 0.112 deg/s"), std::string::npos) << xsens;
  const std::string vw = warnings_of(fmt::format(
      "dbc = \"{}vw_esp_02.dbc\"\nmessage = \"ESP_02\"\nrate = \"YawRateMagnitude\"\nid = 0x300\n",
      kProfiles));
  EXPECT_NE(vw.find("one direction"), std::string::npos) << vw;
  EXPECT_NE(vw.find("sign_signal"), std::string::npos) << vw;
  EXPECT_EQ(warnings_of("dbc = \"rig.dbc\"\nmessage = \"Upside\"\nrate = \"Rate\"\n"), "");
}

// A receiver ignores frames whose counter or check value is not filled in.
TEST_F(OutputLayoutTest, WarnsOfWhatReadersCheckAndNobodyMakes) {
  const std::string keys = "message = \"Guarded\"\nrate = \"Rate\"\nvalid = \"Quality >= 2\"\n";
  const auto warnings_of = [&](const std::string& more) {
    std::vector<std::string> text;
    for (const Error& warning : resolved("dbc = \"rig.dbc\"\n" + keys + more).warnings)
      text.push_back(warning.message());
    return text;
  };
  const std::vector<std::string> both = warnings_of("");
  ASSERT_EQ(both.size(), 2U) << fmt::format("{}", both);
  EXPECT_NE(both[0].find("Crc of Guarded is always 0: a receiver that checks it accepts no frame; "
                         "crc = \"Crc\" and e2e, or fill"),
            std::string::npos)
      << both[0];
  EXPECT_NE(both[1].find("counter = \"Counter\", or fill"), std::string::npos) << both[1];
  EXPECT_EQ(warnings_of("counter = \"Counter\"\nfill = { Crc = 0 }\n").size(), 0U);
}

// The identifier belongs to another message of a file that describes the bus; vgyro's own
// identifiers matter only on the bus on which they are sent.
TEST_F(OutputLayoutTest, WarnsOfTheIdentifierOfAnotherMessage) {
  const auto warnings_of = [&](const std::string& keys, const std::string& output) {
    const auto loaded =
        load("dbc = \"rig.dbc\"\nmessage = \"Upside\"\nrate = \"Rate\"\n" + keys, output);
    std::string text;
    if (!loaded) return text = loaded.error()[0].message();
    for (const Error& warning : loaded->warnings)
      text += warning.message() + "\n";
    return text;
  };
  const std::string taken = warnings_of("bus = \"can0\"\nid = 0x123\n", "");
  EXPECT_NE(
      taken.find("message Guarded has the identifier 0x123, with which Upside is sent on can0; "
                 "another id or bus for the [[output.layout]]"),
      std::string::npos)
      << taken;
  EXPECT_EQ(warnings_of("bus = \"can0\"\n", ""), "");
  EXPECT_EQ(warnings_of("id = 0x123\n", ""), "") << "nobody describes can1";
  write("rig.dbc",
        std::string(kDbc) + "BO_ 1552 Other: 8 RIG\n SG_ A : 0|8@1+ (1,0) [0|0] \"\" RIG\n");
  const auto own = [&](const std::string& output) {
    std::string config = kConfig;
    config.replace(config.rfind("can1"), 4, "can0");
    write("vgyro.toml",
          config + output +
              "[[output.layout]]\ndbc = \"rig.dbc\"\nmessage = \"Upside\"\nrate = \"Rate\"\n");
    const auto loaded = load_config((folder_ / "vgyro.toml").string());
    return loaded ? loaded->warnings.size() : 99;
  };
  EXPECT_EQ(own(""), 1U) << "0x610";
  EXPECT_EQ(own("vgyro_frames = false\n"), 0U);
}

TEST_F(OutputLayoutTest, OneTableIsNoList) {
  write("vgyro.toml", std::string(kConfig) + "[output.layout]\nmessage = \"Long\"\n");
  const auto loaded = load_config((folder_ / "vgyro.toml").string());
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.error()[0].message().find("[[output.layout]]"), std::string::npos)
      << loaded.error()[0].message();
}

}  // namespace
}  // namespace vgyro::gateway
