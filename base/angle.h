#pragma once

// People, frames and files use degrees; trigonometry uses radians.

#include <numbers>

namespace vgyro {

inline constexpr double kRadPerDeg = std::numbers::pi / 180.0;
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

}  // namespace vgyro
