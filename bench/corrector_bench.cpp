// Cost of a pair of samples in the optimal corrector: turning or at a stop, at 100 and 500 Hz, with
// N and K given (one filter for each kind of drift) or estimated (one for each pair of supposed K
// as well).

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>

#include "fusion/corrector.h"

namespace {

using namespace vgyro::fusion;

constexpr double kRest_s = 60.0;
constexpr double kRun_s = 600.0;
constexpr double kWhite = 5e-3;
constexpr double kWalk = 1e-4;

std::vector<RatePair> pairs(double rate_hz, bool turning) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const double step_s = 1.0 / rate_hz;
  std::array<double, 2> bias{0.3, -0.2};
  std::vector<RatePair> made;
  for (double t_s = 0.0; t_s < kRest_s + kRun_s; t_s += step_s) {
    const double rate = turning && t_s > kRest_s ? 10.0 * std::sin(0.5 * t_s) : 0.0;
    RatePair pair{.t_s = t_s};
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      bias[gyro] += kWalk * std::sqrt(step_s) * normal(random);
      pair.rate_dps[gyro] = rate + bias[gyro] + kWhite * std::sqrt(rate_hz) * normal(random);
    }
    made.push_back(pair);
  }
  return made;
}

void optimal_pair(benchmark::State& state) {
  const bool turning = state.range(1) != 0;
  const std::vector<RatePair> world = pairs(static_cast<double>(state.range(0)), turning);
  OptimalSettings settings;
  if (state.range(2) != 0) {
    for (GyroParameters& gyro : settings.gyros) {
      gyro.white_dps_rthz = kWhite;
      gyro.walk_dps_rts = kWalk;
    }
  }
  std::int64_t done = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const auto corrector = make_optimal_corrector(settings);
    Calibrator calibrator(0, kRest_s);
    std::size_t i = 0;
    for (; calibrator.add(world[i].t_s, world[i].rate_dps, 0.0); ++i)
      corrector->calibrate(world[i], 0.0);
    corrector->start(calibrator.result());
    state.ResumeTiming();
    for (; i < world.size(); ++i) {
      benchmark::DoNotOptimize(corrector->update(world[i]));
      ++done;
    }
  }
  state.SetItemsProcessed(done);
}
BENCHMARK(optimal_pair)
    ->ArgNames({"hz", "turning", "given"})
    ->ArgsProduct({{100, 500}, {0, 1}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
