#include "gateway/config.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <fmt/ranges.h>
#include <gtest/gtest.h>

namespace vgyro::gateway {
namespace {

constexpr const char* kBench = R"(VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ RateZ : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temp : 32|16@1- (0.01,0) [-40|125] "degC" RIG
 SG_ Counter : 48|4@1+ (1,0) [0|14] "" RIG
 SG_ Status : 52|4@1+ (1,0) [0|15] "" RIG
 SG_ Crc : 56|8@1+ (1,0) [0|255] "" RIG

BO_ 258 GYRO_B: 8 RIG
 SG_ RateZ : 7|16@0- (0.001,0) [-30|30] "rad/s" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|255] "" RIG
 SG_ Flag : 63|1@1+ (1,0) [0|1] "" RIG
 SG_ Volt : 16|16@1+ (0.001,0) [0|65] "V" RIG
 SG_ Odd : 32|8@1+ (1,-125) [0|250] "deg/s" RIG
 SG_ Crc : 40|8@1+ (1,0) [0|255] "" RIG

BO_ 259 TABLE: 8 RIG
 SG_ TableRate : 0|32@1- (1E-006,0) [0|0] "deg/s" RIG
 SG_ Crc : 32|16@1+ (1,0) [0|0] "" RIG
 SG_ Counter : 48|8@1+ (1,0) [0|0] "" RIG

BO_ 260 ACCEL: 6 RIG
 SG_ AccX : 0|16@1- (0.001,0) [-30|30] "g" RIG
 SG_ AccY : 16|16@1- (0.01,0) [-300|300] "m/s^2" RIG
 SG_ AccZ : 32|16@1- (0.001,0) [-30|30] "g" RIG

BO_ 261 WHEEL: 8 RIG
 SG_ Speed : 0|16@1+ (0.01,0) [0|300] "km/h" RIG
 SG_ Checksum : 63|8@0+ (1,0) [0|255] "" RIG

BO_ 2364549694 ARI: 8 RIG
 SG_ YawRate : 32|16@1+ (0.0078125,-250) [-250|250.992] "deg/s" RIG
)";

constexpr const char* kJ1939 = R"(
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 2364549694 3;
)";

constexpr const char* kGood = R"([[gyro]]
name = "left"
bus = "can0"
dbc = "bench.dbc"
message = "GYRO_A"
rate = "RateZ"
temperature = "Temp"
counter = "Counter"
valid = "Status == 0"
max_bias_dps = 0.25

[[gyro]]
name = "right"
bus = "can1"
dbc = "bench.dbc"
message = "GYRO_B"
rate = "RateZ"
sign = -1
counter = "Counter"
sign_signal = "Flag"

[reference]
bus = "can0"
dbc = "bench.dbc"
message = "TABLE"
rate = "TableRate"

[accelerometer]
bus = "can0"
dbc = "bench.dbc"
message = "ACCEL"
x = "AccX"
y = "AccY"
z = "AccZ"

[speed]
bus = "can2"
dbc = "bench.dbc"
message = "WHEEL"
signal = "Speed"

[calibration]
rest_s = 30.0
latitude_deg = 50.45

[corrector]
method = "mutual"
window_s = 5
order = 2

[output]
bus = "can0"
rate_id = 0x620
bias_id = 0x621
model_id = 0x622
fd = true
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return at == text.npos ? text : text.replace(at, from.size(), to);
}

