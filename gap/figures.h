#pragma once

// Curves for people: residuals over time, frequency and averaging time, and what gave an effect
// away.

#include <array>
#include <cstdint>
#include <vector>

#include "gap/result.h"
#include "gap/study.h"

namespace vgyro::gap {

std::array<GyroFigures, 2> gyro_figures(const Study& study,
                                        const std::vector<model::Effect>& before,
                                        const std::vector<model::Effect>& after,
                                        std::uint64_t seed);

/// Evidence, place and figure of every effect that the search has named.
void describe_effects(const Study& study, const std::vector<model::Effect>& before, Result& result);

/// Where a model and a recording differ, largest first.
std::vector<Difference> differences(const Study& study, const std::vector<model::Effect>& effects);

}  // namespace vgyro::gap
