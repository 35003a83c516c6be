#include "fusion/sensor_watch.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using Finding = SensorWatch::Finding;
using Signal = std::function<double(double t_s)>;

constexpr double kCarStep_dps = 0.244;
constexpr TimePoint kStart = time_from_ns(1'700'000'000'000'000'000);

Signal rounded(Signal signal, double step_dps) {
  return [=](double t_s) { return std::round(signal(t_s) / step_dps) * step_dps; };
}

Signal clipped(Signal signal, double limit_dps) {
  return [=](double t_s) { return std::clamp(signal(t_s), -limit_dps, limit_dps); };
}

Signal frozen(Signal signal, double from_s, double to_s) {
  return [=](double t_s) { return signal(t_s >= from_s && t_s < to_s ? from_s : t_s); };
}

Signal noisy(Signal signal, double sigma_dps, Random& random) {
  return
      [signal, sigma_dps, &random](double t_s) { return signal(t_s) + random.normal(sigma_dps); };
}

/// The signal, each value held for `period_s`.
Signal held(Signal signal, double period_s) {
  double since_s = -1e9;
  double value = 0.0;
  return [=](double t_s) mutable {
    if (t_s - since_s >= period_s) {
      since_s = t_s;
      value = signal(t_s);
    }
    return value;
  };
}

/// A town: turns of up to 25 deg/s, and between them straight roads and halts of minutes.
double town(double t_s) {
  const double u = std::fmod(t_s, 400.0);
  if (u < 200.0) return 25.0 * std::pow(std::sin(u * std::numbers::pi / 40.0), 5.0);
  return u < 300.0 ? 0.3 * std::sin(u) * std::sin(u / 7.0) * (300.0 - u) / 100.0 : 0.0;
}
double rest(double /*t_s*/) {
  return 0.0;
}

struct Two {
  explicit Two(const SensorLimits& a = {}, const SensorLimits& b = {})
      : watches{SensorWatch(a), SensorWatch(b)} {}

  void run(const Signal& a, const Signal& b, double from_s, double to_s, double rate_hz = 100.0) {
    const auto end = static_cast<std::int64_t>(std::llround((to_s - from_s) * rate_hz));
    for (std::int64_t i = 0; i < end; ++i) {
      const double t_s = from_s + static_cast<double>(i) / rate_hz;
      step(0, t_s, a(t_s));
      step(1, t_s + 0.3 / rate_hz, b(t_s + 0.3 / rate_hz));
    }
  }
  void step(std::size_t gyro, double t_s, double rate_dps) {
    const Finding finding =
        watches[gyro].judge(kStart + from_seconds(t_s), rate_dps, &watches[1 - gyro]);
    if (finding == Finding::kSound) return;
    ++count[gyro][static_cast<std::size_t>(finding)];
    if (!first_s[gyro]) first_s[gyro] = t_s;
    last_s[gyro] = t_s;
  }
  [[nodiscard]] std::uint64_t of(std::size_t gyro, Finding finding) const {
    return count[gyro][static_cast<std::size_t>(finding)];
  }
  [[nodiscard]] bool all_sound(std::size_t gyro) const { return !first_s[gyro]; }

  std::array<SensorWatch, 2> watches;
  std::array<std::array<std::uint64_t, 5>, 2> count{};
  std::array<std::optional<double>, 2> first_s;
  std::array<double, 2> last_s{};
};

// --- healthy sensors -----------------------------------------------------------------------------

// A car's yaw rate has steps of a quarter of a degree per second and stands at 0 through every
// halt; beside it any other gyro. Hours of town: not one finding.
TEST(SensorWatchHealthy, CoarseSensorOfACarMayStandAtZeroForMinutes) {
  for (const double noise_dps : {0.0, 0.03, 0.1, 0.3}) {
    for (const double rate_hz : {10.0, 83.0, 100.0}) {
      Random random(4);
      Two two;
      two.run(rounded(noisy(town, noise_dps, random), kCarStep_dps), noisy(town, 0.2, random), 0.0,
              7200.0, rate_hz);
      EXPECT_TRUE(two.all_sound(0)) << noise_dps << " deg/s, " << rate_hz
                                    << " Hz, seed 4, first at " << two.first_s[0].value_or(0.0);
      EXPECT_TRUE(two.all_sound(1)) << noise_dps << " deg/s, " << rate_hz << " Hz, seed 4";
    }
  }
}

