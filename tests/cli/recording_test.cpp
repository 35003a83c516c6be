#include "cli/recording.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "gap/kinds.h"
#include "gap/signals.h"
#include "gateway/config.h"

namespace vgyro::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kBench = R"(VERSION ""

BU_: RIG

BO_ 257 GYRO_A: 8 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Temp : 32|16@1- (0.01,0) [-40|125] "degC" RIG
 SG_ Counter : 48|4@1+ (1,0) [0|15] "" RIG
 SG_ Volt : 56|8@1+ (50,0) [0|12000] "mV" RIG
 SG_ Roll : 32|8@1- (1,0) [-100|100] "deg/s" RIG
 SG_ Pitch : 40|8@1- (1,0) [-100|100] "deg/s" RIG
 SG_ Yaw : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG

BO_ 258 GYRO_B: 4 RIG
 SG_ Rate : 0|32@1- (1,0) [0|0] "deg/s" RIG

BO_ 259 TABLE: 4 RIG
 SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG

BO_ 260 ACCEL: 6 RIG
 SG_ X : 0|16@1- (0.001,0) [-30|30] "g" RIG
 SG_ Y : 16|16@1- (0.001,0) [-30|30] "g" RIG
 SG_ Z : 32|16@1- (0.001,0) [-30|30] "g" RIG

SIG_VALTYPE_ 258 Rate : 1;
)";

constexpr std::string_view kConfig = R"(
[[gyro]]
name = "left"
bus = "can0"
dbc = "bench.dbc"
message = "GYRO_A"
rate = "Rate"
temperature = "Temp"
counter = "Counter"

[[gyro]]
name = "right"
bus = "can1"
dbc = "bench.dbc"
message = "GYRO_B"
rate = "Rate"
sign = -1

[reference]
bus = "can0"
dbc = "bench.dbc"
message = "TABLE"
rate = "Rate"

[accelerometer]
bus = "can0"
dbc = "bench.dbc"
message = "ACCEL"
x = "X"
y = "Y"
z = "Z"

[calibration]
rest_s = 30.0
rate_dps = 0.0032

[output]
bus = "can0"
)";

class RecordingTest : public testing::Test {
 protected:
  RecordingTest() {
    std::string name = testing::TempDir() + "vgyro-recording-XXXXXX";
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    root_ = name;
    put("bench.dbc", kBench);
  }
  ~RecordingTest() override { fs::remove_all(root_); }

  void put(const char* name, std::string_view text) const { std::ofstream(root_ / name) << text; }
  Expected<gap::Recording> read(std::string_view log, std::string_view config = kConfig) {
    put("vgyro.toml", config);
    put("in.log", log);
    auto loaded = gateway::load_config(root_ / "vgyro.toml");
    EXPECT_TRUE(loaded);
    if (!loaded) return fail("vgyro.toml", loaded.error().front().message());
    auto recordings = read_recordings(root_ / "in.log", std::span(&loaded->plan, 1), "test");
    if (!recordings) return tl::unexpected(recordings.error());
    return std::move(recordings->front());
  }

  fs::path root_;
};

// Bytes computed by hand from the DBC text: 0.5 deg/s is 500000 = 0007A120, 25 degC 2500 = 09C4.
constexpr std::string_view kLog =
    "(1700000000.000000) can0 103#40420F00\n"         // reference 1 deg/s
    "(1700000000.001000) can0 101#20A10700C40900\n"   // left 0.5, 25 degC, counter 0
    "(1700000000.002000) can1 102#000080BE\n"         // right -0.25 upside down: 0.25
    "(1700000000.003000) can0 104#E80300000CFE\n"     // 1, 0, -0.5 g
    "(1700000000.011000) can0 101#20A10700C40901\n"   // counter 1
    "(1700000000.012000) can1 102#0000803E\n"         // right 0.25: -0.25
    "(1700000000.021000) can0 101#E05EF8FF280A0F\n"   // left -0.5, 26 degC, counter 15
    "(1700000000.022000) can1 7FF#00\n"               // nobody's
    "(1700000000.031000) can0 101#20A10700280A00\n";  // counter 0

TEST_F(RecordingTest, KeepsEveryUsableFrameWithItsOwnStampCounterAndTemperature) {
  // Seconds count from the first frame that has a role, here the reference's.
  const auto recording = read(kLog);
  ASSERT_TRUE(recording) << recording.error().message();
  const gap::GyroSeries& left = recording->gyros[0];
  EXPECT_EQ(left.name, "left");
  ASSERT_EQ(left.t_s.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(left.t_s[i], 0.001 + 0.01 * static_cast<double>(i), 1e-9);
  EXPECT_EQ(left.rate_dps, (std::vector<double>{0.5, 0.5, -0.5, 0.5}));
  EXPECT_EQ(left.temperature_c, (std::vector<double>{25.0, 25.0, 26.0, 26.0}));
  EXPECT_EQ(left.counter, (std::vector<std::uint32_t>{0, 1, 15, 0}));
  EXPECT_EQ(left.counter_modulus, 16U);
  EXPECT_DOUBLE_EQ(left.step_dps, 1e-6);
  EXPECT_DOUBLE_EQ(left.limit_dps, 2000.0);
  const gap::GyroSeries& right = recording->gyros[1];
  EXPECT_EQ(right.rate_dps, (std::vector<double>{0.25, -0.25}));
  EXPECT_TRUE(right.temperature_c.empty());
  EXPECT_TRUE(right.counter.empty());
  EXPECT_EQ(right.counter_modulus, 0U);
  EXPECT_EQ(right.step_dps, 0.0);
  EXPECT_EQ(right.limit_dps, 0.0);
  EXPECT_EQ(recording->reference_dps.t_s, std::vector<double>{0.0});
  EXPECT_EQ(recording->reference_dps.value, std::vector<double>{1.0});
  EXPECT_EQ(recording->acceleration.g[0], std::vector<double>{1.0});
  EXPECT_EQ(recording->acceleration.g[2], std::vector<double>{-0.5});
  EXPECT_TRUE(recording->has_reference);
  EXPECT_TRUE(recording->has_acceleration);
  EXPECT_EQ(recording->rest_s, 30.0);
  EXPECT_EQ(recording->rest_rate_dps, 0.0032);
  EXPECT_NEAR(recording->seconds, 0.031, 1e-9);
}

TEST_F(RecordingTest, RestIsNotKnownWhereTheReferenceCalibrates) {
  const std::size_t rest = kConfig.find("rest_s");
  const std::string_view before = kConfig.substr(0, rest);
  const std::string_view after = kConfig.substr(kConfig.find('\n', rest));
  const auto recording = read(kLog, fmt::format("{}source = \"reference\"{}", before, after));
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->rest_s, 0.0);
}

