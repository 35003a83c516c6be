#pragma once

// Compares noise, biases and losses of each unit with those of its type, by the median and the
// median distance from it, so that a few bad units do not hide each other.

#include <cstddef>
#include <vector>

#include "fleet/judge.h"

namespace vgyro::fleet {

/// Noise, walk, scatter of the bias, lost frames; trends are counted separately.
inline constexpr std::size_t kUnitQuestions = 4;

UnitJudgement unit_judgement(const Identity& identity, const UnitSums& sums);

/// Judges all units of a type. `threshold`: greatest p-value of a name. Sets the type's noise and
/// the trend of its bias.
void judge_measures(const Pool& pool, double threshold, std::vector<UnitJudgement>& units,
                    TypeJudgement& type);

}  // namespace vgyro::fleet
