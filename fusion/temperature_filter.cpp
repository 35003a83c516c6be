#include "fusion/temperature_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vgyro::fusion {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TemperatureFilter::TemperatureFilter(double step_c)
    : memory_s_(std::clamp(kMemoryPerRootStep_s * std::sqrt(step_c), kMemoryMin_s, kMemoryMax_s)),
      temperature_c_(kNone),
      slope_c_s_(kNone) {}

void TemperatureFilter::begin(double temperature_c) {
  known_ = true;
  temperature_c_ = temperature_c;
  slope_c_s_ = 0.0;
  curvature_c_s2_ = 0.0;
}

// Two exponentials are most of a sample's cost, and a sensor keeps its pace: the gains of an
// interval are cached.
const TemperatureFilter::Gains& TemperatureFilter::gains_for(Duration dt, double dt_s) {
  // Stamps usually have whole microseconds, so neighbouring intervals use different places.
  Gains& gains = gains_[static_cast<std::size_t>(dt.count() / kStampStep.count()) % kGainsKept];
  if (gains.dt == dt) return gains;
  const double keep = std::exp(-dt_s / memory_s_);
  const double lose = -std::expm1(-dt_s / memory_s_);
  gains = {dt, 1.0 - keep * keep * keep, 1.5 * lose * lose * (1.0 + keep) / dt_s,
           lose * lose * lose / (dt_s * dt_s)};
  return gains;
}

// Three real poles at −1/memory: the parabola that fits all values, weighted by exp(−age/memory).
void TemperatureFilter::add(TimePoint t, double temperature_c) {
  const Duration dt = t - last_;
  const double dt_s = to_seconds(dt);
  if (known_ && !(dt_s > 0.0)) return;
  last_ = t;
  if (!known_ || dt_s > kForgetAfter * memory_s_) {
    begin(temperature_c);
    return;
  }
  const Gains& gains = gains_for(dt, dt_s);
  const double predicted_c = temperature_c_ + dt_s * (slope_c_s_ + 0.5 * dt_s * curvature_c_s2_);
  const double surprise_c = temperature_c - predicted_c;
  temperature_c_ = predicted_c + gains.temperature * surprise_c;
  slope_c_s_ += dt_s * curvature_c_s2_ + gains.slope_per_s * surprise_c;
  curvature_c_s2_ += gains.curvature_per_s2 * surprise_c;
}

}  // namespace vgyro::fusion