TEST_F(RecordingTest, TakesARepeatedStampWhenTheCounterMoved) {
  // A bus that was read late gives several frames the same stamp; a frame that is left out would
  // look like a lost one.
  const auto recording = read(fmt::format("{}{}", kLog,
                                          "(1700000000.031000) can0 101#20A10700280A01\n"
                                          "(1700000000.012000) can1 102#0000803E\n"));
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->gyros[0].t_s.size(), 5U);
  EXPECT_EQ(recording->gyros[1].t_s.size(), 2U);
}

TEST_F(RecordingTest, ModelFileIsNotAppliedToReadings) {
  // The recording keeps the raw rate as measured, because the model itself is to be judged.
  put("known.toml", "format = 1\n[[effect]]\ngyro = 1\nkind = \"bias\"\nvalue_dps = 0.4\n");
  const auto recording =
      read(kLog, fmt::format("{}[corrector]\nmodel = \"known.toml\"\n", kConfig));
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->gyros[0].rate_dps.front(), 0.5);
}

TEST_F(RecordingTest, StampThatIsGarbageCostsItsFrame) {
  const auto recording = read(fmt::format("{}{}", kLog,
                                          "(1900000000.000000) can0 101#20A10700280A01\n"
                                          "(1700000000.051000) can0 101#20A10700280A02\n"));
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->gyros[0].t_s.size(), 5U);
  EXPECT_NEAR(recording->seconds, 0.051, 1e-9);
}

TEST_F(RecordingTest, TellsWhichGyroIsMissingAndWhatTheLogHolds) {
  const auto recording = read("(1700000000.001000) can0 101#20A10700C40900\n");
  ASSERT_FALSE(recording);
  EXPECT_NE(recording.error().message().find("no frame of gyro right (GYRO_B 102 on can1)"),
            std::string::npos)
      << recording.error().message();
}

// If every input is configured and sent, the recording has every one. A new input is tested here
// without being named, and needs its signal in this configuration.
TEST_F(RecordingTest, HoldsEveryInputOfTheWorkflow) {
  std::string log;
  for (int i = 0; i < 100; ++i) {
    const double t_s = 1'700'000'000.0 + 0.01 * i;
    log += fmt::format("({:.6f}) can0 103#40420F00\n", t_s);
    log += fmt::format("({:.6f}) can0 101#20A10700C409{:02X}{:02X}\n", t_s + 0.001, i % 16,
                       i < 50 ? 100 : 96);
    log += fmt::format("({:.6f}) can1 102#0000803E\n", t_s + 0.002);
    log += fmt::format("({:.6f}) can0 104#E80300000CFE\n", t_s + 0.003);
  }
  std::string config(kConfig);
  config.replace(
      config.find("counter ="), 0,
      "supply_voltage = \"Volt\"\nrate_x = \"Roll\"\nrate_y = \"Pitch\"\nrate_z = \"Yaw\"\n");
  const auto recording = read(log, config);
  ASSERT_TRUE(recording) << recording.error().message();
  const gap::GyroSeries& left = recording->gyros[0];
  ASSERT_EQ(left.supply_v.size(), left.t_s.size());
  EXPECT_NEAR(left.supply_v.front(), 5.0, 1e-12);
  EXPECT_NEAR(left.supply_v.back(), 4.8, 1e-12);
  EXPECT_TRUE(recording->gyros[1].supply_v.empty());
  ASSERT_EQ(left.other_rate_dps[1].size(), left.t_s.size());
  EXPECT_EQ(left.other_rate_dps[0].front(), -60.0);
  EXPECT_EQ(left.other_rate_dps[1].front(), 9.0);
  EXPECT_TRUE(recording->gyros[1].other_rate_dps[0].empty());
  gap::Signals signals;
  gap::set_circumstances(left, recording->acceleration, signals);
  signals.motion =
      gap::Motion(gap::SampledCurve(recording->reference_dps.t_s, recording->reference_dps.value));
  for (const gap::InputRow& input : gap::inputs()) {
    EXPECT_TRUE(std::isfinite(input.value(signals.motion.rate(0.5).value, signals.at(0.5))))
        << "input " << static_cast<int>(input.input);
  }
}

}  // namespace
}  // namespace vgyro::cli