// The engine shakes the sensor in the drive, and is switched off when the car parks.
TEST(SensorWatchHealthy, CoarseSensorMayFallQuietWhenTheEngineStops) {
  for (const double shaken_dps : {0.1, 0.2, 0.4}) {
    Random random(5);
    Two two;
    two.run(rounded(noisy(town, shaken_dps, random), kCarStep_dps), noisy(town, 0.2, random), 0.0,
            1200.0);
    two.run(rounded(rest, kCarStep_dps), noisy(rest, 0.05, random), 1200.0, 3000.0);
    EXPECT_TRUE(two.all_sound(0)) << shaken_dps << " deg/s, seed 5";
  }
}

// Fine sensors of all kinds: good and bad noise, fast and slow, filtered, values held by a source
// that is slower than the bus, 16 bits over a wide range.
TEST(SensorWatchHealthy, FineSensorsAreBelieved) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Random random(seed);
    const double sigma_dps = std::pow(10.0, random.uniform(-3.0, 0.0));
    const double step_dps = sigma_dps * std::pow(10.0, random.uniform(-3.0, 0.7));
    const double rate_hz = random.uniform(20.0, 500.0);
    const double hold_s = seed % 3 == 0 ? random.uniform(1.0, 20.0) / rate_hz : 0.0;
    Two two;
    const Signal a = rounded(noisy(town, sigma_dps, random), step_dps);
    two.run(hold_s > 0.0 ? held(a, hold_s) : a, noisy(town, 0.1, random), 0.0, 300'000.0 / rate_hz,
            rate_hz);
    EXPECT_TRUE(two.all_sound(0)) << "seed " << seed << ": sigma " << sigma_dps << ", step "
                                  << step_dps << ", " << rate_hz << " Hz, held " << hold_s << " s";
  }
}

// No noise at all, as in some simulations: rest is exactly constant.
TEST(SensorWatchHealthy, NoiselessSensorsMayRest) {
  Two two;
  two.run(rounded(town, 1e-6), rounded(town, 1e-6), 0.0, 2000.0);
  EXPECT_TRUE(two.all_sound(0)) << two.first_s[0].value_or(0.0);
  EXPECT_TRUE(two.all_sound(1));
}

// A parked car warms up: the other gyro's drift is not motion, nor is a slammed door, nor an engine
// that starts to shake.
TEST(SensorWatchHealthy, DriftAndVibrationOfTheOtherAreNoMotion) {
  Random random(6);
  const auto other = [&](double t_s) {
    const double door = std::abs(t_s - 100.0) < 0.5 ? 8.0 * std::sin(60.0 * t_s) : 0.0;
    const double engine = t_s > 300.0 ? 2.0 * std::sin(2.0 * std::numbers::pi * 27.3 * t_s) : 0.0;
    return 2.0 * (1.0 - std::exp(-t_s / 120.0)) + door + engine + random.normal(0.05);
  };
  Two two;
  two.run(rounded(rest, kCarStep_dps), other, 0.0, 600.0);
  EXPECT_TRUE(two.all_sound(0)) << two.first_s[0].value_or(0.0);
}

// A filter delays one gyro: it moves a little later than the other.
TEST(SensorWatchHealthy, LateSensorIsNotStuck) {
  Random random(7);
  Two two;
  const auto late = [](double t_s) { return town(t_s - 0.2); };
  two.run(rounded(late, kCarStep_dps), noisy(town, 0.05, random), 0.0, 2000.0);
  EXPECT_TRUE(two.all_sound(0)) << two.first_s[0].value_or(0.0);
}

// --- its step ------------------------------------------------------------------------------------

double step_after(const SensorLimits& limits, const Signal& signal, double to_s) {
  SensorWatch watch(limits);
  for (int i = 0; i < static_cast<int>(to_s * 100.0); ++i)
    watch.judge(kStart + std::chrono::milliseconds(10 * i), signal(0.01 * i), nullptr);
  return watch.step_dps();
}

