#pragma once

// The one number: how much less likely the recording is than what simulations of a model produce,
// in nats per sample.

#include <vector>

#include "gap/noise.h"
#include "gap/result.h"
#include "gap/study.h"

namespace vgyro::gap {

struct Likelihood {
  double nats = 0.0;     ///< negative log-likelihood of the samples that count, without constants
  double samples = 0.0;  ///< how many count
};

/// Of what was observed, drift and all, under `effects`.
Likelihood observed(const Study& study, const std::vector<model::Effect>& effects, Part part);

/// Nats that frames lost, late, frozen, clipped or standing out cost a model that knows nothing of
/// them.
double transport_nats(const Study& study, const std::vector<model::Effect>& effects, Part part);

struct Floor {
  double nats_per_sample = 0.0;
  std::array<double, 2> band95{};  ///< of a recording's gap, around 0
};
/// What simulations of the model score: a recording's normalised innovations are white, so that
/// their sum of squares is drawn instead of the recording.
Floor simulate_floor(const Study& study, const std::vector<model::Effect>& effects, Part part,
                     std::uint64_t seed);

/// Gap of `effects`, against the floor of `final_effects`.
double gap_of(const Study& study, const std::vector<model::Effect>& effects, const Floor& floor,
              Part part);

}  // namespace vgyro::gap
