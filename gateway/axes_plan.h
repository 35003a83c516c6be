#pragma once

// From two whole units to a pair of gyros about each axis of the vehicle: which sensor axis
// measures which, what the mounts leave out, identifiers, true rates at rest and the model's
// effects of each pair. Fills Plan::axes.

#include <cstddef>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "base/toml_reader.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// A sensor axis with less than this share in a vehicle's axis is not missed there: 1.1 deg.
inline constexpr double kShareMissed = 0.02;

/// Sets OutputPlan::axes: those that both units measure; an error where they measure different
/// ones. Precondition: both gyros are resolved. Of single gyros there are none.
void find_axes(TomlReader& root, Plan& plan);

/// The true rate of each axis while the platform rests: of the latitude and, about x and y, of the
/// heading; `rate_dps` of the configuration goes before. The unknown part is in
/// CalibrationPlan::doubt_dps. Precondition: all of the configuration is read.
void build_axes(Plan& plan, std::vector<Error>& errors);

/// Sets where `gyro` reads the rate about the unit's own axis `from`: not at all if it is in
/// another message.
void name_other_axis(const GyroPlan& unit, std::size_t from, GyroPlan& gyro);

/// IERS: the Earth turns 7.292115e-5 rad/s against the stars.
inline constexpr double kEarthRate_dps = 7.292115e-5 * 180.0 / std::numbers::pi;

}  // namespace vgyro::gateway
