#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "gateway/config.h"
#include "gateway/heading.h"
#include "gateway/input_frames.h"
#include "gateway/pipeline.h"
#include "gateway/saved_state.h"
#include "tests/gateway/counting_new.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr Duration kInterval = std::chrono::milliseconds(20);
constexpr TimePoint kStart = time_from_ns(1'700'000'000'000'000'000);

constexpr const char* kUnits = R"(VERSION ""

BU_: RIG

BO_ 257 IMU_A: 16 RIG
 SG_ X : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Y : 32|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Z : 64|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 96|8@1+ (1,0) [0|255] "" RIG

BO_ 258 IMU_B: 16 RIG
 SG_ X : 0|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Y : 32|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Z : 64|32@1- (1E-006,0) [-2000|2000] "deg/s" RIG
 SG_ Counter : 96|8@1+ (1,0) [0|255] "" RIG

BO_ 259 WHOLE: 8 RIG
 SG_ X : 0|16@1- (0.01,0) [-300|300] "deg/s" RIG
 SG_ Y : 16|16@1- (0.01,0) [-300|300] "deg/s" RIG
 SG_ Z : 32|16@1- (0.01,0) [-300|300] "deg/s" RIG
 SG_ Alive : 48|8@1+ (1,0) [0|255] "" RIG
)";

constexpr const char* kWhole =
    "[[output.layout]]\ndbc = \"units.dbc\"\nmessage = \"WHOLE\"\nrate_not_available = -32768\n"
    "counter = \"Alive\"\n";
constexpr const char* kAllRates = "rate_x = \"X\"\nrate_y = \"Y\"\nrate_z = \"Z\"\n";

std::string gyro_text(const char* name, const char* message) {
  return std::string("[[gyro]]\nname = \"") + name +
         "\"\nbus = \"can0\"\ndbc = \"units.dbc\"\nmessage = \"" + message +
         "\"\nrate_x = \"X\"\nrate_y = \"Y\"\nrate_z = \"Z\"\ncounter = \"Counter\"\n";
}

/// A configuration in a folder of its own, read like a user's.
Plan plan_of(const std::string& output = "",
             const std::string& calibration = "rate_dps = [0.0, 0.0, 0.0]") {
  std::string folder = std::filesystem::temp_directory_path() / "vgyro-units-XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr) std::abort();
  std::ofstream(folder + "/units.dbc") << kUnits;
  std::ofstream(folder + "/vgyro.toml")
      << gyro_text("left", "IMU_A") << gyro_text("right", "IMU_B") << "[calibration]\nrest_s = 20\n"
      << calibration << "\n[output]\nbus = \"can0\"\n"
      << output;
  auto loaded = load_config(folder + "/vgyro.toml");
  std::filesystem::remove_all(folder);
  if (!loaded) throw std::runtime_error(loaded.error().front().message());
  return std::move(loaded->plan);
}

using Rates = std::array<double, 3>;

/// Motion of the platform; unit 2 is misaligned against unit 1.
struct World {
  Rates (*rate)(double t_s);
  Rates angle_rad{};
  double noise_dps = 0.02;
  Rates first_bias{0.1, -0.2, 0.3};
  Rates second_bias{-0.3, 0.15, 0.05};
};

Rates drives(double t_s) {
  if (t_s < 25.0) return {};
  const double ramp = std::min((t_s - 25.0) / 2.0, 1.0);
  const double gate = ramp * ramp * (3.0 - 2.0 * ramp);
  return {gate * 1.5 * std::sin(2.9 * t_s), gate * 1.3 * std::sin(2.3 * t_s),
          gate * 25.0 * std::sin(0.33 * t_s) * std::sin(0.05 * t_s)};
}

class Bus final : public FrameSink {
 public:
  void put(const can::Frame& frame, TimePoint /*stamp*/) override {
    ++frames;
    if (frame.id == 0x610) ++rates;
    if (frame.id == 259) last_of_layout = frame;
  }
  std::size_t frames = 0;
  std::size_t rates = 0;
  can::Frame last_of_layout{};
};

/// Checks every rate about one axis.
class Judge final : public OutputObserver {
 public:
  Judge(const World& world, std::size_t axis) : world_(world), axis_(axis) {}
  void on_output(const RateOutput& output, const std::array<double, 2>& bias_dps) override {
    if (!output.valid) return;
    const double t_s = to_seconds(output.instant - kStart);
    const double off = output.rate_dps - world_.rate(t_s)[axis_];
    heading_deg += off * to_seconds(kInterval);
    squares += std::pow(off / output.sigma_dps, 2);
    ++count;
    bias = bias_dps;
  }
  [[nodiscard]] double normalised() const { return squares / count; }
  double heading_deg = 0.0;
  double squares = 0.0;
  double count = 0.0;
  std::array<double, 2> bias{};

 private:
  const World& world_;
  std::size_t axis_;
};

void put_unit(const Plan& plan, std::size_t unit, const Rates& reading, int n, can::Frame& frame) {
  for (const GyroPlan& axis : plan.gyros[unit].axes)
    put_gyro(axis, reading[axis.sensor_axis], static_cast<std::uint64_t>(n), frame);
}

