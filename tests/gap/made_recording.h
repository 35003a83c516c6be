#pragma once

// Recordings whose truth is known, for tests: a motion in closed form, read by two gyros with white
// noise and random walk and whatever error a test adds.

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>

#include "gap/recording.h"
#include "model/effect.h"

namespace vgyro::gap {

inline constexpr double kPi = std::numbers::pi;

struct Making {
  double seconds = 240.0;
  double interval_s = 0.01;
  double rest_s = 60.0;
  std::array<double, 2> white_dps_rthz{1e-3, 2e-3};
  std::array<double, 2> walk_dps_rts{1e-5, 1e-5};
  std::uint64_t seed = 1;
  /// What gyro k reads beside the truth.
  std::function<double(std::size_t gyro, double t_s, double rate_dps)> error =
      [](std::size_t, double, double) { return 0.0; };
};

/// At rest first, then to and fro at two rates that share no period.
inline double true_rate_dps(const Making& making, double t_s) {
  if (t_s <= making.rest_s) return 0.0;
  const double x = t_s - making.rest_s;
  const double rise = 1.0 - std::exp(-x * x / 4.0);
  return rise * (30.0 * std::sin(2.0 * kPi * 0.11 * x) + 12.0 * std::sin(2.0 * kPi * 0.37 * x));
}

inline Recording make_recording(const Making& making) {
  Recording recording;
  recording.seconds = making.seconds;
  recording.rest_s = making.rest_s;
  recording.has_reference = true;
  std::mt19937_64 random(making.seed);
  std::normal_distribution<double> normal;
  const auto count = static_cast<std::size_t>(making.seconds / making.interval_s);
  constexpr double kStep_dps = 1e-6;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    GyroSeries& series = recording.gyros[gyro];
    series.name = gyro == 0 ? "a" : "b";
    series.step_dps = kStep_dps;
    series.limit_dps = 2000.0;
    double walk_dps = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double t_s = static_cast<double>(i) * making.interval_s;
      const double rate_dps = true_rate_dps(making, t_s);
      walk_dps += making.walk_dps_rts[gyro] * std::sqrt(making.interval_s) * normal(random);
      const double noise_dps =
          making.white_dps_rthz[gyro] / std::sqrt(making.interval_s) * normal(random);
      const double reading = rate_dps + making.error(gyro, t_s, rate_dps) + walk_dps + noise_dps;
      series.t_s.push_back(t_s);
      series.rate_dps.push_back(kStep_dps * std::round(reading / kStep_dps));
      if (gyro != 0) continue;
      recording.reference_dps.t_s.push_back(t_s);
      recording.reference_dps.value.push_back(rate_dps);
    }
  }
  return recording;
}

inline std::vector<model::Effect> noise_effects(const Making& making) {
  std::vector<model::Effect> effects;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    effects.push_back({gyro, model::Kind::kWhiteNoise, {making.white_dps_rthz[gyro]}, 0});
    effects.push_back({gyro, model::Kind::kRateRandomWalk, {making.walk_dps_rts[gyro]}, 0});
  }
  return effects;
}

}  // namespace vgyro::gap
