#pragma once

// Units as DBC files spell them → the product's own: deg/s, degC, g, m/s, V.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vgyro::gateway {

enum class Dimension : std::uint8_t { kRate, kTemperature, kAcceleration, kSpeed, kVoltage };

struct Conversion {
  double scale = 1.0;  ///< own = value · scale + shift
  double shift = 0.0;
};

/// Ignores letter case, blanks and underscores. A rate is any unit of angle over any unit of time,
/// as English and German files write them. Nothing for a unit of another dimension or an unknown
/// one.
std::optional<Conversion> convert_unit(Dimension dimension, std::string_view unit);

/// The spellings to recommend, e.g. "deg/s, rad/s, deg/h".
std::string_view recommended_units(Dimension dimension);

}  // namespace vgyro::gateway