/// Frames of both units from `from_s` to `to_s`.
void play(const World& world, const Plan& plan, double from_s, double to_s, Pipeline& pipeline,
          FrameSink& sink, std::uint64_t seed = 7) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise(0.0, world.noise_dps);
  std::array<can::Frame, 2> frames{empty_frame(plan.gyros[0].match),
                                   empty_frame(plan.gyros[1].match)};
  const auto first = static_cast<int>(from_s / to_seconds(kInterval));
  const auto last = static_cast<int>(to_s / to_seconds(kInterval));
  for (int n = first; n < last; ++n) {
    for (std::size_t unit = 0; unit < 2; ++unit) {
      const TimePoint t = kStart + n * kInterval + (unit == 0 ? Duration{0} : kInterval / 3);
      const Rates w = world.rate(to_seconds(t - kStart));
      Rates reading = w;
      const Rates& a = world.angle_rad;
      const Rates& bias = unit == 0 ? world.first_bias : world.second_bias;
      if (unit == 1) {
        reading[0] += w[1] * a[2] - w[2] * a[1];
        reading[1] += w[2] * a[0] - w[0] * a[2];
        reading[2] += w[0] * a[1] - w[1] * a[0];
      }
      for (std::size_t i = 0; i < 3; ++i)
        reading[i] += bias[i] + noise(engine);
      put_unit(plan, unit, reading, n, frames[unit]);
      pipeline.receive(0, frames[unit], t, sink);
    }
  }
}

/// Units whose axes have messages of their own, 0x11n and 0x12n, each with counter and check value.
std::string own_messages_dbc() {
  std::string text = "VERSION \"\"\n\nBU_: RIG\n";
  for (int unit = 1; unit <= 2; ++unit) {
    for (int axis = 0; axis < 3; ++axis) {
      text += fmt::format(
          "\nBO_ {} UNIT{}_{}: 8 RIG\n SG_ Rate : 0|32@1- (1E-006,0) [-2000|2000] \"deg/s\" RIG\n"
          " SG_ Counter : 32|4@1+ (1,0) [0|15] \"\" RIG\n SG_ Crc : 56|8@1+ (1,0) [0|255] \"\" "
          "RIG\n",
          0x100 + 0x10 * unit + axis, unit, "XYZ"[axis]);
    }
  }
  return text;
}

Plan own_messages(const std::string& second_mount = "") {
  std::string text;
  for (int unit = 1; unit <= 2; ++unit) {
    text += fmt::format(
        "[[gyro]]\nname = \"{0}\"\nbus = \"can0\"\ndbc = \"units.dbc\"\n"
        "message = \"UNIT{0}_X\"\n{1}\n",
        unit, unit == 2 ? second_mount : "");
    for (const char axis : {'x', 'y', 'z'}) {
      text += fmt::format(
          "[[gyro.axis]]\naxis = \"{}\"\nmessage = \"UNIT{}_{}\"\nrate = \"Rate\"\n"
          "counter = \"Counter\"\ncrc = \"Crc\"\ne2e = \"crc8_j1850\"\n",
          axis, unit, static_cast<char>(axis - 'x' + 'X'));
    }
  }
  text += "[calibration]\nrest_s = 20\nrate_dps = [0.0, 0.0, 0.0]\n[output]\nbus = \"can0\"\n";
  std::string folder = std::filesystem::temp_directory_path() / "vgyro-units-XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr) std::abort();
  std::ofstream(folder + "/units.dbc") << own_messages_dbc();
  std::ofstream(folder + "/vgyro.toml") << text;
  auto loaded = load_config(folder + "/vgyro.toml");
  std::filesystem::remove_all(folder);
  if (!loaded) throw std::runtime_error(loaded.error().front().message());
  return std::move(loaded->plan);
}

/// Changes a frame of unit 0 or 1 about a sensor axis; false: the frame is lost.
using Spoil =
    std::function<bool(std::size_t unit, std::size_t axis, double t_s, can::Frame& frame)>;

/// Interval of a unit's frames, and delay between the messages of its axes.
struct Pace {
  Duration interval = kInterval;
  std::chrono::milliseconds apart{1};
};

/// Each axis in a message of its own; unit 2 is mounted as its plan says.
void play_apart(const World& world, const Plan& plan, double from_s, double to_s,
                Pipeline& pipeline, FrameSink& sink, const Spoil& spoil, std::uint64_t seed = 7,
                const Pace& pace = {}) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise(0.0, world.noise_dps);
  const auto first = static_cast<int>(from_s / to_seconds(pace.interval));
  const auto last = static_cast<int>(to_s / to_seconds(pace.interval));
  for (int n = first; n < last; ++n) {
    for (std::size_t unit = 0; unit < 2; ++unit) {
      for (const GyroPlan& axis : plan.gyros[unit].axes) {
        const Duration late = pace.apart * static_cast<int>(axis.sensor_axis) +
                              pace.interval / 4 * static_cast<int>(unit);
        const TimePoint t = kStart + n * pace.interval + late;
        const double t_s = to_seconds(t - kStart);
        const Rates w = world.rate(t_s);
        double reading = noise(engine);
        reading += (unit == 0 ? world.first_bias : world.second_bias)[axis.sensor_axis];
        // The sensor senses the vehicle's rate turned back into its axes.
        for (std::size_t i = 0; i < 3; ++i)
          reading += plan.gyros[unit].mount.at(i, axis.sensor_axis) * w[i];
        can::Frame frame = empty_frame(axis.match);
        put_gyro(axis, reading, static_cast<std::uint64_t>(n), frame);
        seal(axis.e2e, frame);
        if (spoil(unit, axis.sensor_axis, t_s, frame)) pipeline.receive(0, frame, t, sink);
      }
    }
  }
}

