#include "gateway/known_effects.h"

#include <algorithm>
#include <cmath>

#include "gateway/model_plan.h"
#include "model/catalogue.h"

namespace vgyro::gateway {

KnownEffects::KnownEffects(const Plan& plan) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::vector<model::Effect> effects = effects_of(plan, gyro);
    compensations_[gyro] = fusion::Compensation(effects);
    doubts_[gyro] = fusion::CompensationDoubt(effects);
    for (const model::Effect& effect : effects)
      needs_[gyro] |= model::info(effect.kind).needs;
    lag_most_ = std::max(lag_most_, lag(gyro));
  }
}

double KnownEffects::take_off_any(std::size_t gyro, double reading_dps,
                                  const Surroundings& surroundings, TimePoint t) const {
  return compensations_[gyro].correct(reading_dps, surroundings.at(gyro, t));
}

void KnownEffects::settle(const Surroundings& surroundings, TimePoint t) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    doubts_[gyro].settle(surroundings.at(gyro, t));
}

double KnownEffects::doubt_dps(double rate_dps, const std::array<double, 2>& shares,
                               const Surroundings& surroundings, TimePoint t) const {
  double sigma_dps = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!doubts_[gyro].any()) continue;
    const auto sigma = doubts_[gyro].at(rate_dps, surroundings.at(gyro, t));
    sigma_dps = std::hypot(sigma_dps, shares[gyro] * sigma.own_dps, sigma.common_dps);
  }
  return sigma_dps;
}

double KnownEffects::zero_offset_dps(std::size_t gyro, const Surroundings& surroundings,
                                     TimePoint t) const {
  return compensations_[gyro].zero_offset_dps(surroundings.at(gyro, t));
}

}  // namespace vgyro::gateway
