#pragma once

// One gyro, sample by sample: the equation of its effects (model/equation.h) with the random ones,
//   frozen(clipped(rate + responses + offsets + noise + spikes)),
// applied to the rate that reaches its sensing element. Delay and low-pass come before it, lost
// frames and wrong stamps after it (simulator.h).

#include <span>
#include <vector>

#include "model/effect.h"
#include "model/equation.h"
#include "simulation/noise_source.h"

namespace vgyro::simulation {

class GyroChain {
 public:
  /// `effects` of one gyro, of any kind. `interval_s` is the usual time between samples, which
  /// turns a noise density into a variance.
  GyroChain(std::span<const model::Effect> effects, double interval_s, std::uint64_t seed);

  /// Precondition: surroundings.t_s increases.
  double next(double late_dps, const model::Surroundings& surroundings);

 private:
  /// A random effect with its stream of random numbers and its state.
  struct Random {
    model::Effect effect;
    NoiseSource source;
    double state_dps = 0.0;
    std::vector<double> flicker_dps = {};  ///< states of its terms
  };
  double noise_dps(Random& random, double late_dps, double since_s);
  double flicker_dps(Random& random, double since_s) const;
  double correlated_dps(NoiseSource& source, double before_dps, double sigma_dps, double tau_s,
                        double since_s) const;

  model::Equation equation_;
  std::vector<model::Effect> stuck_;
  std::vector<Random> randoms_;
  double interval_s_;
  bool begun_ = false;
  double last_s_ = 0.0;
  double last_reading_dps_ = 0.0;
};

}  // namespace vgyro::simulation