TEST(UnitPipeline, HasAnAxisForEachAndNamesIt) {
  const Plan plan = plan_of();
  ASSERT_EQ(plan.axes.size(), 3U);
  const Pipeline pipeline(plan);
  EXPECT_EQ(pipeline.axis_count(), 3U);
  const std::vector<FrameId> ids = output_ids(plan.output, 0);
  ASSERT_EQ(ids.size(), 9U);
  for (std::size_t i = 0; i < ids.size(); ++i)
    EXPECT_EQ(ids[i].id, 0x610U + i);
  EXPECT_EQ(output_ids(plan_of("fd = true\n").output, 0).size(), 7U);
}

TEST(UnitPipeline, AllocatesNothingOnTheFramePath) {
  const std::string layout = std::string(kWhole) + kAllRates;
  for (const std::string& output : {std::string(), std::string("fd = true\n"), layout}) {
    SCOPED_TRACE(output);
    const Plan plan = plan_of(output);
    const World world{.rate = drives, .angle_rad = {0.005, -0.004, 0.003}};
    Pipeline pipeline(plan);
    Bus bus;
    std::mt19937_64 engine(1);
    play(world, plan, 0.0, 1.0, pipeline, bus);
    const std::size_t before = allocations_so_far();
    play(world, plan, 1.0, 90.0, pipeline, bus);
    // The generator's frames and distribution do not allocate either.
    EXPECT_EQ(allocations_so_far() - before, 0U);
    EXPECT_GT(bus.frames, 9'000U);
    EXPECT_GT(pipeline.status().misalignment_segments, 5U);
  }
}

// The same while the heading is followed, axes in messages of their own are mixed, and faults
// occur.
TEST(UnitPipeline, AllocatesNothingThroughFaultsOfAMixedUnit) {
  const World world{.rate = drives};
  Plan plan = own_messages("mount = [20, 0, 0]");
  plan.calibration.latitude_deg = 50.0;
  plan.calibration.heading_deg = 0.0;
  Pipeline pipeline(plan);
  Bus bus;
  const Spoil spoil = [](std::size_t unit, std::size_t axis, double t_s, can::Frame& frame) {
    if (unit == 1 && axis == 2 && t_s > 50.0 && t_s < 60.0) frame.data[7] ^= 0x5A;
    return unit != 0 || t_s < 65.0 || t_s > 75.0;
  };
  play_apart(world, plan, 0.0, 1.0, pipeline, bus, spoil);
  const std::size_t before = allocations_so_far();
  play_apart(world, plan, 1.0, 90.0, pipeline, bus, spoil);
  EXPECT_EQ(allocations_so_far() - before, 0U);
  EXPECT_EQ(pipeline.status().state, State::kRunning);
  EXPECT_GT(pipeline.axis_status(1).gyros[1].rejected[static_cast<std::size_t>(Reject::kOtherAxis)],
            400U);
}

// A second drive starts with the learned misalignment, and without the heading error it caused.
TEST(UnitPipeline, KeepsTheTiltForASecondDrive) {
  const Plan plan = plan_of();
  const World world{.rate = drives,
                    .angle_rad = {0.3 * kRadPerDeg, -0.32 * kRadPerDeg, 0.24 * kRadPerDeg}};
  Pipeline first(plan);
  Bus bus;
  play(world, plan, 0.0, 600.0, first, bus);
  const auto memory = first.memory();
  ASSERT_TRUE(memory);
  ASSERT_EQ(memory->axes.size(), 3U);
  ASSERT_TRUE(memory->misalignment);
  const std::string text = to_text(*memory);
  EXPECT_LT(text.size(), kSavedStateBytesMax);
  const auto read = saved_state_from(text, "state");
  ASSERT_TRUE(read) << read.error().message();
  EXPECT_EQ(to_text(*read), text);

  Pipeline second(plan);
  ASSERT_TRUE(second.resume(*read));
  Judge judge(world, 0);
  second.observe_output(&judge, 0);
  play(world, plan, 620.0, 740.0, second, bus, 8);
  const Status& status = second.status();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(status.misalignment_deg[axis], world.angle_rad[axis] / kRadPerDeg, 0.02) << axis;
    EXPECT_LT(status.misalignment_sigma_deg[axis], 0.02) << axis;
  }
  EXPECT_EQ(status.state, State::kRunning);
  EXPECT_GT(judge.count, 5'000.0);
  EXPECT_GT(judge.normalised(), 0.8);
  EXPECT_LT(judge.normalised(), 1.2);
  // From the σ of the biases alone: 120 s times 1e-3 deg/s or so.
  EXPECT_LT(std::abs(judge.heading_deg), 4.0 * 120.0 * status.bias_sigma_dps + 0.02);
}

TEST(UnitPipeline, TakesUpNoStateOfOthers) {
  const Plan plan = plan_of();
  const World world{.rate = drives};
  Pipeline first(plan);
  Bus bus;
  play(world, plan, 0.0, 60.0, first, bus);
  auto state = *first.memory();
  Pipeline second(plan);
  SavedState single = state;
  single.axes.clear();
  EXPECT_FALSE(second.resume(single));
  SavedState other = state;
  other.axes[1].devices[0] = "another";
  EXPECT_FALSE(second.resume(other));
  EXPECT_TRUE(second.resume(state));
}

// A ferry that turns slowly and is tilted a little: its steady turn shows about z, and its
// component about x must not be learned there as drift.
Rates ferry(double t_s) {
  if (t_s < 60.0) return {};
  return {0.002, 0.0, 2.0};
}

TEST(UnitPipeline, LearnsNoDriftOfASteadyTurnThatAnotherAxisTells) {
  const Plan plan = plan_of();
  const World world{.rate = ferry, .noise_dps = 0.01};
  Pipeline pipeline(plan);
  Bus bus;
  Judge judge(world, 0);
  pipeline.observe_output(&judge, 0);
  play(world, plan, 0.0, 400.0, pipeline, bus);
  EXPECT_NEAR(judge.bias[0], world.first_bias[0], 0.001);
  EXPECT_NEAR(judge.bias[1], world.second_bias[0], 0.001);
  EXPECT_LT(judge.normalised(), 1.2);
  const auto& probability = pipeline.axis_status(2).probability;
  EXPECT_GT(probability[static_cast<std::size_t>(fusion::Hypothesis::kTurning)], 0.9);
}

// Motion about one axis is motion of the platform: no axis calibrates during it.
Rates turns_early(double t_s) {
  if (t_s < 10.0 || t_s > 30.0) return {};
  return {0.0, 0.0, 10.0 * std::sin(std::numbers::pi * (t_s - 10.0) / 20.0)};
}

TEST(UnitPipeline, BeginsTheCalibrationOfAllAxesAgainWhereOneMoves) {
  const Plan plan = plan_of();
  const World world{.rate = turns_early};
  Pipeline pipeline(plan);
  Bus bus;
  play(world, plan, 0.0, 29.0, pipeline, bus);
  for (std::size_t place = 0; place < 3; ++place)
    EXPECT_EQ(pipeline.axis_status(place).state, State::kCalibrating) << place;
  play(world, plan, 29.0, 60.0, pipeline, bus);
  for (std::size_t place = 0; place < 3; ++place) {
    EXPECT_EQ(pipeline.axis_status(place).state, State::kRunning) << place;
    EXPECT_GT(pipeline.axis_status(place).calibration_restarts, 0U) << place;
  }
}

// After eighteen of twenty seconds it turns about z, slowly and a little tilted: the component
// about x is less than a calibration calls motion.
Rates sets_off(double t_s) {
  if (t_s < 18.3) return {};
  return {0.03, -0.03, 3.0};
}

// Rest that ends for one axis ends for all: they are calibrated with the rest so far, and none
// learns the rest of the turn as its drift.
TEST(UnitPipeline, EndsTheCalibrationOfAllAxesWhereOneMovesAtTheEnd) {
  const Plan plan = plan_of();
  const World world{.rate = sets_off, .noise_dps = 0.002};
  Pipeline pipeline(plan);
  Bus bus;
  play(world, plan, 0.0, 20.5, pipeline, bus);
  for (std::size_t place = 0; place < 3; ++place) {
    const Status& status = pipeline.axis_status(place);
    EXPECT_EQ(status.state, State::kRunning) << place;
    EXPECT_EQ(status.calibration_restarts, 0U) << place;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const double bias = (gyro == 0 ? world.first_bias : world.second_bias)[place];
      // From 900 samples; with the remaining time included the error would be 0.0025.
      EXPECT_NEAR(status.gyros[gyro].bias_dps, bias, 6.0 * 0.002 / std::sqrt(900.0)) << place;
    }
  }
}