std::size_t line_of(const std::string& text, const std::string& what) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, text.npos) << what;
  return 1 + static_cast<std::size_t>(
                 std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

class Config : public ::testing::Test {
 protected:
  Config() {
    std::string pattern = (std::filesystem::temp_directory_path() / "vgyro-config-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    write("bench.dbc", kBench);
  }
  ~Config() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  [[nodiscard]] std::string path() const { return (folder_ / "vgyro.toml").string(); }
  [[nodiscard]] std::string dbc_path() const { return (folder_ / "bench.dbc").string(); }

  [[nodiscard]] ConfigResult load(const std::string& text,
                                  const ConfigOverrides& overrides = {}) const {
    write("vgyro.toml", text);
    return load_config(path(), overrides);
  }
  [[nodiscard]] Plan plan_of(const std::string& text) const {
    auto loaded = load(text);
    if (loaded) return loaded->plan;
    for (const Error& error : loaded.error())
      ADD_FAILURE() << error.message();
    return {};
  }
  [[nodiscard]] std::vector<std::string> messages_of(const std::string& text) const {
    std::vector<std::string> messages;
    const auto loaded = load(text);
    if (loaded) return messages;
    for (const Error& error : loaded.error())
      messages.push_back(error.message());
    return messages;
  }

  /// The good configuration with one mistake gives exactly one error: at the line of `at`,
  /// containing each of `parts`.
  void expect_error(const std::string& from, const std::string& to, const std::string& at,
                    const std::vector<std::string>& parts) const {
    const std::string text = replaced(kGood, from, to);
    const auto messages = messages_of(text);
    ASSERT_EQ(messages.size(), 1U) << to << "\n" << fmt::format("{}", fmt::join(messages, "\n"));
    const std::string place =
        at.empty() ? path() + ": " : fmt::format("{}:{}: ", path(), line_of(text, at));
    EXPECT_EQ(messages[0].substr(0, place.size()), place) << messages[0];
    for (const std::string& part : parts) {
      EXPECT_NE(messages[0].find(part), std::string::npos)
          << "no \"" << part << "\" in " << messages[0];
    }
  }

  std::filesystem::path folder_;
};

// --- what is right -------------------------------------------------------------------------------

// Every key of the file reaches the plan.
TEST_F(Config, ResolvesAGoodFile) {
  const auto loaded = load(kGood);
  ASSERT_TRUE(loaded) << loaded.error().front().message();
  EXPECT_TRUE(loaded->warnings.empty());
  const Plan& plan = loaded->plan;
  EXPECT_EQ(plan.buses, (std::vector<std::string>{"can0", "can1", "can2"}));
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_EQ(plan.gyros[0].name, "left");
  EXPECT_EQ(plan.gyros[0].match.bus, 0);
  EXPECT_EQ(plan.gyros[0].match.id, 0x101U);
  EXPECT_EQ(plan.gyros[0].match.mask, 0x7FFU);
  EXPECT_FALSE(plan.gyros[0].match.extended);
  EXPECT_EQ(plan.gyros[1].name, "right");
  EXPECT_EQ(plan.gyros[1].match.bus, 1);
  EXPECT_EQ(plan.gyros[1].match.id, 0x102U);
  EXPECT_DOUBLE_EQ(plan.calibration.rest_s, 30.0);
  EXPECT_FALSE(plan.calibration.from_reference);
  EXPECT_EQ(plan.corrector.method, Method::kMutual);
  EXPECT_DOUBLE_EQ(plan.corrector.window_s, 5.0);
  EXPECT_EQ(plan.corrector.order, 2);
  EXPECT_EQ(plan.output.bus, 0);
  EXPECT_EQ(plan.output.rate_id, 0x620U);
  EXPECT_EQ(plan.output.bias_id, 0x621U);
  EXPECT_EQ(plan.output.model_id, 0x622U);
  EXPECT_TRUE(plan.output.fd);
}

// Signals become bits, units become deg/s, the sign becomes part of the scale.
TEST_F(Config, ResolvesSignals) {
  const Plan plan = plan_of(kGood);
  ASSERT_EQ(plan.gyros.size(), 2U);
  const GyroPlan& left = plan.gyros[0];
  const GyroPlan& right = plan.gyros[1];
  EXPECT_DOUBLE_EQ(left.rate.scale, 1.0);
  EXPECT_DOUBLE_EQ(left.rate.minimum, -2000.0);
  EXPECT_DOUBLE_EQ(left.rate.maximum, 2000.0);
  EXPECT_EQ(left.rate.unit, "deg/s");
  ASSERT_TRUE(left.temperature && left.e2e.counter && left.valid);
  EXPECT_EQ(left.e2e.counter->modulus, 15U) << "a range of [0|14] is AUTOSAR's counter";
  EXPECT_EQ(left.valid->comparison, Comparison::kEqual);
  EXPECT_FALSE(left.sign);
  EXPECT_NEAR(right.rate.scale, -57.29577951308232, 1e-12);
  EXPECT_DOUBLE_EQ(right.rate.minimum, -30.0);
  EXPECT_DOUBLE_EQ(right.rate.maximum, 30.0);
  EXPECT_EQ(right.e2e.counter->modulus, 256U);
  EXPECT_TRUE(right.sign);
  EXPECT_FALSE(right.temperature || right.valid);
}

// In the product's unit; nothing without the key.
TEST_F(Config, ResolvesTheSupplyVoltage) {
  EXPECT_FALSE(plan_of(kGood).gyros[1].supply_voltage);
  const Plan plan = plan_of(replaced(kGood, "sign_signal = \"Flag\"", "supply_voltage = \"Volt\""));
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_FALSE(plan.gyros[0].supply_voltage);
  ASSERT_TRUE(plan.gyros[1].supply_voltage);
  EXPECT_EQ(plan.gyros[1].supply_voltage->name, "Volt");
  EXPECT_DOUBLE_EQ(plan.gyros[1].supply_voltage->scale, 1.0);
  EXPECT_DOUBLE_EQ(plan.gyros[1].supply_voltage->maximum, 65.0);
}

// The optional inputs, each with its unit.
TEST_F(Config, ResolvesReferenceAccelerometerAndSpeed) {
  const Plan plan = plan_of(kGood);
  ASSERT_TRUE(plan.reference && plan.accelerometer && plan.speed);
  EXPECT_EQ(plan.reference->match.id, 0x103U);
  EXPECT_DOUBLE_EQ(plan.reference->rate.maximum, 1e5) << "[0|0] is no range";
  EXPECT_DOUBLE_EQ(plan.accelerometer->axes[0].scale, 1.0);
  EXPECT_DOUBLE_EQ(plan.accelerometer->axes[1].scale, 1.0 / 9.80665);
  EXPECT_EQ(plan.accelerometer->axes[2].name, "AccZ");
  EXPECT_DOUBLE_EQ(plan.speed->speed.scale, 1.0 / 3.6);
  EXPECT_EQ(plan.speed->match.bus, 2);
}

// A file with the required keys alone gets the documented defaults.
TEST_F(Config, TakesDefaults) {
  const Plan plan = plan_of(
      "[[gyro]]\nbus = \"can0\"\ndbc = \"bench.dbc\"\nmessage = \"GYRO_A\"\nrate = \"RateZ\"\n"
      "[[gyro]]\nbus = \"can0\"\ndbc = \"bench.dbc\"\nmessage = \"GYRO_B\"\nrate = \"RateZ\"\n"
      "[output]\nbus = \"can0\"\n");
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_EQ(plan.gyros[0].name, "a");
  EXPECT_EQ(plan.gyros[1].name, "b");
  EXPECT_DOUBLE_EQ(plan.calibration.rest_s, 60.0);
  EXPECT_DOUBLE_EQ(plan.calibration.rate_dps, 0.0);
  EXPECT_DOUBLE_EQ(plan.corrector.window_s, 10.0);
  EXPECT_EQ(plan.corrector.order, 1);
  EXPECT_EQ(plan.output.rate_id, 0x610U);
  EXPECT_EQ(plan.output.bias_id, 0x611U);
  EXPECT_EQ(plan.output.model_id, 0x612U);
  EXPECT_FALSE(plan.output.fd);
}

// The bias limit from the file reaches the corrector; 0, a negative value, an impossible one and
// NaN are errors.
TEST_F(Config, BoundsABiasByWhatTheFileSays) {
  const Plan plan = plan_of(kGood);
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_EQ(plan.gyros[0].max_bias_dps, 0.25);
  EXPECT_EQ(plan.corrector.gyros[0].max_bias_dps, 0.25);
  EXPECT_FALSE(plan.gyros[1].max_bias_dps);
  EXPECT_FALSE(plan.corrector.gyros[1].max_bias_dps);
  EXPECT_EQ(plan_of(replaced(kGood, "0.25", "100")).corrector.gyros[0].max_bias_dps, 100.0);
  for (const char* wrong : {"0", "-0.1", "100.5", "nan", "inf"}) {
    expect_error("max_bias_dps = 0.25", fmt::format("max_bias_dps = {}", wrong), "max_bias_dps",
                 {"max_bias_dps is ", "above 0 and up to 100"});
  }
}

// The Earth's rate about the vertical of Kyiv, from the sidereal day.
TEST_F(Config, TurnsLatitudeIntoTheEarthsRate) {
  EXPECT_NEAR(plan_of(kGood).calibration.rate_dps, 0.0032216, 1e-7);
  EXPECT_NEAR(plan_of(replaced(kGood, "50.45", "-90")).calibration.rate_dps, -0.0041781, 1e-7);
  EXPECT_DOUBLE_EQ(
      plan_of(replaced(kGood, "latitude_deg = 50.45", "rate_dps = 0.1")).calibration.rate_dps, 0.1);
}

// Every operator, with and without blanks.
TEST_F(Config, ReadsEveryComparison) {
  const std::pair<const char*, Comparison> cases[] = {
      {"Status == 0", Comparison::kEqual},     {"Status!=3", Comparison::kNotEqual},
      {"Status <= 2", Comparison::kLessEqual}, {"Status>=1", Comparison::kGreaterEqual},
      {"Status < 4.5", Comparison::kLess},     {" Status  >  -1 ", Comparison::kGreater}};
  for (const auto& [text, comparison] : cases) {
    const Plan plan = plan_of(replaced(kGood, "Status == 0", text));
    ASSERT_EQ(plan.gyros.size(), 2U) << text;
    EXPECT_EQ(plan.gyros[0].valid->comparison, comparison) << text;
  }
  EXPECT_DOUBLE_EQ(plan_of(replaced(kGood, "Status == 0", "Status < 4.5")).gyros[0].valid->value,
                   4.5);
}

// If the DBC file's unit is wrong, the configuration's takes precedence.
TEST_F(Config, UnitOfTheConfigOverridesTheFiles) {
  const Plan plan = plan_of(replaced(replaced(kGood, "sign = -1\n", "unit = \"deg/h\"\n"),
                                     "sign_signal = \"Flag\"\n", ""));
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_DOUBLE_EQ(plan.gyros[1].rate.scale, 1.0 / 3600.0);
}

// The --method of a replay overrides the file, even a method that this version does not have.
TEST_F(Config, OverrideOfTheMethodWins) {
  for (const char* text : {"mutual", "mean", "optimal"}) {
    const auto loaded =
        load(replaced(kGood, "\"mutual\"", fmt::format("\"{}\"", text)), {Method::kMean});
    ASSERT_TRUE(loaded) << loaded.error().front().message();
    EXPECT_EQ(loaded->plan.corrector.method, Method::kMean);
  }
}

// J1939: any source address sends the message, unless the configuration names one.
TEST_F(Config, J1939MatchesAnySourceUnlessToldOtherwise) {
  write("bench.dbc", std::string(kBench) + kJ1939);
  const std::string ari = "message = \"ARI\"\nrate = \"YawRate\"\n";
  const std::string text =
      replaced(replaced(kGood, "message = \"GYRO_B\"\nrate = \"RateZ\"\nsign = -1\n", ari),
               "counter = \"Counter\"\nsign_signal = \"Flag\"\n", "");
  const Plan any = plan_of(text);
  ASSERT_EQ(any.gyros.size(), 2U);
  EXPECT_TRUE(any.gyros[1].match.extended);
  EXPECT_EQ(any.gyros[1].match.mask & 0xFFU, 0U);
  const Plan one = plan_of(replaced(text, ari, ari + "source_address = 0xE2\n"));
  ASSERT_EQ(one.gyros.size(), 2U);
  EXPECT_EQ(one.gyros[1].match.id & 0xFFU, 0xE2U);
  EXPECT_EQ(one.gyros[1].match.mask & 0xFFU, 0xFFU);
}

// Two units of the same kind on one J1939 bus differ in their source address alone.
TEST_F(Config, J1939GyrosAreToldApartBySource) {
  write("bench.dbc", std::string(kBench) + kJ1939);
  const auto gyro = [](const char* extra) {
    return fmt::format(
        "[[gyro]]\nbus = \"can0\"\ndbc = \"bench.dbc\"\nmessage = \"ARI\"\nrate = "
        "\"YawRate\"\n{}\n",
        extra);
  };
  const std::string output = "[output]\nbus = \"can0\"\n";
  const auto same = messages_of(gyro("") + gyro("") + output);
  ASSERT_EQ(same.size(), 1U);
  EXPECT_NE(same[0].find("source_address"), std::string::npos) << same[0];
  const Plan plan = plan_of(gyro("source_address = 1") + gyro("source_address = 2") + output);
  EXPECT_EQ(plan.gyros.size(), 2U);
}

// A range that the signal's own scale cannot reach is a mistake of the file's author, who forgot
// the offset in [0|250]. Using it would discard every turn to the left.
TEST_F(Config, IgnoresAnImplausibleRangeWithAWarning) {
  const std::string text =
      replaced(replaced(kGood, "rate = \"RateZ\"\nsign = -1", "rate = \"Odd\"\nsign = -1"),
               "sign_signal = \"Flag\"\n", "");
  const auto loaded = load(text);
  ASSERT_TRUE(loaded) << loaded.error().front().message();
  ASSERT_EQ(loaded->warnings.size(), 1U);
  const std::string warning = loaded->warnings[0].message();
  EXPECT_EQ(warning.find(fmt::format("{}:{}: ", dbc_path(), line_of(kBench, "SG_ Odd"))), 0U)
      << warning;
  EXPECT_NE(warning.find("[0|250]"), std::string::npos) << warning;
  EXPECT_DOUBLE_EQ(loaded->plan.gyros[1].rate.minimum, -1e5);
  EXPECT_DOUBLE_EQ(loaded->plan.gyros[1].rate.maximum, 1e5);
}

// A gyro turns both ways: public files give a signed rate the range [0|100] or [0|1], which would
// discard half of its noise. An unsigned magnitude beside a sign, and other quantities, keep their
// range.
TEST_F(Config, IgnoresARangeThatLeavesOutOneDirectionOfARate) {
  for (const char* range : {"[0|1]", "[0|100]", "[-255|0]", "[5|2000]"}) {
    const std::string dbc = replaced(kBench, "[-2000|2000]", range);
    write("bench.dbc", dbc);
    const auto loaded = load(kGood);
    ASSERT_TRUE(loaded) << loaded.error().front().message();
    ASSERT_EQ(loaded->warnings.size(), 1U) << range;
    const std::string warning = loaded->warnings[0].message();
    EXPECT_NE(warning.find(range), std::string::npos) << warning;
    EXPECT_NE(warning.find("leaves out one direction"), std::string::npos) << warning;
    EXPECT_LT(loaded->plan.gyros[0].rate.minimum, -2000.0);
    EXPECT_GT(loaded->plan.gyros[0].rate.maximum, 2000.0);
    EXPECT_DOUBLE_EQ(loaded->plan.speed->speed.maximum, 300.0);
  }
  write("bench.dbc", replaced(kBench, "[-2000|2000]", "[-75|100]"));
  const auto both = load(kGood);
  ASSERT_TRUE(both);
  EXPECT_TRUE(both->warnings.empty());
  EXPECT_DOUBLE_EQ(both->plan.gyros[0].rate.minimum, -75.0);
}

// --- J1939 and NMEA 2000 -------------------------------------------------------------------------

constexpr const char* kBoat = R"(BO_ 2314277886 TURN: 8 BOW
 SG_ Rate : 8|32@1- (0.00000003125,0) [0|0] "rad/s" BOW
BO_ 2565876225 LEFT: 8 A
 SG_ Rate : 0|16@1+ (0.01,-250) [0|0] "deg/s" A
 SG_ Speed : 16|16@1+ (0.01,0) [0|0] "km/h" A
BO_ 2565876226 RIGHT: 8 B
 SG_ Rate : 0|16@1+ (0.01,-250) [0|0] "deg/s" B
 SG_ Speed : 16|16@1+ (0.01,0) [0|0] "km/h" B
BO_ 256 MEMS: 8 A
 SG_ Rate : 0|16@1- (0.01,0) [-300|300] "deg/s" A
 SG_ Other : 16|16@1- (0.01,0) [-300|300] "deg/s" A
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
)";

std::string input_of(const std::string& table, const std::string& message,
                     const std::string& more = "rate = \"Rate\"\n") {
  return fmt::format("{}\nbus = \"can0\"\ndbc = \"boat.dbc\"\nmessage = \"{}\"\n{}", table, message,
                     more);
}
const std::string kToCan1 = "[output]\nbus = \"can1\"\n";

// The protocol's codes limit the accepted values, whatever the file says; the key overrides both.
TEST_F(Config, AcceptsNoCodesOfAProtocol) {
  write("boat.dbc", kBoat);
  const std::string text = input_of("[[gyro]]", "TURN") + input_of("[[gyro]]", "LEFT") + kToCan1;
  const Plan plan = plan_of(text);
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_EQ(plan.gyros[0].rate.codes, (dbc::Codes{0x7FFFFFFD, 0x7FFFFFFF}));
  EXPECT_DOUBLE_EQ(plan.gyros[0].rate.maximum, 0x7FFFFFFC * 3.125e-8);
  EXPECT_EQ(plan.gyros[1].rate.codes, (dbc::Codes{0xFB00, 0xFFFF}));
  EXPECT_TRUE(plan.gyros[1].rate.codes_in_range);
  EXPECT_DOUBLE_EQ(plan.gyros[1].rate.maximum, 0xFAFF * 0.01 - 250);
  const Plan none = plan_of(replaced(text, "\"LEFT\"\n", "\"LEFT\"\ncodes = \"none\"\n"));
  ASSERT_EQ(none.gyros.size(), 2U);
  EXPECT_TRUE(none.gyros[1].rate.codes.empty());
  const Plan boat = plan_of(replaced(text, "\"LEFT\"\n", "\"LEFT\"\ncodes = \"nmea2000\"\n"));
  ASSERT_EQ(boat.gyros.size(), 2U);
  EXPECT_EQ(boat.gyros[1].rate.codes, (dbc::Codes{0xFFFD, 0xFFFF}));
  const auto bad = messages_of(replaced(text, "\"LEFT\"\n", "\"LEFT\"\ncodes = \"nmea\"\n"));
  ASSERT_EQ(bad.size(), 1U);
  EXPECT_NE(bad[0].find("j1939, nmea2000, none"), std::string::npos) << bad[0];
}

// Every input accepts a source address.
TEST_F(Config, TakesASourceAddressForEveryInput) {
  write("boat.dbc", kBoat);
  const std::string axes = "x = \"Ax\"\ny = \"Ax\"\nz = \"Ax\"\n";
  write("boat.dbc", std::string(kBoat) +
                        "BO_ 2565876483 ACC: 8 A\n"
                        " SG_ Ax : 0|16@1- (0.001,0) [-30|30] \"g\" A\n");
  const Plan plan = plan_of(input_of("[[gyro]]", "TURN") + input_of("[[gyro]]", "MEMS") +
                            input_of("[reference]", "LEFT") + "source_address = 7\n" +
                            input_of("[accelerometer]", "ACC", axes) + "source_address = 8\n" +
                            input_of("[speed]", "LEFT", "signal = \"Speed\"\n") +
                            "source_address = 9\n" + kToCan1);
  ASSERT_TRUE(plan.reference && plan.accelerometer && plan.speed);
  EXPECT_TRUE(plan.reference->match.carries(0x18F02A07, true));
  EXPECT_FALSE(plan.reference->match.carries(0x18F02A08, true));
  EXPECT_EQ(plan.accelerometer->match.id & 0xFFU, 8U);
  EXPECT_EQ(plan.speed->match.id & 0xFFU, 9U);
}

// An identifier that belongs to another message of the same PGN is not accepted.
TEST_F(Config, PassesOverTheIdentifiersOfOtherMessages) {
  write("boat.dbc", kBoat);
  const Plan plan = plan_of(input_of("[[gyro]]", "LEFT") + input_of("[[gyro]]", "MEMS") + kToCan1);
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_TRUE(plan.gyros[0].match.carries(0x18F02A01, true));
  EXPECT_TRUE(plan.gyros[0].match.carries(0x0CF02A33, true));
  EXPECT_FALSE(plan.gyros[0].match.carries(0x18F02A02, true));
  EXPECT_FALSE(plan.gyros[0].match.carries(0x0CF02A02, true));
}

TEST_F(Config, RefusesInputsThatCannotBeToldApart) {
  write("boat.dbc", kBoat);
  const std::string left = input_of("[[gyro]]", "LEFT");
  const std::string mems = input_of("[[gyro]]", "MEMS");
  const auto refused = [&](const std::string& text) {
    const auto messages = messages_of(text + kToCan1);
    return messages.size() == 1 && messages[0].find("cannot be told apart") != std::string::npos;
  };
  EXPECT_TRUE(refused(left + mems + input_of("[reference]", "RIGHT")));
  EXPECT_FALSE(refused(left + mems + input_of("[reference]", "RIGHT") + "source_address = 2\n"));
  EXPECT_TRUE(refused(left + mems + input_of("[reference]", "RIGHT") + "source_address = 3\n"));
  EXPECT_FALSE(refused(left + "source_address = 1\n" + mems + input_of("[reference]", "RIGHT") +
                       "source_address = 3\n"));
  EXPECT_TRUE(refused(left + mems + input_of("[reference]", "LEFT"))) << "the very same signal";
  EXPECT_TRUE(refused(left + mems + input_of("[reference]", "MEMS"))) << "the very same signal";
  EXPECT_FALSE(refused(left + mems + input_of("[reference]", "MEMS", "rate = \"Other\"\n")));
  EXPECT_FALSE(refused(left + mems + input_of("[speed]", "LEFT", "signal = \"Speed\"\n")))
      << "one message may serve several inputs";
  EXPECT_TRUE(refused(left + mems + input_of("[speed]", "RIGHT", "signal = \"Speed\"\n")));
}

// --- counters ------------------------------------------------------------------------------------

// AUTOSAR's profile 1 skips 15, whatever the file says of the signal.
TEST_F(Config, CountsProfile1To14) {
  write("bench.dbc", replaced(kBench, "48|4@1+ (1,0) [0|14]", "48|4@1+ (1,0) [0|15]"));
  EXPECT_EQ(plan_of(kGood).gyros[0].e2e.counter->modulus, 16U);
  const std::string protection = "crc = \"Crc\"\ne2e = \"profile_1a\"\ndata_id = 1\n";
  write("bench.dbc", replaced(replaced(kBench, "48|4@1+ (1,0) [0|14]", "48|4@1+ (1,0) [0|15]"),
                              "Crc : 56|8", "Crc : 40|8"));
  const std::string text =
      replaced(kGood, "counter = \"Counter\"\n", "counter = \"Counter\"\n" + protection);
  EXPECT_EQ(plan_of(text).gyros[0].e2e.counter->modulus, 15U);
  const std::string second = replaced(text, "\"profile_1a\"", "\"crc8_j1850\"");
  EXPECT_EQ(plan_of(replaced(second, "data_id = 1\n", "")).gyros[0].e2e.counter->modulus, 16U);
  const auto said = messages_of(replaced(text, "data_id = 1\n", "data_id = 1\ncounter_max = 9\n"));
  ASSERT_EQ(said.size(), 1U);
  EXPECT_NE(said[0].find("runs from 0 to 14"), std::string::npos) << said[0];
}

TEST_F(Config, TakesTheHighestValueOfACounter) {
  const std::string key = "counter = \"Counter\"\n";
  const Plan plan = plan_of(replaced(kGood, key, key + "counter_max = 9\nmax_delta_counter = 1\n"));
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_EQ(plan.gyros[0].e2e.counter->modulus, 10U);
  EXPECT_TRUE(plan.gyros[0].e2e.counter->strict);
  EXPECT_EQ(plan_of(replaced(kGood, key, key + "counter_max = 15\n")).gyros[0].e2e.counter->modulus,
            16U)
      << "against the file's range";
  expect_error(key, key + "counter_max = 16\n", "counter_max", {"counter_max is 16", "1 to 15"});
  expect_error(key, key + "counter_max = 0\n", "counter_max", {"counter_max is 0", "1 to 15"});
  expect_error(key, "counter_max = 9\n", "counter_max", {"counter_max without a counter"});
}

// --- what is odd ---------------------------------------------------------------------------------

TEST_F(Config, WarnsOfOneNameForBothGyros) {
  const auto loaded = load(replaced(kGood, "\"right\"", "\"left\""));
  ASSERT_TRUE(loaded);
  ASSERT_EQ(loaded->warnings.size(), 1U);
  EXPECT_NE(loaded->warnings[0].message().find("both gyros have the name \"left\""),
            std::string::npos);
}

// A message on the output's bus has an identifier of the output; on another bus that does not
// matter, and the gateway's own messages may be in the file.
TEST_F(Config, WarnsOfMessagesThatHaveAnIdentifierOfOurs) {
  write("bench.dbc", std::string(kBench) + "BO_ 1568 RADAR: 8 RIG\nBO_ 1569 VG_Bias: 8 RIG\n");
  const auto loaded = load(kGood);
  ASSERT_TRUE(loaded);
  ASSERT_EQ(loaded->warnings.size(), 1U);
  const std::string warning = loaded->warnings[0].message();
  EXPECT_NE(warning.find("message RADAR has the identifier 0x620, with which VG_Rate is sent"),
            std::string::npos)
      << warning;
  EXPECT_NE(warning.find("rate_id"), std::string::npos) << warning;
  const auto apart = load(replaced(kGood, "[output]\nbus = \"can0\"", "[output]\nbus = \"can3\""));
  ASSERT_TRUE(apart);
  EXPECT_TRUE(apart->warnings.empty());
}

// --- what is wrong -------------------------------------------------------------------------------

// A mistyped key in any table: the error names the nearest key of the table.
TEST_F(Config, NamesTheNearestKeyOfEveryTable) {
  expect_error("temperature = ", "temprature = ", "temprature",
               {"unknown key \"temprature\"", "[[gyro]]", "did you mean \"temperature\"?"});
  expect_error("rate = \"TableRate\"", "rate = \"TableRate\"\nsing = 1", "sing",
               {"[reference]", "did you mean \"sign\"?"});
  expect_error("z = \"AccZ\"", "z = \"AccZ\"\nmesage = 1", "mesage",
               {"[accelerometer]", "did you mean \"message\"?"});
  expect_error("signal = \"Speed\"", "signal = \"Speed\"\nsignl = 1", "signl",
               {"[speed]", "did you mean \"signal\"?"});
  expect_error("rest_s = ", "rests = ", "rests", {"[calibration]", "did you mean \"rest_s\"?"});
  expect_error("window_s = ", "windows = ", "windows",
               {"[corrector]", "did you mean \"window_s\"?"});
  expect_error("fd = true", "FD = true", "FD", {"[output]", "did you mean \"fd\"?"});
  expect_error("[speed]", "[sped]", "[sped]", {"did you mean \"speed\"?"});
}

// If no key is near, the error lists the table's keys.
TEST_F(Config, ListsTheKeysWhenNothingIsNear) {
  expect_error("fd = true", "colour = \"blue\"", "colour",
               {"unknown key \"colour\" in [output]", "one of: bus, rate_id"});
}

// A required key is missing: the error names the table's line and gives an example.
TEST_F(Config, AsksForMissingKeys) {
  expect_error("bus = \"can1\"\n", "", "[[gyro]]\nname = \"right\"",
               {"[[gyro]] needs bus", "for example bus = \"can0\""});
  expect_error("message = \"GYRO_A\"\n", "", "[[gyro]]\nname = \"left\"",
               {"[[gyro]] needs message"});
  expect_error("rate = \"TableRate\"\n", "", "[reference]", {"[reference] needs rate"});
  expect_error("y = \"AccY\"\n", "", "[accelerometer]", {"[accelerometer] needs y"});
  expect_error("signal = \"Speed\"\n", "", "[speed]", {"[speed] needs signal"});
  expect_error("[output]\nbus = \"can0\"\n", "[output]\n", "[output]", {"[output] needs bus"});
  expect_error("name = \"left\"\nbus = \"can0\"", "name = \"left\"\nbus = \"\"", "bus = \"\"",
               {"[[gyro]] needs bus"});
}

// A required table is missing.
TEST_F(Config, AsksForMissingTables) {
  const std::string text = kGood;
  const auto messages = messages_of(text.substr(0, text.find("[output]")));
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_NE(messages[0].find("there is no [output] table"), std::string::npos) << messages[0];
}

// Wrong types, such as a string instead of a number.
TEST_F(Config, TellsWrongTypes) {
  expect_error("rest_s = 30.0", "rest_s = \"30\"", "rest_s", {"rest_s must be a number"});
  expect_error("order = 2", "order = 2.0", "order", {"order must be a whole number"});
  expect_error("fd = true", "fd = 1", "fd = 1", {"fd must be true or false"});
  expect_error("method = \"mutual\"", "method = 3", "method",
               {"method must be a string in quotes"});
  expect_error("message = \"TABLE\"", "message = 259", "message = 259",
               {"message must be a string in quotes"});
  expect_error("sign = -1", "sign = \"-1\"", "sign = ", {"sign must be a whole number"});
}

// Tables of another shape.
TEST_F(Config, TellsTablesOfTheWrongShape) {
  const auto single = messages_of("[gyro]\nbus = \"can0\"\n[output]\nbus = \"can0\"\n");
  ASSERT_EQ(single.size(), 1U);
  EXPECT_NE(single[0].find(path() + ":1: "), std::string::npos) << single[0];
  EXPECT_NE(single[0].find("[[gyro]]"), std::string::npos) << single[0];
  const auto numbers = messages_of("gyro = [1, 2]\n[output]\nbus = \"can0\"\n");
  ASSERT_EQ(numbers.size(), 1U);
  EXPECT_NE(numbers[0].find("must be written as [[gyro]] tables"), std::string::npos) << numbers[0];
}

// None, one or three gyros.
TEST_F(Config, NeedsExactlyTwoGyros) {
  const std::string text = kGood;
  const std::size_t second = text.find("[[gyro]]", 10);
  const std::size_t rest = text.find("[reference]");
  const std::string first_gyro = text.substr(0, second);
  for (int gyros = 0; gyros < 5; ++gyros) {
    if (gyros == 2) continue;
    std::string wrong;
    for (int i = 0; i < gyros; ++i)
      wrong += first_gyro;
    const auto messages = messages_of(wrong + text.substr(rest));
    ASSERT_EQ(messages.size(), 1U) << gyros;
    EXPECT_NE(messages[0].find(fmt::format("there are {} [[gyro]] tables", gyros)),
              std::string::npos)
        << messages[0];
    EXPECT_NE(messages[0].find("exactly two"), std::string::npos) << messages[0];
  }
}

// A missing DBC file is reported once, although two gyros name it.
TEST_F(Config, TellsAMissingDbcFileOnce) {
  std::filesystem::remove(folder_ / "bench.dbc");
  const auto messages = messages_of(kGood);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_NE(messages[0].find(fmt::format("{}:{}: ", path(), 4)), std::string::npos) << messages[0];
  EXPECT_NE(messages[0].find("bench.dbc"), std::string::npos) << messages[0];
  EXPECT_NE(messages[0].find("relative to the configuration file"), std::string::npos)
      << messages[0];
}

// The error names the nearest message of the file, or the nearest signal of the message.
TEST_F(Config, NamesTheNearestMessageAndSignal) {
  expect_error("message = \"GYRO_A\"", "message = \"GYRO_1\"", "GYRO_1",
               {"bench.dbc has no message \"GYRO_1\"", "did you mean \"GYRO_A\"?"});
  expect_error("rate = \"TableRate\"", "rate = \"Tablerat\"", "Tablerat",
               {"has no signal \"Tablerat\"", "did you mean \"TableRate\"?"});
  expect_error("temperature = \"Temp\"", "temperature = \"Tmp\"", "\"Tmp\"",
               {"did you mean \"Temp\"?"});
  expect_error("sign_signal = \"Flag\"", "supply_voltage = \"Vlt\"", "\"Vlt\"",
               {"did you mean \"Volt\"?"});
  expect_error("\"Status == 0\"", "\"Stats == 0\"", "Stats",
               {"has no signal \"Stats\"", "did you mean \"Status\"?"});
}

// One frame cannot be read as two gyros, whatever their names.
TEST_F(Config, RefusesTwoGyrosInOneFrame) {
  const std::string text = replaced(replaced(replaced(kGood, "bus = \"can1\"", "bus = \"can0\""),
                                             "message = \"GYRO_B\"", "message = \"GYRO_A\""),
                                    "sign_signal = \"Flag\"\n", "");
  const auto messages = messages_of(text);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_NE(messages[0].find("both gyros are read from the same frame: GYRO_A on can0"),
            std::string::npos)
      << messages[0];
}

// A voltage is not a rate; the error lists the accepted units and how to correct a wrong file.
TEST_F(Config, RefusesUnitsThatAreNoRates) {
  expect_error("message = \"GYRO_B\"\nrate = \"RateZ\"", "message = \"GYRO_B\"\nrate = \"Volt\"",
               "rate = \"Volt\"",
               {"has the unit \"V\"", "deg/s, rad/s, deg/h", "set unit = \"deg/s\" here"});
  expect_error("sign = -1", "unit = \"furlong\"",
               "unit = ", {"\"furlong\"", "deg/s, rad/s, deg/h"});
  expect_error("temperature = \"Temp\"", "temperature = \"RateZ\"", "temperature",
               {"has the unit \"deg/s\"", "degC, K"});
  expect_error("temperature = \"Temp\"", "supply_voltage = \"Temp\"", "supply_voltage",
               {"has the unit \"degC\"", "V, mV"});
  expect_error("x = \"AccX\"\ny = \"AccY\"\nz = \"AccZ\"",
               "x = \"AccX\"\ny = \"AccY\"\nz = \"AccZZ\"", "AccZZ", {"did you mean \"AccZ\"?"});
  expect_error("message = \"WHEEL\"\nsignal = \"Speed\"",
               "message = \"TABLE\"\nsignal = \"TableRate\"", "signal = \"TableRate\"",
               {"has the unit \"deg/s\"", "m/s, km/h, mph"});
}

// A sign is a direction, not a factor.
TEST_F(Config, RefusesOtherSigns) {
  expect_error("sign = -1", "sign = 2", "sign = 2", {"sign is 2", "1, or -1"});
  expect_error("sign = -1", "sign = 0", "sign = 0", {"sign is 0"});
}

// For a text that is not a comparison, the error shows an example.
TEST_F(Config, RefusesConditionsThatAreNoComparison) {
  for (const char* text : {"Status", "Status = 0", "== 0", "Status == ", "Status == zero",
                           "Status == nan", "Status == 0 1", ""}) {
    expect_error("\"Status == 0\"", fmt::format("\"{}\"", text), "valid",
                 {"is not a comparison", "valid = \"Status == 0\""});
  }
}

// A counter of one bit, or a float, cannot count.
TEST_F(Config, RefusesCountersThatCannotCount) {
  expect_error("sign = -1\ncounter = \"Counter\"", "sign = -1\ncounter = \"Flag\"",
               "counter = \"Flag\"", {"Flag cannot be an alive counter", "2 to 31 bits"});
}

constexpr const char* kRightCounter = "sign = -1\ncounter = \"Counter\"";
constexpr const char* kTwoIds = "data_id = [0, 1]";

std::string right_with(const std::string& keys) {
  return kRightCounter + std::string("\n") + keys;
}

// Check values and counters of every input reach the plan, each at its byte.
TEST_F(Config, ReadsHowMessagesProveThemselves) {
  std::string text = replaced(kGood, kRightCounter,
                              right_with("max_delta_counter = 3\ncrc = \"Crc\"\n"
                                         "e2e = \"profile_1a\"\ndata_id = 0x1234"));
  text = replaced(text, "rate = \"TableRate\"",
                  "rate = \"TableRate\"\ncounter = \"Counter\"\ncrc = \"Crc\"\n"
                  "e2e = \"profile_5\"\ndata_id = 7");
  text = replaced(text, "signal = \"Speed\"",
                  "signal = \"Speed\"\ncrc = \"Checksum\"\ne2e = \"toyota\"");
  const Plan plan = plan_of(text);
  ASSERT_EQ(plan.gyros.size(), 2U);
  EXPECT_FALSE(plan.gyros[0].e2e.crc);
  EXPECT_EQ(plan.gyros[0].e2e.counter->max_delta, 0U);
  EXPECT_EQ(plan.gyros[1].e2e.counter->max_delta, 3U);
  using dbc::E2eKind;
  using dbc::E2eProtection;
  EXPECT_EQ(plan.gyros[1].e2e.crc->name, "Crc");
  EXPECT_EQ(plan.gyros[1].e2e.crc->protection,
            E2eProtection({.kind = E2eKind::kProfile1A, .crc_byte = 5, .data_ids = {0x1234}}));
  EXPECT_EQ(plan.reference->e2e.crc->protection,
            E2eProtection({.kind = E2eKind::kProfile5, .crc_byte = 4, .data_ids = {7}}));
  EXPECT_EQ(plan.reference->e2e.counter->modulus, 256U);
  EXPECT_EQ(plan.speed->e2e.crc->protection,
            E2eProtection({.kind = E2eKind::kToyota, .crc_byte = 7, .can_id = 261}));
  EXPECT_FALSE(plan.accelerometer->e2e.crc || plan.accelerometer->e2e.counter);
}

// If only half of a protection is configured, the error asks for the other half.
TEST_F(Config, RefusesProtectionsThatAreHalfSaid) {
  expect_error(kRightCounter, right_with("crc = \"Crc\""),
               "crc = ", {"kind of this check value", "profile_1a", "toyota"});
  expect_error(kRightCounter, right_with("e2e = \"crc8_j1850\""),
               "e2e = ", {"without a check value", "crc = \"NAME\""});
  expect_error(kRightCounter, right_with("e2e = \"profile_1a\"\ncrc = \"Crc\""),
               "e2e = ", {"needs a data_id", "data_id = 0x123"});
  expect_error(kRightCounter, right_with("data_id = 1"), "data_id = ", {"data_id without e2e"});
  expect_error("signal = \"Speed\"", "signal = \"Speed\"\nmax_delta_counter = 2",
               "max_delta_counter", {"without a counter"});
}

// Names, places and numbers that no protection can have.
TEST_F(Config, RefusesProtectionsThatCannotBe) {
  const auto with = [](const std::string& kind, const std::string& crc, const std::string& id) {
    return right_with("e2e = \"" + kind + "\"\ncrc = \"" + crc + "\"" +
                      (id.empty() ? "" : "\n" + id));
  };
  expect_error(kRightCounter, with("profile_1d", "Crc", "data_id = 1"),
               "e2e = ", {"no protection \"profile_1d\"", "did you mean \"profile_1"});
  expect_error(kRightCounter, with("crc8_j1850", "Crk", ""),
               "crc = ", {"no signal \"Crk\"", "did you mean \"Crc\""});
  expect_error(kRightCounter, with("crc8_j1850", "Volt", ""),
               "crc = ", {"16 bits from bit 16", "one whole byte"});
  expect_error(kRightCounter, with("profile_5", "Crc", "data_id = 1"),
               "crc = ", {"two whole bytes, Intel"});
  expect_error(kRightCounter, with("toyota", "Crc", "data_id = 1"),
               "data_id = ", {"toyota has no data ID"});
  expect_error(kRightCounter, with("profile_1c", "Crc", "data_id = 0x1000"),
               "data_id = ", {"0x1000", "0 to 0xfff"});
  expect_error(kRightCounter, with("profile_2", "Crc", kTwoIds), kTwoIds,
               {"2 data IDs", "16 values"});
  expect_error("counter = \"Counter\"\nvalid",
               "crc = \"Crc\"\ne2e = \"profile_1a\"\n"
               "data_id = 1\ncounter = \"Counter\"\nvalid",
               "crc = ", {"no byte that holds the counter", "GYRO_A has 8 bytes"});
  expect_error(kRightCounter, right_with("max_delta_counter = 255"), "max_delta_counter",
               {"max_delta_counter is 255", "1 (none may be lost) to 254"});
}

// The true rate of the calibration may be stated only once.
TEST_F(Config, RefusesContradictingCalibrations) {
  expect_error("latitude_deg = 50.45", "latitude_deg = 50.45\nrate_dps = 0.0032", "latitude_deg",
               {"both set the true rate", "keep one"});
  expect_error("latitude_deg = 50.45", "latitude_deg = 90.5", "latitude_deg",
               {"latitude_deg is 90.5", "-90 to 90"});
  expect_error("latitude_deg = 50.45", "rate_dps = nan", "rate_dps", {"rate_dps is nan"});
  expect_error("latitude_deg = 50.45", "source = \"refrence\"", "source",
               {"did you mean \"reference\"?"});
}

// when_moving accepts one of two words; with a reference it has no effect.
TEST_F(Config, ReadsWhatToDoWhenThePlatformMoves) {
  const auto when_moving = [&](const char* line) {
    return plan_of(replaced(kGood, "latitude_deg = 50.45", line)).calibration.when_moving;
  };
  EXPECT_EQ(when_moving(""), fusion::WhenMoving::kWait);
  EXPECT_EQ(when_moving("when_moving = \"wait\""), fusion::WhenMoving::kWait);
  EXPECT_EQ(when_moving("when_moving = \"accept\""), fusion::WhenMoving::kAccept);
  EXPECT_EQ(when_moving("source = \"reference\""), fusion::WhenMoving::kKnown);
  expect_error("latitude_deg = 50.45", "when_moving = \"acept\"", "when_moving",
               {"when_moving is \"acept\"", "did you mean \"accept\"?"});
}

// Calibrating against a reference needs one.
TEST_F(Config, ReferenceCalibrationNeedsAReference) {
  std::string text = replaced(kGood, "latitude_deg = 50.45", "source = \"reference\"");
  EXPECT_TRUE(plan_of(text).calibration.from_reference);
  const std::size_t from = text.find("[reference]");
  text.erase(from, text.find("[accelerometer]") - from);
  const auto messages = messages_of(text);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_NE(messages[0].find("needs a [reference] table"), std::string::npos) << messages[0];
}

// Names appear in tables, in pictures and on terminals.
TEST_F(Config, RefusesNamesThatAreNotPrintable) {
  expect_error("name = \"left\"", "name = \"l\\u001b[2J\"", "name = \"l",
               {"the name \"l\\x1b[2J\" is not printable"});
  expect_error("name = \"left\"", "name = \"l\\neft\"", "name = \"l", {"l\\x0aeft"});
  expect_error("bus = \"can2\"", "bus = \"can\\t2\"", "bus = \"can\\t", {"not an interface name"});
}

// Numbers outside their limits: the error states the limits.
TEST_F(Config, RefusesNumbersOutsideTheirLimits) {
  for (const char* value : {"0", "-1.0", "1e-9", "0.99", "86401", "inf", "nan"}) {
    expect_error("rest_s = 30.0", fmt::format("rest_s = {}", value), "rest_s",
                 {"rest_s is", "1 to 86400"});
  }
  for (const char* value : {"0.0", "5e-324", "0.09", "3601", "-inf"}) {
    expect_error("window_s = 5", fmt::format("window_s = {}", value), "window_s",
                 {"window_s is", "0.1 to 3600"});
  }
  for (const char* value : {"-1", "4", "9223372036854775807"}) {
    expect_error("order = 2", fmt::format("order = {}", value), "order",
                 {fmt::format("order is {}", value), "0 (constant drift)"});
  }
  for (const char* value : {"0", "0x800", "-1"}) {
    expect_error("rate_id = 0x620", fmt::format("rate_id = {}", value), "rate_id",
                 {"rate_id is", "0x001 to 0x7FF"});
  }
}

TEST_F(Config, RefusesMethodsItDoesNotHave) {
  expect_error("\"mutual\"", "\"mutal\"", "method",
               {"there is no method \"mutal\"", "did you mean \"mutual\"?"});
}

// Output frames must have identifiers of their own, and none of an input.
TEST_F(Config, RefusesColludingIdentifiers) {
  expect_error("bias_id = 0x621", "bias_id = 0x620", "[output]",
               {"two output frames have the same identifier"});
  expect_error("bias_id = 0x621", "bias_id = 0x101", "[output]",
               {"output identifier 0x101 is also an input on can0"});
  EXPECT_EQ(plan_of(replaced(kGood, "bias_id = 0x621", "bias_id = 0x102")).output.bias_id, 0x102U)
      << "0x102 is an input on the other bus";
}

// Linux limits interface names to 15 characters.
TEST_F(Config, RefusesInterfaceNamesThatCannotBe) {
  expect_error("bus = \"can1\"", "bus = \"a_name_of_16_chr\"", "a_name_of_16_chr",
               {"not an interface name", "15 characters"});
  expect_error("[output]\nbus = \"can0\"", "[output]\nbus = \"a_name_of_16_chr\"",
               "a_name_of_16_chr", {"not an interface name", "15 characters"});
}

// Without J1939, source_address would have no effect.
TEST_F(Config, RefusesSourceAddressesOutsideJ1939) {
  expect_error("sign = -1", "source_address = 3", "source_address", {"for a J1939 message"});
}

// A signal that does not fit its message is a mistake in the DBC file, so the error names its line.
TEST_F(Config, NamesTheDbcLineOfASignalThatDoesNotFit) {
  write("bench.dbc", replaced(kBench, "RateZ : 0|32@1-", "RateZ : 40|32@1-"));
  const auto messages = messages_of(kGood);
  ASSERT_FALSE(messages.empty());
  EXPECT_NE(messages[0].find(fmt::format("{}:{}", dbc_path(), line_of(kBench, "SG_ RateZ"))),
            std::string::npos)
      << messages[0];
}

// Invalid TOML: the error names the line.
TEST_F(Config, TellsTheLineOfASyntaxError) {
  for (const auto& [from, to] : {std::pair{"order = 2", "order = = 2"},
                                 {"order = 2", "order = 2\norder = 3"},
                                 {"[output]", "[output"},
                                 {"fd = true", "fd = yes"}}) {
    const std::string text = replaced(kGood, from, to);
    const auto messages = messages_of(text);
    ASSERT_EQ(messages.size(), 1U) << to;
    const std::size_t first = line_of(text, to);
    const bool near = messages[0].find(fmt::format("{}:{}: ", path(), first)) == 0 ||
                      messages[0].find(fmt::format("{}:{}: ", path(), first + 1)) == 0;
    EXPECT_TRUE(near) << messages[0];
  }
}

// Files that are not text.
TEST_F(Config, SurvivesAnythingAsAFile) {
  EXPECT_FALSE(load(""));
  EXPECT_FALSE(load(std::string("\xFF\xFE\0\x80", 4)));
  EXPECT_FALSE(load(std::string(100'000, '[')));
  const auto missing = load_config((folder_ / "nowhere.toml").string());
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().front().message().find("nowhere.toml"), std::string::npos);
  EXPECT_FALSE(load_config(folder_.string()));
}

// All mistakes of a file are reported together, in the order of lines.
TEST_F(Config, ReportsAllMistakesAtOnce) {
  std::string text = kGood;
  for (const auto& [from, to] : {std::pair{"temperature = \"Temp\"", "temperature = \"Tmp\""},
                                 {"sign = -1", "sign = 7"},
                                 {"y = \"AccY\"", "y = \"AccQ\""},
                                 {"rest_s = 30.0", "rest_s = -1"},
                                 {"order = 2", "order = 9"},
                                 {"rate_id = 0x620", "rate_id = 0x900"},
                                 {"fd = true", "fdd = true"}}) {
    text = replaced(text, from, to);
  }
  const auto messages = messages_of(text);
  ASSERT_EQ(messages.size(), 7U);
  unsigned long before = 0;
  for (const std::string& message : messages) {
    ASSERT_EQ(message.find(path() + ":"), 0U) << message;
    const unsigned long line = std::strtoul(message.c_str() + path().size() + 1, nullptr, 10);
    EXPECT_GT(line, before) << message;
    before = line;
  }
}

// The path of a configuration in the present folder contains no folder.
TEST_F(Config, FindsDbcFilesBesideAConfigWithoutAFolder) {
  write("vgyro.toml", kGood);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder_);
  const auto loaded = load_config("vgyro.toml");
  std::filesystem::current_path(before);
  EXPECT_TRUE(loaded) << loaded.error().front().message();
}

// The default configuration of ./run must remain loadable.
TEST(ExampleConfig, IsGood) {
  const auto loaded = load_config(std::string(VGYRO_DBC_DIR) + "/../examples/twin.toml");
  ASSERT_TRUE(loaded) << loaded.error().front().message();
  EXPECT_TRUE(loaded->warnings.empty());
}

}  // namespace
}  // namespace vgyro::gateway