TEST(SensorWatchStep, IsHalfADegreeOrTheFramesUntilTwoValuesDiffer) {
  const Signal dead = [](double) { return 0.0; };
  EXPECT_EQ(step_after({}, dead, 600.0), 0.5);
  EXPECT_NEAR(step_after({.lattice_dps = 1e-3}, dead, 600.0), 0.5, 1e-12);
  EXPECT_EQ(step_after({.lattice_dps = 2.0}, dead, 600.0), 2.0);
  SensorWatch watch({});
  watch.judge(kStart, 0.0, nullptr);
  watch.judge(kStart + std::chrono::seconds(1), 0.0, nullptr);
  EXPECT_FALSE(watch.ever_changed());
  // One leap does not give the step.
  watch.judge(kStart + std::chrono::seconds(2), 24.0, nullptr);
  EXPECT_TRUE(watch.ever_changed());
  EXPECT_EQ(watch.step_dps(), 0.5);
}

// The step is the sensor's lattice, even if the frame could carry finer steps, at rest as well as
// after hours of driving.
TEST(SensorWatchStep, IsTheLatticeOfACoarseSensor) {
  for (const double noise_dps : {0.0, 0.1, 0.3}) {
    for (const double lattice_dps : {0.0, 1e-3}) {
      Random random(21);
      const Signal coarse = rounded(noisy(town, noise_dps, random), kCarStep_dps);
      EXPECT_NEAR(step_after({.lattice_dps = lattice_dps}, coarse, 3900.0), kCarStep_dps, 1e-12)
          << noise_dps << " deg/s, frame " << lattice_dps << " deg/s, seed 21";
    }
  }
  // The frame's own step is the sensor's: exactly, although the difference of two values is
  // rounded.
  Random random(22);
  const Signal coarse = rounded(noisy(town, 0.3, random), 0.1);
  EXPECT_EQ(step_after({.lattice_dps = 0.1}, coarse, 600.0), 0.1);
}

TEST(SensorWatchStep, IsSmallInAFineSensorAndForgetsWhatIsLongPast) {
  Random random(23);
  EXPECT_LT(step_after({}, noisy(town, 0.05, random), 100.0), 1e-3);
  EXPECT_NEAR(step_after({}, rounded(noisy(town, 0.05, random), 1e-3), 100.0), 1e-3, 1e-12);
  // The sensor was fine, and its own filter makes it coarse from now on.
  const Signal fine = noisy(town, 0.3, random);
  const Signal coarse = rounded(noisy(town, 0.3, random), kCarStep_dps);
  const Signal both = [&](double t_s) { return t_s < 100.0 ? fine(t_s) : coarse(t_s); };
  EXPECT_NEAR(step_after({}, both, 300.0), kCarStep_dps, 1e-12);
}

// A float that is computed in two ways differs in its last digits.
TEST(SensorWatchStep, IsNotTheRoundingOfFloats) {
  Random random(24);
  const Signal coarse = rounded(noisy(town, 0.3, random), kCarStep_dps);
  const Signal shaken = [&](double t_s) {
    return coarse(t_s) * (1.0 + random.uniform(0.0, 1e-14));
  };
  EXPECT_NEAR(step_after({}, shaken, 600.0), kCarStep_dps, 1e-9);
}

// --- stuck ---------------------------------------------------------------------------------------

