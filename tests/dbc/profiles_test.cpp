// The DBC files of the product, against frames of known meaning.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "dbc/codec.h"
#include "dbc/parser.h"

namespace vgyro::dbc {
namespace {

using Bytes = std::vector<std::uint8_t>;

Database loaded(const std::string& name) {
  const auto database = load(fmt::format("{}/{}", VGYRO_DBC_DIR, name));
  EXPECT_TRUE(database) << name;
  if (!database) return {};
  for (const Diagnostic& odd : database->diagnostics) {
    ADD_FAILURE() << name << ':' << odd.line << ": " << odd.what;
  }
  return *database;
}

double value_of(const Database& database, std::uint32_t id, bool extended, const std::string& name,
                const Bytes& payload) {
  for (const Message& message : database.messages) {
    if (!message.matches(id, extended)) continue;
    const Signal* const signal = message.find_signal(name);
    if (signal == nullptr) continue;
    const auto codec = SignalCodec::make(*signal, message.size_bytes, "test");
    if (codec && codec->fits(payload.size())) return codec->decode(payload).value;
  }
  ADD_FAILURE() << fmt::format("nothing reads {} in {:X}", name, id);
  return 0.0;
}

// The maker's own example frame: no rotation, everything functional, from source address 0xE2.
TEST(Profiles, ReadTheGoldenJ1939Frame) {
  const Database ari = loaded("profiles/j1939_ari.dbc");
  const Bytes golden = {0x00, 0x7D, 0x00, 0x7D, 0x00, 0x7D, 0x00, 0x05};
  for (const char* const axis : {"Pitch", "Roll", "Yaw"}) {
    EXPECT_EQ(value_of(ari, 0x0CF02AE2, true, fmt::format("{}Rate", axis), golden), 0.0);
    EXPECT_EQ(value_of(ari, 0x0CF02AE2, true, fmt::format("{}RateMerit", axis), golden), 0.0);
  }
  const Signal& yaw = *ari.messages[0].find_signal("YawRate");
  EXPECT_GT(0xFE00 / 128.0 - 250, yaw.maximum) << "an error value is outside of the range";
  EXPECT_EQ(*ari.messages[0].find_signal("YawRateMerit")->label(3), "not_available");
}

// MM7: the offset is half the range; the status nibble and the counter do not touch the rate.
TEST(Profiles, ReadBoschMm7) {
  const Database mm7 = loaded("profiles/bosch_mm7.dbc");
  const Bytes frame = {0x00, 0x80, 0x50, 0x4B, 0xFF, 0xFF, 0x0A, 0xC3};
  EXPECT_NEAR(value_of(mm7, 0x174, false, "YawRate", frame), 0.0, 1e-12);
  EXPECT_EQ(value_of(mm7, 0x174, false, "Temperature", frame), 25.0);
  EXPECT_EQ(value_of(mm7, 0x174, false, "YawStatus", frame), 5.0);
  EXPECT_EQ(value_of(mm7, 0x178, false, "RollCounter", frame), 10.0);
  EXPECT_EQ(value_of(mm7, 0x17C, false, "PitchCrc", frame), 195.0);
}

// Three 16-bit rates each: Motorola in 1/512 rad/s, Intel in 1e-3 rad/s, Intel in 0.01 deg/s.
TEST(Profiles, ReadXsensSbgAndOxts) {
  const Bytes frame = {0x02, 0x00, 0xFE, 0x00, 0x00, 0x01, 0x00, 0x00};
  const Database mti = loaded("profiles/xsens_mti.dbc");
  EXPECT_EQ(value_of(mti, 0x32, false, "RateX", frame), 1.0);
  EXPECT_EQ(value_of(mti, 0x32, false, "RateY", frame), -1.0);
  EXPECT_EQ(value_of(mti, 0x32, false, "RateZ", frame), 1.0 / 512);
  const Database sbg = loaded("profiles/sbg_ellipse.dbc");
  EXPECT_EQ(value_of(sbg, 0x122, false, "RateX", frame), 0.002);
  EXPECT_EQ(value_of(sbg, 0x122, false, "RateZ", frame), 0.256);
  const Database oxts = loaded("profiles/oxts_rt.dbc");
  EXPECT_EQ(value_of(oxts, 0x608, false, "RateZ", frame), 2.56);
}

// Floats, most significant byte first.
TEST(Profiles, ReadRacelogicImu04) {
  const Database imu04 = loaded("profiles/racelogic_imu04.dbc");
  const Bytes frame = {0xC1, 0x48, 0x00, 0x00, 0x3F, 0x80, 0x00, 0x00};
  EXPECT_EQ(value_of(imu04, 0x600, false, "YawRate", frame), -12.5);
  EXPECT_EQ(value_of(imu04, 0x600, false, "AccX", frame), 1.0);
  EXPECT_EQ(value_of(imu04, 0x602, false, "PitchRate", frame), -12.5);
}

// A magnitude with a separate sign bit; Motorola with an offset; angle increments as a rate.
TEST(Profiles, ReadVehicleAndIncrementFrames) {
  const Database vw = loaded("profiles/vw_esp_02.dbc");
  const Bytes esp = {0, 0, 0, 0, 0, 0x10, 0x67, 0};
  EXPECT_DOUBLE_EQ(value_of(vw, 0x101, false, "YawRateMagnitude", esp), 100.0);
  EXPECT_EQ(value_of(vw, 0x101, false, "YawRateSign", esp), 1.0);
  const Database ford = loaded("profiles/ford_yaw.dbc");
  EXPECT_NEAR(value_of(ford, 0x91, false, "YawRate", {0, 0, 0x7E, 0xF4, 0, 0, 0, 0}), 0.0, 1e-12);
  const Database hg1120 = loaded("profiles/honeywell_hg1120.dbc");
  EXPECT_DOUBLE_EQ(value_of(hg1120, 0x125, false, "RateZ", {0, 0, 0, 0x80, 0, 0, 0, 0}), -25.0);
}

// The product's own frames: signals cover every bit, invalid values have labels.
TEST(Profiles, DescribeTheOutputFrames) {
  const Database classic = loaded("vgyro.dbc");
  for (const Message& message : classic.messages) {
    unsigned bits = 0;
    for (const Signal& signal : message.signals)
      bits += signal.length_bits;
    EXPECT_EQ(bits, 64U) << message.name;
    EXPECT_FALSE(message.comment.empty());
    for (const Signal& signal : message.signals)
      EXPECT_FALSE(signal.comment.empty()) << signal.name;
  }
  const Message& rate = *classic.find_message("VG_Rate");
  EXPECT_EQ(*rate.find_signal("VG_Rate")->label(-8388608), "invalid");
  EXPECT_EQ(*rate.find_signal("VG_State")->label(2), "running");
  const Bytes invalid = {0, 0, 0, 0, 0x80, 0xFF, 0x0F, 0xF0};
  EXPECT_DOUBLE_EQ(value_of(classic, 0x610, false, "VG_Rate", invalid), -419.4304);
  EXPECT_EQ(value_of(classic, 0x610, false, "VG_Valid", invalid), 0.0);
  EXPECT_EQ(value_of(classic, 0x610, false, "VG_Age", invalid), 7.5);
}

// The FD variant differs from the classic one in VG_Rate alone.
TEST(Profiles, DescribeTheFdOutputFrame) {
  const Database fd = loaded("vgyro_fd.dbc");
  const Database classic = loaded("vgyro.dbc");
  const Message& rate = *fd.find_message("VG_Rate");
  EXPECT_EQ(rate.id, 0x610U);
  EXPECT_EQ(rate.size_bytes, 32);
  EXPECT_EQ(*rate.find_signal("VG_Rate")->label(-2147483648LL), "invalid");
  EXPECT_EQ(*rate.find_signal("VG_Sigma")->label(0xFFFFFFFFLL), "not_available");
  for (const char* const name : {"VG_Bias", "VG_Model"}) {
    const Message& ours = *fd.find_message(name);
    const Message& theirs = *classic.find_message(name);
    ASSERT_EQ(ours.signal_names(), theirs.signal_names());
    for (std::size_t i = 0; i < ours.signals.size(); ++i) {
      EXPECT_EQ(ours.signals[i].start_bit, theirs.signals[i].start_bit);
      EXPECT_EQ(ours.signals[i].length_bits, theirs.signals[i].length_bits);
      EXPECT_EQ(ours.signals[i].factor, theirs.signals[i].factor);
    }
  }
}

// PGN 127251 of a boat that turns to starboard by 1 deg/s: 0.01745329 rad/s are 558505 steps. The
// file labels the three codes.
TEST(Profiles, ReadTheRateOfTurnOfNmea2000) {
  const Database boat = loaded("profiles/nmea2000_rate_of_turn.dbc");
  const Bytes turning = {0x05, 0xA9, 0x85, 0x08, 0x00, 0xFF, 0xFF, 0xFF};
  EXPECT_NEAR(value_of(boat, 0x09F11323, true, "Rate", turning), 3.14159265 / 180, 2e-8);
  const Bytes back = {0xFF, 0x57, 0x7A, 0xF7, 0xFF, 0xFF, 0xFF, 0xFF};
  EXPECT_NEAR(value_of(boat, 0x0DF113A0, true, "Rate", back), -3.14159265 / 180, 2e-8);
  const Message& message = boat.messages[0];
  EXPECT_EQ(message.id >> 8U & 0x3FFFFU, 127251U);
  EXPECT_EQ(message.codes, CodeRules::kNmea2000);
  const Signal& rate = *message.find_signal("Rate");
  EXPECT_EQ(*rate.label(0x7FFFFFFF), "not_available");
  EXPECT_GT(0x7FFFFFFC * rate.factor, rate.maximum - 1e-6);
}

// Some other readers drop signals whose factor has an exponent.
TEST(Profiles, WriteTheirNumbersAsPlainDecimals) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(VGYRO_DBC_DIR)) {
    if (entry.path().extension() != ".dbc") continue;
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      const std::size_t open = line.find('(');
      if (line.find("SG_ ") != 1 || open == line.npos) continue;
      const std::string scaling = line.substr(open, line.find(')') - open);
      EXPECT_EQ(scaling.find_first_of("eE"), scaling.npos) << entry.path() << ": " << line;
    }
  }
}

}  // namespace
}  // namespace vgyro::dbc
