#pragma once

// The optimal corrector on a simulated world, called as by the pipeline: calibration at rest, then
// pairs, or samples of one gyro alone.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>

#include "fusion/calibration.h"
#include "fusion/corrector.h"
#include "tests/fusion/world.h"

namespace vgyro::fusion {

/// Settings with both gyros' N and K given.
inline OptimalSettings told(const std::array<world::Gyro, 2>& gyros) {
  OptimalSettings settings;
  for (std::size_t k = 0; k < 2; ++k) {
    settings.gyros[k].white_dps_rthz = gyros[k].white;
    settings.gyros[k].walk_dps_rts = gyros[k].walk;
  }
  return settings;
}

/// An endless drive of turns and straights.
inline double winding(double t_s) {
  return 15.0 * std::sin(0.5 * t_s) + 10.0 * std::sin(0.13 * t_s);
}

/// The same drive with a stop of `stop_s` at the end of every `period_s`, with gentle transitions.
struct Stops {
  double period_s = 120.0;
  double stop_s = 20.0;

  [[nodiscard]] bool stopped(double t_s) const { return driven_s(t_s) >= period_s - stop_s; }
  [[nodiscard]] double rate(double t_s) const {
    constexpr double kGentle_s = 3.0;
    const double edge_s = std::min(driven_s(t_s), period_s - stop_s - driven_s(t_s));
    return winding(t_s) * std::clamp(edge_s / kGentle_s, 0.0, 1.0);
  }

 private:
  [[nodiscard]] double driven_s(double t_s) const { return std::fmod(t_s, period_s); }
};

struct Step {
  world::Instant now;
  VirtualRate virtual_rate;
  double rate_error_dps = 0.0;
  double bias_error_dps = 0.0;  ///< error of the drift that is subtracted from the virtual rate
  double bias_sigma_dps = 0.0;
};

class OptimalRun {
 public:
  enum class Use : std::uint8_t { kGyro1 = 0, kGyro2 = 1, kBoth = 2, kNone = 3 };

  OptimalRun(const std::array<world::Gyro, 2>& gyros, double rate_hz, std::uint64_t seed,
             const OptimalSettings& settings)
      : world(gyros, rate_hz, seed),
        corrector(make_optimal_corrector(settings)),
        stop_rate_dps_(settings.stop_rate_dps.value_or(0.0)) {}

  /// Calibrates at the rate of stops. `bound` receives the same instants.
  void calibrate(double rest_s = 60.0, world::Bound* bound = nullptr) {
    Calibrator calibrator(0, rest_s);
    for (;;) {
      const world::Instant now =
          world.next([this](double /*t_s*/) { return stop_rate_dps_; }, true);
      if (bound != nullptr) bound->update(now, stop_rate_dps_);
      if (!calibrator.add(now.t_s, now.reading_dps, stop_rate_dps_)) break;
      corrector->calibrate({now.t_s, now.reading_dps}, stop_rate_dps_);
    }
    corrector->start(calibrator.result());
  }

  Step step(const world::World::Rate& rate, bool stopped = false, Use use = Use::kBoth) {
    Step step;
    step.now = world.next(rate, stopped);
    const world::Instant& now = step.now;
    const RatePair pair{now.t_s, now.reading_dps};
    if (use == Use::kNone) return step;
    const auto alone = static_cast<std::size_t>(use);
    step.virtual_rate =
        use == Use::kBoth ? corrector->update(pair) : corrector->update_alone(alone, pair);
    const Drift drift = corrector->drift(now.t_s);
    step.rate_error_dps = step.virtual_rate.rate_dps - now.rate_dps;
    // The weights show in the rate.
    std::array<double, 2> weight{alone == 0 ? 1.0 : 0.0, alone == 1 ? 1.0 : 0.0};
    if (use == Use::kBoth) {
      const auto& each = step.virtual_rate.corrected_dps;
      weight[0] = (step.virtual_rate.rate_dps - each[1]) / (each[0] - each[1]);
      weight[1] = 1.0 - weight[0];
    }
    step.bias_sigma_dps = drift.bias_sigma_dps;
    for (std::size_t k = 0; k < 2; ++k)
      step.bias_error_dps += weight[k] * (now.bias_dps[k] - drift.bias_dps[k]);
    return step;
  }

  world::World world;
  std::unique_ptr<Corrector> corrector;

 private:
  double stop_rate_dps_;
};

}  // namespace vgyro::fusion