// An axis with too little rest, because its message began later, waits for the next rest.
TEST(UnitPipeline, BeginsAgainWhereAnAxisHasTooLittleOfTheStop) {
  const Plan plan = own_messages();
  const World world{.rate =
                        [](double t_s) {
                          return t_s < 19.0 || t_s > 30.0 ? Rates{} : Rates{0.0, 0.0, 3.0};
                        },
                    .noise_dps = 0.002};
  Pipeline pipeline(plan);
  Bus bus;
  const Spoil late = [](std::size_t, std::size_t axis, double t_s, can::Frame&) {
    return axis != 0 || t_s > 8.0;
  };
  play_apart(world, plan, 0.0, 29.0, pipeline, bus, late);
  EXPECT_EQ(pipeline.axis_status(0).state, State::kCalibrating);
  EXPECT_GT(pipeline.axis_status(0).calibration_restarts, 0U);
  EXPECT_EQ(pipeline.axis_status(2).state, State::kRunning);
  EXPECT_EQ(pipeline.axis_status(2).calibration_restarts, 0U);
  play_apart(world, plan, 29.0, 60.0, pipeline, bus, late, 8);
  EXPECT_EQ(pipeline.axis_status(0).state, State::kRunning);
}

// If motion is accepted, an axis that does not sense it is as uncertain as the others.
TEST(UnitPipeline, AcceptedMotionIsMotionOfAllAxes) {
  const Plan plan = plan_of("", "rate_dps = [0.0, 0.0, 0.0]\nwhen_moving = \"accept\"");
  const World world{.rate = turns_early};
  Pipeline pipeline(plan);
  Bus bus;
  play(world, plan, 0.0, 25.0, pipeline, bus);
  for (std::size_t place = 0; place < 3; ++place)
    EXPECT_TRUE(pipeline.axis_status(place).moved_in_calibration) << place;
}

