#pragma once

// The key `mount` of a unit: how its axes lie in the vehicle, as a rotation. Three angles in
// degrees (roll about x, then pitch about y, then yaw about z, all of the vehicle), or the nine
// numbers of the matrix, row by row. What is nearly a rotation becomes the nearest one; what is
// none, or mirrors, is refused.

#include <array>
#include <optional>

#include "base/toml_reader.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// Tolerance of an element of the matrix: numbers rounded to two digits.
inline constexpr double kMountRounding = 0.01;

/// Nothing where the key is not there, or after a complaint.
std::optional<Mount> read_mount(TomlReader& reader);

/// Ω_vehicle = Rz(yaw) · Ry(pitch) · Rx(roll) · Ω_sensor.
Mount mount_of_angles(const std::array<double, 3>& roll_pitch_yaw_deg);

}  // namespace vgyro::gateway
