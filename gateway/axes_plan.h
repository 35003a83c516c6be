#pragma once

// Turns two whole units into a pair of gyros about each axis of the vehicle: chooses the sensor
// axis for each, finds axes that a unit does not measure as mounted, and derives each pair's
// identifiers, true rate at rest and model effects. Fills Plan::axes.

#include <cstddef>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/toml_reader.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// A sensor axis that a unit lacks matters to a vehicle's axis only above this share: 1.1 deg.
inline constexpr double kShareMissed = 0.02;

/// Sets OutputPlan::axes to the axes that both units measure; an error where they measure different
/// ones. Leaves it empty for single gyros. Precondition: both gyros are resolved.
void find_axes(TomlReader& root, Plan& plan);

/// Fills Plan::axes. The true rate of each axis at rest is the configured `rate_dps`, otherwise it
/// follows from the latitude and, about x and y, from the heading; CalibrationPlan::doubt_dps holds
/// the unknown part. Precondition: the whole configuration has been read.
void build_axes(Plan& plan, std::vector<Error>& errors);

/// Lets `gyro` also read the rate about the unit's own axis `from`, unless that is in another
/// message.
void name_other_axis(const GyroPlan& unit, std::size_t from, GyroPlan& gyro);

/// IERS: the Earth turns 7.292115e-5 rad/s against the stars.
inline constexpr double kEarthRate_dps = 7.292115e-5 * 180.0 / std::numbers::pi;

}  // namespace vgyro::gateway
