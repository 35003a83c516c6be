#include "fusion/compensation.h"

#include <cmath>

namespace vgyro::fusion {

namespace {

// Rounding of the response: the iteration cannot converge closer than this.
constexpr double kSettled = 1e-13;
// Least slope of a gyro's response. Where its model has less, the step would overshoot into rates
// that the model was never made for.
constexpr double kSlopeMin = 0.05;

}  // namespace

Compensation::Compensation(std::span<const model::Effect> effects)
    : equation_(effects), lag_(from_seconds(equation_.lag_s())) {
  std::vector<model::Effect> lasting(effects.begin(), effects.end());
  std::erase_if(lasting, [](const model::Effect& e) {
    return e.kind == model::Kind::kLine || e.kind == model::Kind::kCrossAxis;
  });
  lasting_ = model::Equation(lasting);
}

double Compensation::correct(double reading_dps, const model::Surroundings& surroundings) const {
  const double rate_dps = equation_.without_offsets_dps(reading_dps, surroundings);
  return equation_.responds() ? invert(rate_dps, surroundings) : rate_dps;
}

// Newton on  rate + responses(rate) − reading.
double Compensation::invert(double reading_dps, const model::Surroundings& surroundings) const {
  double rate_dps = reading_dps;
  for (int step = 0; step < kInversionStepsMax; ++step) {
    const double slope = equation_.slope(rate_dps, surroundings);
    if (!(slope >= kSlopeMin)) break;
    const double change_dps = equation_.excess_dps(rate_dps, reading_dps, surroundings) / slope;
    rate_dps -= change_dps;
    if (std::abs(change_dps) <= kSettled * (1.0 + std::abs(reading_dps))) return rate_dps;
  }
  return reading_dps;
}

double Compensation::zero_offset_dps(const model::Surroundings& surroundings) const {
  return lasting_.offset_dps(surroundings);
}

}  // namespace vgyro::fusion
