#pragma once

// A motion as a table: time, true rate, and, if known, temperature, acceleration, supply voltage
// and the rates about other axes. Its text is CSV with a header line; docs/simulate.md describes
// it.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "simulation/curve.h"

namespace vgyro::simulation {

/// Limit of rows; a longer profile is refused.
inline constexpr std::size_t kProfileRowsMax = 2'000'000;

/// Seconds count from the first row.
struct Profile {
  std::string file;
  double length_s = 0.0;
  bool has_rate = true;  ///< the column rate_dps is present
  Curve rate_dps;        ///< without the column rate_dps: the rate about z
  std::optional<Curve> temperature_c;
  std::array<std::optional<Curve>, 3> acceleration_g;
  std::optional<Curve> supply_v;
  std::array<std::optional<Curve>, 3> other_rate_dps;  ///< about x, y and z

  [[nodiscard]] bool has_acceleration() const;
};

/// The motion about one axis of a turned sensor. `rate` holds the shares of the rates about the
/// vehicle's x, y and z in the sensor's rate; `others` holds those for the three axes of its unit.
/// An axis that the profile lacks counts as 0.
Profile turned(const Profile& profile, const std::array<double, 3>& rate,
               const std::array<std::array<double, 3>, 3>& others);

Expected<Profile> load_profile(const std::string& path);
/// `file` names the text in errors.
Expected<Profile> parse_profile(std::string_view text, const std::string& file);

}  // namespace vgyro::simulation