TEST(UnitPipeline, GoesOnUnderAnotherOutput) {
  const World world{.rate = drives};
  const Plan plan = plan_of();
  const Plan fd = plan_of("fd = true\n");
  ASSERT_TRUE(same_but_output(plan, plan));
  Pipeline first(plan);
  Bus bus;
  play(world, plan, 0.0, 40.0, first, bus);
  Plan moved = plan;
  moved.output = fd.output;
  for (std::size_t place = 0; place < 3; ++place)
    moved.axes[place].output = fd.axes[place].output;
  Pipeline second(moved);
  second.take_over(std::move(first));
  Bus after;
  play(world, plan, 40.0, 50.0, second, after);
  EXPECT_NEAR(static_cast<double>(after.rates), 500.0, 2.0);
  EXPECT_EQ(second.status().state, State::kRunning);
}

// A layout that carried one axis and then carries all is the same stream: its counter and counts
// continue.
TEST(UnitPipeline, GoesOnCountingWhereALayoutGetsMoreAxes) {
  const World world{.rate = drives};
  const Plan plan = plan_of(std::string(kWhole) + "rate_z = \"Z\"\n");
  const Plan moved = plan_of(std::string(kWhole) + kAllRates);
  Pipeline first(plan);
  Bus bus;
  play(world, plan, 0.0, 40.0, first, bus);
  const std::uint64_t before = first.status().layouts_out[0].frames;
  EXPECT_NEAR(static_cast<double>(before), 2000.0, 12.0);
  EXPECT_EQ(bus.last_of_layout.data[6], (before - 1) % 256);
  Pipeline second(moved);
  second.take_over(std::move(first));
  play(world, moved, 40.0, 50.0, second, bus);
  const LayoutCounts counts = second.status().layouts_out[0];
  EXPECT_NEAR(static_cast<double>(counts.frames - before), 500.0, 1.0);
  EXPECT_EQ(bus.last_of_layout.data[6], (counts.frames - 1) % 256);
  // All but those during the calibration, which takes 20 s.
  EXPECT_NEAR(static_cast<double>(counts.frames - counts.valid), 1000.0, 12.0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto raw = static_cast<std::int16_t>(bus.last_of_layout.data[2 * axis] |
                                               bus.last_of_layout.data[2 * axis + 1] << 8U);
    EXPECT_NEAR(raw * 0.01, second.axis_status(axis).rate_dps, 0.005 + 1e-9) << axis;
  }
}

// --- faults of a frame, and of an axis -----------------------------------------------------------

/// The state of each axis, and whether the error of a rate ever exceeds what σ allows.
struct Outcome {
  std::array<State, 3> during{};
  std::array<State, 3> after{};
  std::array<double, 3> normalised{};
};

constexpr double kSpoiltFrom_s = 90.0;
constexpr double kSpoiltTo_s = 120.0;

Outcome outcome_of(const Plan& plan, Pipeline& pipeline, const Spoil& spoil) {
  static const World world{.rate = drives};
  Bus bus;
  std::array<Judge, 3> judges{Judge(world, 0), Judge(world, 1), Judge(world, 2)};
  for (std::size_t axis = 0; axis < 3; ++axis)
    pipeline.observe_output(&judges[axis], axis);
  const Spoil meanwhile = [&](std::size_t unit, std::size_t axis, double t_s, can::Frame& frame) {
    return t_s < kSpoiltFrom_s || t_s >= kSpoiltTo_s || spoil(unit, axis, t_s, frame);
  };
  Outcome outcome;
  play_apart(world, plan, 0.0, kSpoiltTo_s - 1.0, pipeline, bus, meanwhile);
  for (std::size_t axis = 0; axis < 3; ++axis)
    outcome.during[axis] = pipeline.axis_status(axis).state;
  play_apart(world, plan, kSpoiltTo_s - 1.0, kSpoiltTo_s + 20.0, pipeline, bus, meanwhile, 8);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    outcome.after[axis] = pipeline.axis_status(axis).state;
    outcome.normalised[axis] = judges[axis].normalised();
    EXPECT_GT(judges[axis].count, 5'000.0) << axis;
  }
  return outcome;
}

constexpr std::array kAllRunning{State::kRunning, State::kRunning, State::kRunning};

std::uint64_t refused(Pipeline& pipeline, std::size_t axis, std::size_t gyro, Reject cause) {
  return pipeline.axis_status(axis).gyros[gyro].rejected[static_cast<std::size_t>(cause)];
}

