#pragma once

// The key `mount` of a unit: the rotation from its axes to the vehicle's. Three angles in degrees
// (roll about x, then pitch about y, then yaw about z, all of the vehicle), or the nine numbers of
// the matrix, row by row. A matrix close to a rotation becomes the nearest one; others, and
// reflections, are refused.

#include <array>
#include <optional>

#include "base/toml_reader.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// Tolerance of a matrix element: the numbers may be rounded to two digits.
inline constexpr double kMountRounding = 0.01;

/// Nothing if the key is absent, or after an error.
std::optional<Mount> read_mount(TomlReader& reader);

/// Ω_vehicle = Rz(yaw) · Ry(pitch) · Rx(roll) · Ω_sensor.
Mount mount_of_angles(const std::array<double, 3>& roll_pitch_yaw_deg);

}  // namespace vgyro::gateway