// With noise far above the steps, a value that repeats for a quarter of a second is not chance, at
// rest or in motion, whatever the other gyro does.
TEST(SensorWatchStuck, FineSensorIsFoundWithinASecondAtRestAndInMotion) {
  for (const bool moving : {false, true}) {
    for (const double rate_hz : {50.0, 100.0, 500.0}) {
      Random random(8);
      const Signal truth = moving ? Signal(town) : Signal(rest);
      Two two;
      two.run(frozen(rounded(noisy(truth, 0.02, random), 1e-3), 1e9, 0.0),
              noisy(truth, 0.02, random), 0.0, 120.0, rate_hz);
      ASSERT_TRUE(two.all_sound(0));
      const double value = rounded(truth, 1e-3)(120.0) + 0.004;
      two.run([&](double) { return value; }, noisy(truth, 0.02, random), 120.0, 125.0, rate_hz);
      ASSERT_TRUE(two.first_s[0]) << rate_hz;
      EXPECT_LE(*two.first_s[0] - 120.0, 10.0 * 8.0 / rate_hz + 0.3) << rate_hz << " Hz, seed 8";
      EXPECT_GT(two.of(0, Finding::kStuck), 0U);
      EXPECT_TRUE(two.all_sound(1));
      // The first different value ends the finding; the caller decides how long to wait after it.
      const std::uint64_t before = two.of(0, Finding::kStuck);
      two.run(rounded(noisy(truth, 0.02, random), 1e-3), noisy(truth, 0.02, random), 125.0, 130.0,
              rate_hz);
      EXPECT_LE(two.of(0, Finding::kStuck), before + 1);
    }
  }
}

// A coarse sensor that stands still is accepted at rest, and found when the other one turns.
TEST(SensorWatchStuck, CoarseSensorIsFoundWhenTheOtherMoves) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const double turn_at_s = 300.0 + random.uniform(0.0, 3.0);
    const double top_dps = random.uniform(3.0, 40.0);
    const auto truth = [=](double t_s) {
      return t_s < 60.0        ? town(t_s)
             : t_s < turn_at_s ? 0.0
                               : top_dps * (1.0 - std::exp(turn_at_s - t_s));
    };
    Two two;
    two.run(rounded(noisy(frozen(truth, 100.0, 1e9), 0.02, random), kCarStep_dps),
            noisy(truth, 0.2, random), 0.0, turn_at_s);
    EXPECT_TRUE(two.all_sound(0)) << "seed " << seed;
    two.run(rounded(frozen(truth, 100.0, 1e9), kCarStep_dps), noisy(truth, 0.2, random), turn_at_s,
            turn_at_s + 6.0);
    ASSERT_TRUE(two.first_s[0]) << "seed " << seed << ", " << top_dps << " deg/s";
    EXPECT_LE(*two.first_s[0] - turn_at_s, 3.0) << "seed " << seed << ", " << top_dps << " deg/s";
    EXPECT_TRUE(two.all_sound(1));
  }
}

