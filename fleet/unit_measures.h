#pragma once

// Noise, biases and losses of each unit against those of its type, by the middle of all and how far
// the middle half of them lies apart: a few bad units do not hide behind each other.

#include <cstddef>
#include <vector>

#include "fleet/judge.h"

namespace vgyro::fleet {

/// Noise, walk, scatter of the bias, lost frames; trends count by themselves.
inline constexpr std::size_t kUnitQuestions = 4;

UnitJudgement unit_judgement(const Identity& identity, const UnitSums& sums);

/// Judges all units of a type; `threshold`: of a p-value. Sets the type's noise, and the
/// trend of its bias.
void judge_measures(const Pool& pool, double threshold, std::vector<UnitJudgement>& units,
                    TypeJudgement& type);

}  // namespace vgyro::fleet
