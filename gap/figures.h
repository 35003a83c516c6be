#pragma once

// Curves for people: residuals over time, frequency and averaging time.

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

}  // namespace vgyro::gap