// Without a healthy other gyro there is no such evidence.
TEST(SensorWatchStuck, CoarseSensorIsBelievedWithoutTheOther) {
  SensorWatch watch({});
  for (int i = 0; i < 100'000; ++i)
    ASSERT_EQ(watch.judge(kStart + std::chrono::milliseconds(10 * i), 0.0, nullptr),
              Finding::kSound);
}

// The same value before and after a pause is no evidence of standing still.
TEST(SensorWatchStuck, PauseIsNoStandstill) {
  Random random(9);
  Two two;
  two.run(rounded(noisy(rest, 0.02, random), 1e-3), noisy(rest, 0.02, random), 0.0, 60.0);
  for (int i = 0; i < 200; ++i)
    two.step(0, 60.0 + 1.5 * i, 0.005);
  EXPECT_TRUE(two.all_sound(0));
}

// The sensor freezes, or sends 0, while the platform turns: a handful of values that its own noise
// makes impossible are enough. The other gyro is accepted throughout.
TEST(SensorWatchStuck, FineSensorIsHeldAsideAfterAHandfulOfEqualValuesInATurn) {
  for (const double step_dps : {1e-4, 1e-3, 5e-3}) {
    for (const bool to_zero : {false, true}) {
      for (const double rate_hz : {50.0, 100.0, 500.0}) {
        SCOPED_TRACE(::testing::Message() << "step " << step_dps << " deg/s, to zero " << to_zero
                                          << ", " << rate_hz << " Hz, seed 40");
        Random random(40);
        const auto turn = [](double t_s) { return 10.0 * std::sin(0.3 * t_s); };
        const Signal well = rounded(noisy(turn, 0.02, random), step_dps);
        const Signal other = noisy(turn, 0.05, random);
        Two two;
        two.run(well, other, 0.0, 125.0, rate_hz);
        ASSERT_TRUE(two.all_sound(0)) << *two.first_s[0];
        const double value = to_zero ? 0.0 : well(125.0);
        two.run([&](double) { return value; }, other, 125.0, 125.2, rate_hz);
        ASSERT_TRUE(two.first_s[0]);
        const int most = step_dps < 5e-3 ? 5 : 9;
        EXPECT_LE(*two.first_s[0] - 125.0, (most - 0.5) / rate_hz);
        EXPECT_GT(two.of(0, Finding::kStanding), 0U);
        EXPECT_EQ(two.of(0, Finding::kStuck), 0U) << "that takes longer";
        two.run([&](double) { return value; }, other, 125.2, 126.0, rate_hz);
        EXPECT_GT(two.of(0, Finding::kStuck), 0U);
        EXPECT_TRUE(two.all_sound(1));
        const double before_s = two.last_s[0];
        two.run(well, other, 126.0, 140.0, rate_hz);
        EXPECT_EQ(two.last_s[0], before_s) << "the first other value is the end of it";
      }
    }
  }
}

// A coarse sensor may repeat its value in a turn, but not leap to another one and stay there while
// the other gyro continues.
TEST(SensorWatchStuck, CoarseSensorThatLeapsToAConstantInASteadyTurnIsFound) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const double at_s = 330.0 + random.uniform(0.0, 3.0);
    const double rate_dps = random.uniform(4.0, 30.0);
    const auto turn = [=](double t_s) {
      return t_s < 300.0 ? town(t_s) : rate_dps * std::min(1.0, (t_s - 300.0) / 5.0);
    };
    const Signal well = rounded(noisy(turn, 0.1, random), kCarStep_dps);
    const Signal other = noisy(turn, 0.1, random);
    Two two;
    two.run(well, other, 0.0, at_s);
    ASSERT_TRUE(two.all_sound(0)) << "seed " << seed;
    two.run([](double) { return 0.0; }, other, at_s, at_s + 2.0);
    ASSERT_TRUE(two.first_s[0]) << "seed " << seed << ", " << rate_dps << " deg/s";
    EXPECT_LE(*two.first_s[0] - at_s, 0.6) << "seed " << seed << ", " << rate_dps << " deg/s";
    EXPECT_TRUE(two.all_sound(1)) << "seed " << seed;
  }
}

// --- dead from the start -------------------------------------------------------------------------

// A sensor that has sent one value since power-on may be dead. It is set aside as soon as the other
// one plainly moves.
TEST(SensorWatchDead, SensorThatHasNeverChangedIsSetAsideInTheFirstTenthsOfATurn) {
  for (const double value : {0.0, 0.7, -150.0}) {
    for (const double acceleration_dps_s : {3.0, 25.0, 200.0}) {
      for (const double rate_hz : {50.0, 100.0, 500.0}) {
        SCOPED_TRACE(::testing::Message() << value << " deg/s, " << acceleration_dps_s
                                          << " deg/s2, " << rate_hz << " Hz, seed 41");
        Random random(41);
        const auto turn = [=](double t_s) {
          return std::min(30.0, acceleration_dps_s * std::max(t_s - 60.03, 0.0));
        };
        Two two;
        const Signal dead = [=](double) { return value; };
        two.run(dead, noisy(turn, 0.05, random), 0.0, 60.0, rate_hz);
        ASSERT_TRUE(two.all_sound(0)) << "it may take part in a rest";
        two.run(dead, noisy(turn, 0.05, random), 60.0, 70.0, rate_hz);
        ASSERT_TRUE(two.first_s[0]);
        EXPECT_LE(*two.first_s[0] - 60.03, 0.3 + 2.5 / acceleration_dps_s);
        EXPECT_TRUE(two.all_sound(1));
      }
    }
  }
}

