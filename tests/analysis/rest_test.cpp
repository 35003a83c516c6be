#include "analysis/rest.h"

#include <cmath>
#include <functional>
#include <random>
#include <string>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

// Two gyros with white noise, drifts of their own, and one motion.
struct World {
  double seconds = 300.0;
  double interval_s = 0.01;
  std::array<double, 2> white_dps_rthz{5e-3, 3e-3};
  double correlation = 0.0;  ///< of the white noises
  std::array<double, 2> bias_dps{0.3, -0.8};
  std::function<double(std::size_t gyro, double t_s)> drift_dps = [](std::size_t, double) {
    return 0.0;
  };
  std::function<double(double t_s)> rate_dps = [](double) { return 0.0; };
  std::uint64_t seed = 1;
};

std::vector<RestPart> rests_of(const World& world) {
  RestFinder finder({.interval_s = world.interval_s});
  std::mt19937_64 random(world.seed);
  std::normal_distribution<double> normal;
  const auto count = static_cast<std::size_t>(world.seconds / world.interval_s);
  for (std::size_t i = 0; i < count; ++i) {
    const double t_s = static_cast<double>(i) * world.interval_s;
    const double both = normal(random);
    std::array<double, 2> y{};
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const double noise =
          std::sqrt(world.correlation) * both + std::sqrt(1.0 - world.correlation) * normal(random);
      y[gyro] = world.rate_dps(t_s) + world.bias_dps[gyro] + world.drift_dps(gyro, t_s) +
                world.white_dps_rthz[gyro] / std::sqrt(world.interval_s) * noise;
    }
    finder.add(t_s, y);
  }
  return finder.find();
}

// "0-59 121-300"
std::string spans(const std::vector<RestPart>& parts) {
  std::string text;
  for (const RestPart& part : parts) {
    text += (text.empty() ? "" : " ") + std::to_string(std::lround(part.stretch.from_s)) + "-" +
            std::to_string(std::lround(part.stretch.to_s));
  }
  return text;
}

double seconds_at_rest(const std::vector<RestPart>& parts) {
  double sum_s = 0.0;
  for (const RestPart& part : parts)
    sum_s += part.stretch.seconds();
  return sum_s;
}

// Rest from 0 to 40 s of each minute, then turns.
double stop_and_go(double t_s) {
  const double x = std::fmod(t_s, 60.0) - 40.0;
  return x <= 0.0 ? 0.0 : 25.0 * std::sin(M_PI * x / 20.0) * std::sin(2.0 * M_PI * 0.3 * x);
}

// Hovers: two sines that share no period, 1.6 deg/s rms.
double hover(double t_s) {
  return 1.8 * std::sin(2.0 * M_PI * 0.13 * t_s) + 1.4 * std::sin(2.0 * M_PI * 0.71 * t_s + 1.0);
}

TEST(RestFinder, FindsTheWholeRecordingWhereNothingMoves) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    World world;
    world.seed = seed;
    EXPECT_EQ(spans(rests_of(world)), "0-300") << "seed " << seed;
  }
}

TEST(RestFinder, FindsEachStopWithoutItsEdges) {
  World world;
  world.rate_dps = stop_and_go;
  EXPECT_EQ(spans(rests_of(world)), "0-39 61-99 121-159 181-219 241-279");
}

// Common noise, as from a shared supply, is not motion.
TEST(RestFinder, IsNotMisledByNoiseInCommon) {
  World world;
  world.correlation = 0.6;
  world.white_dps_rthz = {5e-3, 5e-3};
  EXPECT_EQ(spans(rests_of(world)), "0-300");
}

// 5e-4 deg/s² on one gyro: after ten minutes it reads 0.3 deg/s more at rest, twice the deviation
// allowed within a single rest.
TEST(RestFinder, FindsRestAgainThatDriftHasMoved) {
  World world;
  world.seconds = 1800.0;
  world.rate_dps = stop_and_go;
  world.drift_dps = [](std::size_t gyro, double t_s) { return gyro == 1 ? 5e-4 * t_s : 0.0; };
  const std::vector<RestPart> parts = rests_of(world);
  EXPECT_EQ(parts.size(), 30U);
  EXPECT_GT(parts.back().stretch.from_s, 1735.0);
  EXPECT_NEAR(seconds_at_rest(parts), 30.0 * 38.0, 10.0);
}

TEST(RestFinder, FindsRestAgainBehindAStepOfOneGyrosBias) {
  World world;
  world.rate_dps = stop_and_go;
  world.drift_dps = [](std::size_t gyro, double t_s) {
    return gyro == 0 && t_s > 110.0 ? 0.6 : 0.0;
  };
  EXPECT_GT(seconds_at_rest(rests_of(world)), 4.0 * 36.0);
}

// Not even in its quietest seconds.
TEST(RestFinder, FindsNoneInAHover) {
  for (const double white : {5e-3, 0.055}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      World world;
      world.white_dps_rthz = {white, white};
      world.rate_dps = hover;
      world.seed = seed;
      EXPECT_EQ(spans(rests_of(world)), "") << white << ", seed " << seed;
    }
  }
}

// The first quarter of a turn is gentle: none of it is rest, at any noise below the motion.
TEST(RestFinder, LeavesOutTheGentleBeginningOfAMotion) {
  for (const double white : {5e-4, 5e-3}) {
    World world;
    world.white_dps_rthz = {white, white};
    world.rate_dps = [](double t_s) {
      const double x = t_s - 200.0;
      return x <= 0.0 ? 0.0 : 0.05 * x;
    };
    const std::vector<RestPart> parts = rests_of(world);
    ASSERT_EQ(parts.size(), 1U) << white;
    EXPECT_LE(parts[0].stretch.to_s, 200.0) << white;
    EXPECT_GE(parts[0].stretch.to_s, 185.0) << white;
  }
}

TEST(RestFinder, TakesASteadyTurnForNone) {
  World world;
  world.rate_dps = [](double t_s) { return t_s > 100.0 && t_s < 200.0 ? 0.5 : 0.0; };
  EXPECT_EQ(spans(rests_of(world)), "0-99 201-300");
  world.rate_dps = [](double) { return 5.0; };
  EXPECT_EQ(spans(rests_of(world)), "");
}

// Both gyros drift with the temperature of one board.
TEST(RestFinder, FollowsTwoGyrosThatWarmUpAlike) {
  World world;
  world.seconds = 900.0;
  world.drift_dps = [](std::size_t gyro, double t_s) {
    return (gyro == 0 ? 0.2 : 0.25) * (1.0 - std::exp(-t_s / 200.0));
  };
  EXPECT_GT(seconds_at_rest(rests_of(world)), 850.0);
}

TEST(RestFinder, NeedsLongerBlocksForSlowGyros) {
  World world;
  world.interval_s = 1.0;
  EXPECT_EQ(spans(rests_of(world)), "0-300");
}

TEST(RestFinder, EndsAPartAtAHoleButNotTheRest) {
  RestFinder finder({.interval_s = 0.01});
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, 0.05);
  for (int i = 0; i < 20000; ++i) {
    if (i >= 8000 && i < 9500) continue;
    finder.add(0.01 * i, {normal(random), normal(random)});
  }
  const std::vector<RestPart> parts = finder.find();
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].rest, parts[1].rest);
  EXPECT_EQ(spans(parts), "0-80 95-200");
}

TEST(RestFinder, FindsNothingInNothing) {
  RestFinder finder({.interval_s = 0.01});
  EXPECT_TRUE(finder.find().empty());
}

}  // namespace
}  // namespace vgyro::analysis
