#pragma once

// Degrees are what people, frames and files speak of; radians what sines and angles are reckoned
// in.

#include <numbers>

namespace vgyro {

inline constexpr double kRadPerDeg = std::numbers::pi / 180.0;
inline constexpr double kDegPerRad = 180.0 / std::numbers::pi;

}  // namespace vgyro