// A fault of a frame affects everything in it: with three axes in one message the unit is set
// aside, …
TEST(UnitFaults, AFaultOfTheFrameIsOfAllAxesInIt) {
  const Plan plan = plan_of();
  const World world{.rate = drives};
  Pipeline pipeline(plan);
  Bus bus;
  play(world, plan, 0.0, 60.0, pipeline, bus);
  std::mt19937_64 engine(5);
  std::normal_distribution<double> noise(0.0, world.noise_dps);
  can::Frame frozen = empty_frame(plan.gyros[1].match);
  put_unit(plan, 1, {1.0, 1.0, 1.0}, 3000 % 256, frozen);
  can::Frame good = empty_frame(plan.gyros[0].match);
  for (int n = 3000; n < 3050; ++n) {
    put_unit(plan, 0, {0.1 + noise(engine), -0.2 + noise(engine), 0.3 + noise(engine)}, n, good);
    pipeline.receive(0, good, kStart + n * kInterval, bus);
    pipeline.receive(0, frozen, kStart + n * kInterval + kInterval / 3, bus);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(pipeline.axis_status(axis).state, State::kDegraded) << axis;
    EXPECT_EQ(pipeline.axis_status(axis).gyros[1].fault, Fault::kCounterStuck) << axis;
    EXPECT_EQ(refused(pipeline, axis, 1, Reject::kCounterRepeated), 49U) << axis;
  }
}

// … and with axes in messages of their own, only the axis of that message.
TEST(UnitFaults, AFaultOfAnAxisOwnFrameLeavesTheOtherAxes) {
  struct Case {
    const char* name;
    Reject cause;
    Spoil spoil;
  };
  const Plan plan = own_messages();
  const auto of_z = [](std::size_t unit, std::size_t axis) { return unit == 1 && axis == 2; };
  const std::array cases{Case{"check value", Reject::kCrcWrong,
                              [&](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
                                if (of_z(unit, axis)) frame.data[7] ^= 0x5A;
                                return true;
                              }},
                         Case{"counter", Reject::kCounterRepeated,
                              [&](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
                                if (!of_z(unit, axis)) return true;
                                frame.data[4] = 3;
                                seal(plan.gyros[1].axes[2].e2e, frame);
                                return true;
                              }},
                         Case{"length", Reject::kTruncated,
                              [&](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
                                if (of_z(unit, axis)) frame.length = 3;
                                return true;
                              }}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    Pipeline pipeline(plan);
    const Outcome outcome = outcome_of(plan, pipeline, one.spoil);
    EXPECT_EQ(outcome.during, (std::array{State::kRunning, State::kRunning, State::kDegraded}));
    EXPECT_EQ(outcome.after, kAllRunning);
    EXPECT_GT(refused(pipeline, 2, 1, one.cause), 1'000U);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_LT(outcome.normalised[axis], 1.3) << axis;
      if (axis < 2) {
        EXPECT_EQ(rig::rejected_total(pipeline.axis_status(axis).gyros[1]), 0U) << axis;
      }
    }
  }
}

// A clip belongs to the sensor axis, whatever message carries it.
TEST(UnitFaults, AClippedAxisIsSetAsideAlone) {
  const Plan plan = own_messages();
  Pipeline pipeline(plan);
  const GyroPlan& z = plan.gyros[1].axes[2];
  int n = 0;
  const Outcome outcome = outcome_of(
      plan, pipeline, [&](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
        if (unit != 1 || axis != 2) return true;
        put_gyro(z, 2000.0, static_cast<std::uint64_t>(n++), frame);
        seal(z.e2e, frame);
        return true;
      });
  EXPECT_EQ(outcome.during, (std::array{State::kRunning, State::kRunning, State::kDegraded}));
  EXPECT_EQ(outcome.after, kAllRunning);
  EXPECT_GT(
      pipeline.axis_status(2).gyros[1].faults[static_cast<std::size_t>(Fault::kSaturated)].times,
      0U);
  EXPECT_LT(outcome.normalised[2], 1.3);
}

// The mount mixes y and z. An outdated reading of z must not be used, or the rate about y would be
// wrong by a third of the platform's rate.
TEST(UnitFaults, AMountMixesNoReadingThatIsOld) {
  const Plan plan = own_messages("mount = [20, 0, 0]");
  struct Case {
    const char* name;
    Spoil spoil;
  };
  const std::array cases{
      Case{"silent", [](std::size_t unit, std::size_t axis, double,
                        can::Frame&) { return unit != 1 || axis != 2; }},
      Case{"check value", [](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
             if (unit == 1 && axis == 2) frame.data[7] ^= 0x5A;
             return true;
           }}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    Pipeline pipeline(plan);
    const Outcome outcome = outcome_of(plan, pipeline, one.spoil);
    // About x the unit still has all readings; about y and z it has not.
    EXPECT_EQ(outcome.during, (std::array{State::kRunning, State::kDegraded, State::kDegraded}));
    EXPECT_EQ(outcome.after, kAllRunning);
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_LT(outcome.normalised[axis], 1.5) << axis;
  }
}