// It begins to send other values, and is accepted only once they agree with the other gyro's.
TEST(SensorWatchDead, SensorThatWasDeadIsBelievedWhenItMovesWithTheOther) {
  Random random(42);
  const auto drive = [](double t_s) {
    return t_s < 60.0 || t_s > 90.0 ? 0.0 : 20.0 * std::sin(t_s - 60.0);
  };
  const Signal other = noisy(drive, 0.05, random);
  const Signal dead = [](double) { return 0.0; };
  Two two;
  two.run(dead, other, 0.0, 70.0);
  ASSERT_TRUE(two.first_s[0]);
  two.run(noisy(rest, 0.05, random), other, 70.0, 150.0);
  EXPECT_NEAR(two.last_s[0], 149.99, 0.011) << "noise, while the other one turned, and then rest";
  const auto again = [](double t_s) { return t_s < 160.0 ? 0.0 : 20.0 * std::sin(t_s - 160.0); };
  two.run(noisy(again, 0.05, random), noisy(again, 0.05, random), 150.0, 200.0);
  EXPECT_GT(two.last_s[0], 160.0);
  EXPECT_LT(two.last_s[0], 163.0);
  EXPECT_TRUE(two.all_sound(1));
}

// A healthy coarse sensor sends 0 until it moves, and is not dead.
TEST(SensorWatchDead, CoarseSensorThatRestedFromTheStartIsNotDead) {
  for (const double lag_s : {0.0, 0.1}) {
    for (std::uint64_t seed = 0; seed < 30; ++seed) {
      Random random(seed);
      const double acceleration_dps_s = std::pow(10.0, random.uniform(0.0, 2.0));
      const double from_s = 300.0 + random.uniform(0.0, 1.0);
      const auto drive = [=](double t_s) {
        return t_s < from_s ? 0.0
                            : 20.0 * (1.0 - std::cos(acceleration_dps_s / 20.0 * (t_s - from_s)));
      };
      const auto late = [=](double t_s) { return drive(t_s - lag_s); };
      Two two;
      two.run(rounded(late, kCarStep_dps), noisy(drive, 0.05, random), 0.0, 400.0);
      EXPECT_TRUE(two.all_sound(0))
          << "seed " << seed << ", " << acceleration_dps_s << " deg/s2, lag " << lag_s
          << " s, first at " << two.first_s[0].value_or(0.0) - from_s;
    }
  }
}

// --- time of day ---------------------------------------------------------------------------------

/// Every finding, one after the other.
std::string findings_from(TimePoint start) {
  Random random(43);
  const Signal coarse = rounded(noisy(town, 0.1, random), kCarStep_dps);
  const Signal fine = rounded(noisy(town, 0.02, random), 1e-3);
  const Signal a = [&](double t_s) { return t_s > 100.0 && t_s < 130.0 ? 0.0 : coarse(t_s); };
  const Signal b = [&](double t_s) { return t_s > 150.0 && t_s < 150.3 ? 1.0 : fine(t_s); };
  std::array<SensorWatch, 2> watches{SensorWatch({}), SensorWatch({})};
  std::string findings;
  for (int i = 0; i < 40'000; ++i) {
    const double t_s = 0.01 * i;
    const TimePoint t = start + i * std::chrono::milliseconds(10);
    const TimePoint t_b = t + std::chrono::milliseconds(3);
    findings += static_cast<char>('0' + static_cast<int>(watches[0].judge(t, a(t_s), &watches[1])));
    findings +=
        static_cast<char>('0' + static_cast<int>(watches[1].judge(t_b, b(t_s), &watches[0])));
  }
  return findings;
}

TEST(SensorWatchTime, DoesNotDependOnWhatTimeItIs) {
  const std::string findings = findings_from(kStart);
  EXPECT_NE(findings.find_first_not_of('0'), std::string::npos);
  for (const Duration by : {Duration(37'000'000), Duration(12'345'678'000'000),
                            Duration(-1'700'000'000'000'000'000), Duration(250'000'000)})
    EXPECT_EQ(findings_from(kStart + by), findings) << to_seconds(by);
}

// --- saturated -----------------------------------------------------------------------------------

// The end of the range, both ways, at once and only there; also when its last step is not reached.
TEST(SensorWatchSaturated, EndsOfTheRangeAreFoundAtOnce) {
  SensorWatch watch({.lowest_dps = -100.0, .highest_dps = 250.0});
  TimePoint t = kStart;
  const auto judged = [&](double rate_dps) {
    t += std::chrono::milliseconds(10);
    return watch.judge(t, rate_dps, nullptr);
  };
  EXPECT_EQ(judged(249.0), Finding::kSound);
  EXPECT_EQ(judged(249.9), Finding::kSaturated);
  EXPECT_EQ(judged(250.0), Finding::kSaturated);
  EXPECT_EQ(judged(240.0), Finding::kSound);
  EXPECT_EQ(judged(-99.0), Finding::kSound);
  EXPECT_EQ(judged(-100.0), Finding::kSaturated);
}

