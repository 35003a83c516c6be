#pragma once

// Noise beyond what the model says: one term of one gyro free at a time, the others as they are.

#include <optional>
#include <vector>

#include "gap/found.h"
#include "gap/regression.h"

namespace vgyro::gap {

struct NoiseFound {
  Found found;
  NoiseTerms terms;  ///< all of its gyro's, with what was found
};

/// One set of observations, and the terms that are taken off it.
struct NoiseQuestion {
  const Regression* regression = nullptr;
  Effects terms;
};

/// The term that makes what is left likeliest, whether or not it is likely enough, with the rivals
/// that cannot be told from it. `model`: the noise that is known. `may[gyro]`: may be asked for it.
/// Nothing: none makes it likelier.
std::optional<NoiseFound> find_noise(const std::vector<NoiseQuestion>& questions,
                                     const PairNoise& model, const std::array<bool, 2>& may);

/// Rivals that are less than this worse cannot be told apart.
inline constexpr double kLead = 7.0;

}  // namespace vgyro::gap
