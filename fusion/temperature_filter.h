#pragma once

// A temperature and its slope from a sensor that reports in steps. A fading-memory parabola follows
// the values: no lag while the temperature changes evenly or its slope does, and one step of the
// sensor moves the slope by no more than 0.8 steps per memory. The memory is chosen by the sensor's
// step: a coarse sensor needs a longer one. During the first few memories the slope is being
// learned.

#include <array>
#include <cstddef>

#include "base/time.h"

namespace vgyro::fusion {

class TemperatureFilter {
 public:
  static constexpr double kMemoryMin_s = 3.0;
  static constexpr double kMemoryMax_s = 20.0;
  /// Memory for a sensor with steps of 1 K; it grows with the root of the step.
  static constexpr double kMemoryPerRootStep_s = 18.0;
  /// After a longer silence, in memories, the filter restarts.
  static constexpr double kForgetAfter = 5.0;

  /// `step_c` is 0 for a sensor without steps.
  explicit TemperatureFilter(double step_c = 0.0);

  /// A value at or before the last one's time is ignored.
  void add(TimePoint t, double temperature_c);

  /// NaN before the first value.
  [[nodiscard]] double temperature_c() const { return temperature_c_; }
  [[nodiscard]] double slope_c_s() const { return slope_c_s_; }
  [[nodiscard]] bool known() const { return known_; }
  [[nodiscard]] double memory_s() const { return memory_s_; }

 private:
  /// Number of intervals whose gains are cached: those of a regular sender with some jitter.
  static constexpr std::size_t kGainsKept = 32;
  static constexpr Duration kStampStep = std::chrono::microseconds(1);
  /// Correction for a deviation of 1 K from the prediction, after an interval of `dt`.
  struct Gains {
    Duration dt{0};  ///< 0: none yet
    double temperature = 0.0;
    double slope_per_s = 0.0;
    double curvature_per_s2 = 0.0;
  };

  [[gnu::cold, gnu::noinline]] void begin(double temperature_c);
  const Gains& gains_for(Duration dt, double dt_s);

  double memory_s_;
  bool known_ = false;
  TimePoint last_;
  double temperature_c_;
  double slope_c_s_;
  double curvature_c_s2_ = 0.0;
  std::array<Gains, kGainsKept> gains_{};
};

}  // namespace vgyro::fusion
