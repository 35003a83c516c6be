// The normalised innovation tells whether the corrector's measurements scatter as it expects. The
// expected value is 1; that of a mean over some 32 rows scatters by 1/4.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include <gtest/gtest.h>

#include "tests/fusion/optimal_run.h"

namespace vgyro::fusion {
namespace {

constexpr double kRate_hz = 100.0;
constexpr std::array<world::Gyro, 2> kGyros{
    {{.white = 2e-3, .walk = 3e-5}, {.white = 4e-3, .walk = 6e-5}}};
constexpr Stops kDrive;

/// Mean of what is told each ten seconds from `from_s` to `to_s` of the drive.
double mean_innovation(OptimalRun& run, double from_s, double to_s) {
  double sum = 0.0;
  int count = 0;
  const double begin_s = run.world.now_s();
  double next_s = from_s;
  while (run.world.now_s() - begin_s < to_s) {
    const double t_s = run.world.now_s() - begin_s;
    run.step([&](double now_s) { return kDrive.rate(now_s - begin_s); }, kDrive.stopped(t_s));
    if (t_s < next_s) continue;
    next_s += 10.0;
    sum += run.corrector->condition().normalized_innovation;
    ++count;
  }
  return sum / count;
}

std::array<world::Gyro, 2> with(double white_factor, double walk_factor) {
  std::array<world::Gyro, 2> gyros = kGyros;
  for (world::Gyro& gyro : gyros) {
    gyro.white *= white_factor;
    gyro.walk *= walk_factor;
  }
  return gyros;
}

/// Over four worlds; the early ten minutes are left out.
double innovation_of(const std::array<world::Gyro, 2>& gyros, const OptimalSettings& settings) {
  double sum = 0.0;
  constexpr std::uint64_t kSeeds = 4;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    OptimalRun run(gyros, kRate_hz, seed, settings);
    run.calibrate();
    EXPECT_TRUE(std::isnan(run.corrector->condition().normalized_innovation)) << "of nothing";
    sum += mean_innovation(run, 600.0, 1800.0);
  }
  const double mean = sum / static_cast<double>(kSeeds);
  std::printf("seeds 1 to %d: %.3f\n", static_cast<int>(kSeeds), mean);
  return mean;
}

TEST(Innovation, IsOneWhereNoiseAndDriftsAreAsModelled) {
  EXPECT_NEAR(innovation_of(kGyros, told(kGyros)), 1.0, 0.15);
  EXPECT_NEAR(innovation_of(kGyros, {}), 1.0, 0.15) << "where nothing is told, N and K are learned";
}

TEST(Innovation, IsTheSquareOfNoiseThatIsTwiceWhatIsTold) {
  // A told N is kept, and windows of white noise scatter by it.
  EXPECT_NEAR(innovation_of(with(2.0, 1.0), told(kGyros)), 4.0, 0.8);
  EXPECT_NEAR(innovation_of(with(0.5, 1.0), told(kGyros)), 0.25, 0.06);
}

TEST(Innovation, StaysOneWhereTheCorrectorAdapts) {
  EXPECT_NEAR(innovation_of(with(2.0, 1.0), {}), 1.0, 0.15);
  EXPECT_LT(innovation_of(with(1.0, 20.0), {}), 1.4);
}

TEST(Innovation, ShowsDriftsThatAreFasterThanTold) {
  EXPECT_GT(innovation_of(with(1.0, 20.0), told(kGyros)), 1.6);
}

// A jump is for the hypotheses; what of it enters a window is soon forgotten.
TEST(Innovation, ForgetsAJump) {
  OptimalRun run(kGyros, kRate_hz, 7, told(kGyros));
  run.calibrate();
  mean_innovation(run, 0.0, 600.0);
  run.world.jump(1, 0.5);
  mean_innovation(run, 0.0, 1200.0);
  EXPECT_LT(run.corrector->condition().normalized_innovation, 1.75)
      << "1 and three of its scatters";
}

}  // namespace
}  // namespace vgyro::fusion
