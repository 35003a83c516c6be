#pragma once

// What a gyro with these effects would have read at given instants: the model along a recorded
// motion. Same equations and same noise as the simulator's.

#include <cstdint>
#include <span>
#include <vector>

#include "base/error.h"
#include "model/effect.h"
#include "model/equation.h"

namespace vgyro::simulation {

struct Instant {
  double rate_dps = 0.0;             ///< the true one
  model::Surroundings surroundings;  ///< its t_s is the time
};

/// `effects` of one gyro; those of Nature::kDisturbance but spikes and stuck do nothing here.
/// Delay and low-pass work on a curve through the instants' rates. `interval_s` is the usual time
/// between samples. An error says which effects are too many; there is none otherwise.
/// Precondition: times grow, everything that is not unknown is finite.
Expected<std::vector<double>> readings(std::span<const model::Effect> effects,
                                       std::span<const Instant> instants, double interval_s,
                                       std::uint64_t seed);

/// An error when the equation has more low-passes than are simulated.
Expected<void> check_low_passes(const model::Equation& equation);

}  // namespace vgyro::simulation