// An axis that recovers must not treat the axes that went without it as faulty.
TEST(UnitFaults, AMixedUnitComesBackWhole) {
  const Plan plan = own_messages("mount = [20, 0, 0]");
  Pipeline pipeline(plan);
  const GyroPlan& y = plan.gyros[1].axes[1];
  int n = 0;
  const Outcome outcome = outcome_of(
      plan, pipeline, [&](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
        if (unit != 1 || axis != 1) return true;
        put_gyro(y, 0.5, static_cast<std::uint64_t>(n++), frame);
        seal(y.e2e, frame);
        return true;
      });
  EXPECT_EQ(outcome.during, (std::array{State::kRunning, State::kDegraded, State::kDegraded}));
  EXPECT_EQ(outcome.after, kAllRunning);
  const Status& z = pipeline.axis_status(2);
  EXPECT_EQ(z.gyros[1].faults[static_cast<std::size_t>(Fault::kStuck)].times, 0U);
  EXPECT_GT(refused(pipeline, 2, 1, Reject::kOtherAxis), 1'000U);
}

// At ten samples a second, with a third of the interval between the messages of the axes.
TEST(UnitFaults, SlowAxesInMessagesOfTheirOwnComeIntoUse) {
  const Plan plan = own_messages("mount = [20, 0, 0]");
  const World world{.rate = [](double) { return Rates{}; }};
  Pipeline pipeline(plan);
  Bus bus;
  play_apart(world, plan, 0.0, 40.0, pipeline, bus,
             [](std::size_t, std::size_t, double, can::Frame&) { return true; }, 7,
             {.interval = std::chrono::milliseconds(100), .apart = std::chrono::milliseconds(33)});
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_EQ(pipeline.axis_status(axis).state, State::kRunning) << axis;
    EXPECT_LT(refused(pipeline, axis, 1, Reject::kOtherAxis), 3U) << axis;
  }
}

// One lost frame is a hole, and no fault.
TEST(UnitFaults, ALostFrameOfAMixedAxisSetsNobodyAside) {
  const Plan plan = own_messages("mount = [20, 0, 0]");
  Pipeline pipeline(plan);
  int n = 0;
  const Outcome outcome = outcome_of(
      plan, pipeline, [&](std::size_t unit, std::size_t axis, double, can::Frame& frame) {
        if (unit == 1 && axis == 2 && ++n % 100 == 0) frame.data[7] ^= 0x5A;
        return true;
      });
  EXPECT_EQ(outcome.during, kAllRunning);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const FaultRecord& record : pipeline.axis_status(axis).gyros[1].faults)
      EXPECT_EQ(record.times, 0U) << axis;
    EXPECT_LT(outcome.normalised[axis], 1.3) << axis;
  }
  EXPECT_GT(refused(pipeline, 2, 1, Reject::kCrcWrong), 10U);
}

// --- the heading ---------------------------------------------------------------------------------

constexpr double kLatitude_deg = 50.0;
constexpr const char* kNorthwards = "latitude_deg = 50.0\nheading_deg = 0.0";
// IERS: 7.292115e-5 rad/s.
constexpr double kEarth_dps = 7.292115e-5 / kRadPerDeg;

double north_dps() {
  return kEarth_dps * std::cos(kLatitude_deg * kRadPerDeg);
}

/// The Earth's rate in the vehicle's axes for a heading clockwise from north, and a rate about z.
Rates on_earth(double heading_deg, double about_z_dps) {
  return {north_dps() * std::cos(heading_deg * kRadPerDeg),
          north_dps() * std::sin(heading_deg * kRadPerDeg),
          kEarth_dps * std::sin(kLatitude_deg * kRadPerDeg) + about_z_dps};
}

/// Northwards at rest, then round to the south within ten seconds, and at rest again; an hour later
/// the platform has been turned to the east.
Rates goes_south(double t_s) {
  if (t_s < 30.0) return on_earth(0.0, 0.0);
  if (t_s < 40.0) return on_earth(18.0 * (t_s - 30.0), -18.0);
  return t_s < 3600.0 ? on_earth(180.0, 0.0) : on_earth(90.0, 0.0);
}

constexpr World kOnEarth{.rate = goes_south, .noise_dps = 0.002};

/// The mean error of both units' biases about x after a stop.
double off_after(const Pipeline& pipeline) {
  const Status& x = pipeline.axis_status(0);
  EXPECT_GT(x.stops, 0U);
  return 0.5 * (x.gyros[0].bias_dps - kOnEarth.first_bias[0] + x.gyros[1].bias_dps -
                kOnEarth.second_bias[0]);
}

TEST(UnitHeading, TurnsTheEarthAtAStop) {
  const Plan plan = plan_of("", kNorthwards);
  Pipeline pipeline(plan);
  Bus bus;
  play(kOnEarth, plan, 0.0, 160.0, pipeline, bus);
  // Learned with the Earth's rate of a northward heading, the biases would be off by twice that
  // rate.
  EXPECT_LT(std::abs(off_after(pipeline)), 0.3 * north_dps());
  EXPECT_LT(pipeline.axis_status(0).sigma_dps, 0.5 * north_dps() + kOnEarth.noise_dps);
}

// After a reload, or an immediate restart of the service, the heading is unchanged.
TEST(UnitHeading, IsKeptThroughAShortRestart) {
  const Plan plan = plan_of("", kNorthwards);
  Pipeline first(plan);
  Bus bus;
  play(kOnEarth, plan, 0.0, 42.0, first, bus);
  const auto read = saved_state_from(to_text(*first.memory()), "state");
  ASSERT_TRUE(read) << read.error().message();
  ASSERT_TRUE(read->heading);
  EXPECT_NEAR(std::abs(read->heading->heading_rad), std::numbers::pi, 0.03);
  EXPECT_LT(read->heading->sigma_rad, 0.1);
  Pipeline second(plan);
  ASSERT_TRUE(second.resume(*read));
  play(kOnEarth, plan, 42.2, 160.0, second, bus, 8);
  EXPECT_LT(std::abs(off_after(second)), 0.3 * north_dps());
}