// A magnitude that begins at 0 is not saturated at rest.
TEST(SensorWatchSaturated, ZeroIsNoEndOfARange) {
  SensorWatch watch({.lowest_dps = 0.0, .highest_dps = 250.0});
  for (int i = 0; i < 1000; ++i)
    ASSERT_EQ(watch.judge(kStart + std::chrono::milliseconds(10 * i), 0.0, nullptr),
              Finding::kSound);
}

// The clipping level is not given: eight equal values at the top show it, and the next time a
// single one is enough.
TEST(SensorWatchSaturated, ClipIsFoundFromARunAtTheTop) {
  Random random(10);
  Two two;
  const auto spin = [](double t_s) {
    return t_s < 60.0 ? 2.0 * std::sin(t_s) : 400.0 * std::sin(0.5 * (t_s - 60.0));
  };
  const Signal a = clipped(rounded(noisy(spin, 0.1, random), 1e-3), 300.0);
  const Signal b = noisy(spin, 0.1, random);
  two.run(a, b, 0.0, 60.0);
  ASSERT_TRUE(two.all_sound(0));
  const double clip_s = 60.0 + 2.0 * std::asin(0.75);  // from here on the truth is beyond it
  two.run(a, b, 60.0, clip_s);
  ASSERT_TRUE(two.all_sound(0));
  two.run(a, b, clip_s, clip_s + 0.2);
  EXPECT_NEAR(*two.first_s[0], clip_s, 0.1);
  two.run(a, b, clip_s + 0.2, 60.0 + 4.0 * std::numbers::pi);
  // Half a turn later it clips the other way: found with the first sample.
  const double other_way_s = clip_s + 2.0 * std::numbers::pi;
  EXPECT_NEAR(static_cast<double>(two.of(0, Finding::kSaturated)),
              100.0 * 2.0 * 2.0 * (std::numbers::pi - 2.0 * std::asin(0.75)), 30.0);
  EXPECT_GT(two.last_s[0], other_way_s);
  EXPECT_EQ(two.of(0, Finding::kStuck), 0U);
}

// The sensor was stuck once at its fastest value; a faster one later shows that it did not clip
// there.
TEST(SensorWatchSaturated, ClipIsForgottenWhenTheSensorExceedsIt) {
  Random random(11);
  Two two;
  const Signal quiet = noisy(rest, 0.1, random);
  two.run(quiet, quiet, 0.0, 60.0);
  two.run([](double) { return 20.0; }, quiet, 60.0, 61.0);
  EXPECT_GT(two.of(0, Finding::kSaturated), 80U);
  const std::uint64_t before = two.of(0, Finding::kSaturated);
  two.run(noisy([](double) { return 40.0; }, 0.1, random), quiet, 61.0, 100.0);
  two.run(noisy([](double) { return 20.0; }, 0.1, random), quiet, 100.0, 200.0);
  EXPECT_EQ(two.of(0, Finding::kSaturated), before);
}

// --- dead band -----------------------------------------------------------------------------------

// An exact 0 means "less than the dead band", and is no standstill while the other gyro stays
// within the band.
TEST(SensorWatchDeadBand, ZeroTellsNothingAndIsNotStuck) {
  Random random(12);
  const auto creep = [](double t_s) { return t_s < 60.0 ? town(t_s) : 0.9 * std::sin(0.3 * t_s); };
  const auto banded = [&](double t_s) { return std::abs(creep(t_s)) < 1.0 ? 0.0 : creep(t_s); };
  Two two({.dead_band_dps = 1.0});
  two.run(banded, noisy(creep, 0.02, random), 0.0, 600.0);
  EXPECT_EQ(two.of(0, Finding::kStuck), 0U);
  EXPECT_GT(two.of(0, Finding::kBlind), 54'000U);
}

}  // namespace
}  // namespace vgyro::fusion
