#include "fusion/compensation.h"

#include <algorithm>
#include <cmath>

#include "model/catalogue.h"

namespace vgyro::fusion {

namespace {

// Rounding of the response itself: the iteration cannot settle closer than this.
constexpr double kSettled = 1e-13;
// A gyro answers at least this strongly. Where its model says less, the step would overshoot into
// rates that the model was never made for.
constexpr double kSlopeMin = 0.05;

}  // namespace

Compensation::Compensation(std::span<const model::Effect> effects) {
  double lag_s = 0.0;
  for (const model::Effect& effect : effects) {
    const model::Nature nature = model::info(effect.kind).nature;
    if (nature == model::Nature::kOffset) offsets_.push_back(effect);
    if (nature == model::Nature::kResponse) responses_.push_back(effect);
    if (nature == model::Nature::kLag) lag_s += model::lag_s(effect);
  }
  lag_ = from_seconds(lag_s);
}

double Compensation::correct(double reading_dps, const model::Surroundings& surroundings) const {
  double rate_dps = reading_dps;
  for (const model::Effect& effect : offsets_)
    rate_dps -= model::added_dps(effect, 0.0, surroundings);
  return responses_.empty() ? rate_dps : invert(rate_dps, surroundings);
}

// Newton on  rate + responses(rate) − reading.
double Compensation::invert(double reading_dps, const model::Surroundings& surroundings) const {
  double rate_dps = reading_dps;
  for (int step = 0; step < kInversionStepsMax; ++step) {
    double excess_dps = rate_dps - reading_dps;
    double slope = 1.0;
    for (const model::Effect& effect : responses_) {
      excess_dps += model::added_dps(effect, rate_dps, surroundings);
      slope += model::slope(effect, rate_dps, surroundings);
    }
    if (!(slope >= kSlopeMin)) break;
    const double change_dps = excess_dps / slope;
    rate_dps -= change_dps;
    if (std::abs(change_dps) <= kSettled * (1.0 + std::abs(reading_dps))) return rate_dps;
  }
  return reading_dps;
}

double Compensation::zero_offset_dps(const model::Surroundings& surroundings) const {
  double sum_dps = 0.0;
  for (const model::Effect& effect : offsets_) {
    if (effect.kind != model::Kind::kLine) sum_dps += model::added_dps(effect, 0.0, surroundings);
  }
  return sum_dps;
}

}  // namespace vgyro::fusion