// After an hour the heading is unknown: a bias learned at a stop may then be wrong by the Earth's
// rate, which σ includes; before that stop σ is as it was.
TEST(UnitHeading, IsInSigmaAfterALongRestart) {
  const Plan plan = plan_of("", kNorthwards);
  Pipeline first(plan);
  Bus bus;
  play(kOnEarth, plan, 0.0, 100.0, first, bus);
  const SavedState state = *first.memory();
  for (const bool older : {false, true}) {
    SCOPED_TRACE(older ? "of an older release" : "of this one");
    SavedState kept = state;
    if (older) {
      kept.heading.reset();
      for (SavedState& axis : kept.axes)
        axis.earth_doubt_dps.reset();
    }
    Pipeline second(plan);
    ASSERT_TRUE(second.resume(kept));
    Judge judge(kOnEarth, 0);
    second.observe_output(&judge, 0);
    play(kOnEarth, plan, 3700.0, 3703.0, second, bus, 8);
    const double doubt_dps = north_dps() / std::numbers::sqrt2;
    const double white_dps = 0.5 * kOnEarth.noise_dps * kOnEarth.noise_dps;
    const auto sigma = [&] { return second.axis_status(0).sigma_dps; };
    if (older) {
      EXPECT_GT(sigma(), 0.99 * doubt_dps);
    }
    play(kOnEarth, plan, 3703.0, 3860.0, second, bus, 9);
    EXPECT_GT(sigma(), 0.99 * doubt_dps);
    EXPECT_LT(sigma(), 1.2 * std::sqrt(doubt_dps * doubt_dps + white_dps));
    EXPECT_LT(std::abs(off_after(second)), 3.0 * doubt_dps);
    // A third run takes up the same uncertainty.
    const auto memory = second.memory();
    ASSERT_TRUE(memory);
    EXPECT_GT(memory->axes[0].earth_doubt_dps.value_or(0.0), 0.99 * doubt_dps);
    EXPECT_EQ(memory->axes[2].earth_doubt_dps.value_or(1.0), 0.0) << "z needs no heading";
  }
}

// The formula against a Monte Carlo simulation: mean and spread of the Earth's rate over possible
// headings.
TEST(UnitHeading, HasTheMeanAndSpreadOfItsDoubt) {
  constexpr std::uint64_t kSeed = 3;
  std::mt19937_64 engine(kSeed);
  CalibrationPlan calibration;
  calibration.latitude_deg = kLatitude_deg;
  calibration.heading_deg = 0.0;
  for (const double sigma_rad : {0.0, 0.2, 1.0, Heading::kSigmaMost_rad}) {
    for (const double heading_rad : {0.0, 0.7, -2.5}) {
      Heading heading(calibration);
      heading.resume(HeadingMemory{.heading_rad = heading_rad, .sigma_rad = sigma_rad});
      std::normal_distribution<double> may_be(heading_rad, std::max(sigma_rad, 1e-12));
      constexpr int kThrows = 200'000;
      std::array<double, 2> sum{};
      std::array<double, 2> squares{};
      for (int i = 0; i < kThrows; ++i) {
        const double one = may_be(engine);
        const std::array<double, 2> rate_dps{north_dps() * std::cos(one),
                                             north_dps() * std::sin(one)};
        for (std::size_t axis = 0; axis < 2; ++axis) {
          sum[axis] += rate_dps[axis];
          squares[axis] += rate_dps[axis] * rate_dps[axis];
        }
      }
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const double mean = sum[axis] / kThrows;
        const double spread = std::sqrt(std::max(squares[axis] / kThrows - mean * mean, 0.0));
        const double off = 5.0 * north_dps() / std::sqrt(kThrows);
        EXPECT_NEAR(heading.earth_rate_dps(axis), mean, off) << sigma_rad << ' ' << heading_rad;
        EXPECT_NEAR(heading.earth_doubt_dps(axis), spread, off) << sigma_rad << ' ' << heading_rad;
      }
    }
  }
}

TEST(UnitHeading, IsLostWhileNobodyTellsTheTurns) {
  CalibrationPlan calibration;
  calibration.latitude_deg = kLatitude_deg;
  calibration.heading_deg = 0.0;
  Heading heading(calibration);
  const Heading::Turn turn{.rate_dps = 9.0, .sigma_dps = 0.01, .bias_sigma_dps = 1e-4};
  TimePoint t = kStart;
  for (int i = 0; i < 500; ++i, t += kInterval)
    heading.follow(t, std::nullopt, true);
  EXPECT_EQ(heading.earth_doubt_dps(0), 0.0) << "at rest it does not turn";
  for (int i = 0; i < 500; ++i, t += kInterval)
    heading.follow(t, turn, false);
  // 90 deg to the left of north is west.
  EXPECT_NEAR(heading.earth_rate_dps(1), -north_dps(), 1e-3 * north_dps());
  EXPECT_LT(heading.earth_doubt_dps(0), 0.01 * north_dps());
  heading.follow(t + std::chrono::minutes(2), turn, false);
  EXPECT_NEAR(heading.earth_rate_dps(1), 0.0, 1e-3 * north_dps());
  EXPECT_NEAR(heading.earth_doubt_dps(0), north_dps() / std::numbers::sqrt2, 1e-3 * north_dps());
}

}  // namespace
}  // namespace vgyro::gateway
