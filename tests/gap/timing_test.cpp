#include "gap/timing.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "gap/spikes.h"
#include "made_faults.h"

namespace vgyro::gap {
namespace {

using model::Kind;

// Two gyros of white noise, each with a delay and a clock of its own, and a reference.
struct World {
  double seconds = 300.0;
  std::array<double, 2> delay_s{};
  std::array<double, 2> skew{};
  std::array<double, 2> scale{1.0, 1.0};
  double reference_late_s = 0.0;
  double reference_interval_s = 0.01;
  double reference_noise_dps = 0.0;
  double quickness = 1.0;
  std::uint64_t seed = 1;
};

double rate_dps(const World& world, double t_s) {
  const double x = world.quickness * (t_s - 10.0);
  if (x <= 0.0) return 0.0;
  const double rise = 1.0 - std::exp(-x * x);
  return rise * (30.0 * std::sin(0.7 * x + 2.0 * std::sin(0.031 * x)) +
                 12.0 * std::sin(2.3 * x + 3.0 * std::sin(0.047 * x)) +
                 4.0 * std::sin(6.1 * x + 2.0 * std::sin(0.11 * x)));
}

Recording make(const World& world, bool with_reference) {
  Recording recording;
  recording.seconds = world.seconds;
  recording.rest_s = 10.0;
  recording.has_reference = with_reference;
  std::mt19937_64 random(world.seed);
  std::normal_distribution<double> normal;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    GyroSeries& series = recording.gyros[gyro];
    series.name = gyro == 0 ? "a" : "b";
    for (double true_s = 0.0037 * static_cast<double>(gyro); true_s < world.seconds;
         true_s += 0.01) {
      series.t_s.push_back(true_s * (1.0 + world.skew[gyro]));
      series.rate_dps.push_back(world.scale[gyro] * rate_dps(world, true_s - world.delay_s[gyro]) +
                                0.03 * normal(random));
    }
  }
  if (!with_reference) return recording;
  for (double t_s = 0.0; t_s < world.seconds; t_s += world.reference_interval_s) {
    recording.reference_dps.t_s.push_back(t_s);
    recording.reference_dps.value.push_back(rate_dps(world, t_s - world.reference_late_s) +
                                            world.reference_noise_dps * normal(random));
  }
  return recording;
}

Timing timing_in(const Recording& recording, const std::vector<model::Effect>& known = {}) {
  return find_timing(recording, check_both(recording), known);
}

TEST(Timing, NothingIsSaidWhereNothingIsLate) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    World world;
    world.seed = seed;
    for (const bool with_reference : {true, false}) {
      const Timing timing = timing_in(make(world, with_reference));
      EXPECT_TRUE(timing.findings.empty());
      EXPECT_TRUE(timing.notes.empty());
      EXPECT_EQ(timing.reference_late_s, 0.0);
      for (const Lag& lag : timing.lag) {
        EXPECT_EQ(lag.drift, 0.0);
        EXPECT_NEAR(lag.start_s, 0.0, 2e-4);
      }
    }
  }
}

TEST(Timing, EachGyrosLagIsFound) {
  World world;
  world.delay_s = {0.0087, 0.0};
  world.scale = {1.02, 0.97};
  const Timing beside = timing_in(make(world, false));
  EXPECT_NEAR(beside.lag[0].start_s, 0.0087, 2e-4);
  EXPECT_NEAR(beside.lag[1].start_s, -0.0087, 2e-4);
  const Timing against = timing_in(make(world, true));
  EXPECT_NEAR(against.lag[0].start_s, 0.0087, 2e-4);
  EXPECT_NEAR(against.lag[1].start_s, 0.0, 2e-4);
}

// Up to a hundredth: by the end it is three seconds off.
TEST(Timing, AClockThatRunsAwayIsFound) {
  for (const double skew : {-0.01, -0.0023, 0.0023, 0.01}) {
    World world;
    world.skew = {0.0, skew};
    world.delay_s = {0.0, 0.004};
    const Timing timing = timing_in(make(world, true));
    ASSERT_EQ(timing.findings.size(), 1U) << skew;
    const Finding& found = timing.findings[0];
    EXPECT_EQ(found.effect.kind, Kind::kClockSkew);
    EXPECT_EQ(found.effect.gyro, 1U);
    EXPECT_NEAR(found.effect.parameters[0], 1e6 * skew, 5.0 * found.sigma[0] + 0.3) << skew;
    EXPECT_LT(found.sigma[0], 2.0);
    EXPECT_EQ(timing.reference_late_s, 0.0);
  }
}

TEST(Timing, AClockThatTheModelKnowsIsNotFoundAgain) {
  World world;
  world.skew = {0.0, -0.0023};
  EXPECT_TRUE(timing_in(make(world, true), {{1, Kind::kClockSkew, {-2300.0}, 0}}).findings.empty());
}

TEST(Timing, TheReferencesLatenessIsToldInMilliseconds) {
  EXPECT_EQ(reference_late_text(0.10014),
            "both gyros lead the reference by 0.100 s: the reference is late");
}

// A slow and noisy reference that is late: what both gyros show alike is its own.
TEST(Timing, AReferenceThatBothGyrosLeadIsLate) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    World world;
    world.seed = seed;
    world.reference_late_s = 0.1;
    world.reference_interval_s = 0.1;
    world.reference_noise_dps = 0.16;
    world.quickness = 0.3;
    world.scale = {1.02, 1.0};
    const Timing timing = timing_in(make(world, true));
    EXPECT_NEAR(timing.reference_late_s, 0.1, 2e-3) << "seed " << seed;
    ASSERT_EQ(timing.notes.size(), 1U);
    EXPECT_EQ(timing.notes[0].find(reference_late_text(timing.reference_late_s)), 0U);
    for (const Lag& lag : timing.lag)
      EXPECT_NEAR(lag.start_s, 0.0, 2e-3) << "seed " << seed;
  }
}

TEST(Timing, TheGyroThatLeadsTheLateReferenceByLessIsLateItself) {
  World world;
  world.reference_late_s = 0.1;
  world.delay_s = {0.04, 0.0};
  const Timing timing = timing_in(make(world, true));
  EXPECT_NEAR(timing.reference_late_s, 0.1, 5e-4);
  EXPECT_NEAR(timing.lag[0].start_s, 0.04, 5e-4);
}

TEST(Timing, TwoGyrosThatAreBothLateAccuseNoReference) {
  World world;
  world.delay_s = {0.03, 0.03};
  const Timing timing = timing_in(make(world, true));
  EXPECT_EQ(timing.reference_late_s, 0.0);
  EXPECT_NEAR(timing.lag[0].start_s, 0.03, 2e-4);
}

// At rest nobody knows when.
TEST(Timing, NothingIsKnownWithoutMotion) {
  const Timing timing = timing_in(turned(Making{.seconds = 120.0}, [](double) { return 0.0; }));
  EXPECT_EQ(timing.lag[0].start_s, 0.0);
  EXPECT_TRUE(timing.findings.empty());
}

// A late gyro in knocks of 3000 deg/s²: what it reads too late is no spike.
TEST(LateSpikes, AreNoneInALateGyroThatTurnsQuickly) {
  World world;
  world.delay_s = {0.0087, 0.0};
  world.quickness = 4.0;
  for (const bool with_reference : {false, true}) {
    const Recording recording = make(world, with_reference);
    std::array<Transport, 2> transports = check_both(recording);
    const Timing timing = timing_of(recording, transports);
    EXPECT_TRUE(find_spikes(recording, timing, transports, {}).empty()) << with_reference;
  }
}

}  // namespace
}  // namespace vgyro::gap
