#pragma once

// Value types of the search: what the scan proposes, and what the search has named.

#include <optional>
#include <vector>

#include "gap/result.h"
#include "model/effect.h"

namespace vgyro::gap {

/// A proposal: an effect with its size as the linear look has it.
struct Score {
  model::Effect effect;
  double statistic = 0.0;  ///< what 2·log-likelihood gains at the noise that the scan was given
  double penalty = 0.0;    ///< what looking in so many places brings by chance
  [[nodiscard]] double adjusted() const { return statistic - penalty; }
};

/// A name.
struct Found {
  model::Effect effect;
  model::Parameters sigma{};  ///< 0 where nothing was estimated
  double statistic = 0.0;     ///< what 2·log-likelihood gains, noise fitted again on both sides
  double penalty = 0.0;
  double needed = 0.0;  ///< of statistic less penalty
  std::vector<Reading> ambiguous_with;
  std::optional<model::Effect> companion;  ///< a bias that is taken with it
  bool starting = false;      ///< of the starting model: what every gyro has, and no name
  bool of_reference = false;  ///< a bias that says at which temperature a gyro's own is none
  bool accepted = false;      ///< ambiguous, and the caller chose this reading
  bool unchecked = false;     ///< the time was over before all that speaks against it was tried
  /// What is told, and has to stand by itself.
  [[nodiscard]] bool is_name() const { return !starting && !of_reference; }
  [[nodiscard]] double adjusted() const { return statistic - penalty; }
  [[nodiscard]] double margin() const { return adjusted() - needed; }
};

inline Reading reading_of(const model::Effect& effect) {
  return {effect.kind, effect.gyro, effect.parameters};
}

}  // namespace vgyro::gap
