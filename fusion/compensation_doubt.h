#pragma once

// Uncertainty of the rate from the model file's corrections of one gyro: the effects' σ, and whole
// ambiguous effects. A corrector learns a constant bias error, so an uncertainty counts from its
// value when the biases were last learned: a wrong constant is harmless, a wrong temperature
// coefficient counts with the change of temperature since, a wrong scale factor counts in turns.
// Lags are not included: their uncertainty is proportional to the rate's slope, and the corrector
// handles it (GyroParameters).

#include <span>
#include <vector>

#include "model/effect.h"
#include "model/equation.h"

namespace vgyro::fusion {

class CompensationDoubt {
 public:
  /// 1σ, deg/s.
  struct Sigma {
    double own_dps = 0.0;  ///< of this gyro alone: counts by its share of the rate
    /// From ambiguous effects: if the wrong one was named, the other gyro agrees with the error,
    /// and the rate has all of it, whatever the shares.
    double common_dps = 0.0;
  };

  /// No effects, no uncertainty.
  CompensationDoubt() = default;
  /// `effects` of one gyro, of any kind.
  explicit CompensationDoubt(std::span<const model::Effect> effects);

  [[nodiscard]] bool any() const { return !terms_.empty(); }

  /// The biases have just been learned, at rest, with the present corrections.
  void settle(const model::Surroundings& surroundings);

  [[nodiscard]] Sigma at(double rate_dps, const model::Surroundings& surroundings) const;

 private:
  /// One parameter at both ends of its σ; for an ambiguous effect, the whole effect against none.
  struct Term {
    model::Effect high;
    model::Effect low;
    bool is_common = false;
    bool is_held = true;       ///< the bias absorbs its value; false: it is over before that
    double settled_dps = 0.0;  ///< its value when the biases were learned
  };

  [[nodiscard]] static double value_dps(const Term& term, double rate_dps,
                                        const model::Surroundings& surroundings);

  std::vector<Term> terms_;
  model::Equation equation_;
};

}  // namespace vgyro::fusion
