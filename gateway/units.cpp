#include "gateway/units.h"

#include <cctype>
#include <numbers>

namespace vgyro::gateway {

namespace {

struct Spelling {
  Dimension dimension;
  std::string_view unit;
  Conversion conversion;
};

constexpr double kDegPerRad = 180.0 / std::numbers::pi;
constexpr double kStandardGravity = 9.80665;  // m/s², CGPM 1901
constexpr double kMetrePerMile = 1609.344;

constexpr Spelling kSpellings[] = {
    {Dimension::kRate, "deg/s", {1.0}},
    {Dimension::kRate, "°/s", {1.0}},
    {Dimension::kRate, "dps", {1.0}},
    {Dimension::kRate, "deg/sec", {1.0}},
    {Dimension::kRate, "°/sec", {1.0}},
    {Dimension::kRate, "degree/s", {1.0}},
    {Dimension::kRate, "degrees/s", {1.0}},
    {Dimension::kRate, "degree/sec", {1.0}},
    {Dimension::kRate, "degrees/sec", {1.0}},
    {Dimension::kRate, "degree/second", {1.0}},
    {Dimension::kRate, "degrees/second", {1.0}},
    {Dimension::kRate, "grad/s", {1.0}},  // German "Grad" is a degree
    {Dimension::kRate, "mdeg/s", {1e-3}},
    {Dimension::kRate, "mdps", {1e-3}},
    {Dimension::kRate, "deg/h", {1.0 / 3600.0}},
    {Dimension::kRate, "°/h", {1.0 / 3600.0}},
    {Dimension::kRate, "deg/hr", {1.0 / 3600.0}},
    {Dimension::kRate, "deg/hour", {1.0 / 3600.0}},
    {Dimension::kRate, "rad/s", {kDegPerRad}},
    {Dimension::kRate, "rad/sec", {kDegPerRad}},
    {Dimension::kRate, "rad/second", {kDegPerRad}},
    {Dimension::kRate, "radians/s", {kDegPerRad}},
    {Dimension::kRate, "radians/sec", {kDegPerRad}},
    {Dimension::kRate, "mrad/s", {kDegPerRad * 1e-3}},
    {Dimension::kRate, "rpm", {6.0}},
    {Dimension::kTemperature, "degc", {1.0}},
    {Dimension::kTemperature, "°c", {1.0}},
    {Dimension::kTemperature, "c", {1.0}},
    {Dimension::kTemperature, "celsius", {1.0}},
    {Dimension::kTemperature, "k", {1.0, -273.15}},
    {Dimension::kTemperature, "kelvin", {1.0, -273.15}},
    {Dimension::kTemperature, "degf", {5.0 / 9.0, -160.0 / 9.0}},
    {Dimension::kTemperature, "°f", {5.0 / 9.0, -160.0 / 9.0}},
    {Dimension::kAcceleration, "g", {1.0}},
    {Dimension::kAcceleration, "mg", {1e-3}},
    {Dimension::kAcceleration, "m/s^2", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "m/s2", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "m/s²", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "m/s/s", {1.0 / kStandardGravity}},
    {Dimension::kSpeed, "m/s", {1.0}},
    {Dimension::kSpeed, "km/h", {1.0 / 3.6}},
    {Dimension::kSpeed, "kph", {1.0 / 3.6}},
    {Dimension::kSpeed, "kmh", {1.0 / 3.6}},
    {Dimension::kSpeed, "mph", {kMetrePerMile / 3600.0}},
    {Dimension::kSpeed, "mi/h", {kMetrePerMile / 3600.0}},
    {Dimension::kVoltage, "v", {1.0}},
    {Dimension::kVoltage, "volt", {1.0}},
    {Dimension::kVoltage, "volts", {1.0}},
    {Dimension::kVoltage, "mv", {1e-3}},
};

std::string normalised(std::string_view unit) {
  std::string text;
  for (const char c : unit) {
    if (c != ' ') text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return text;
}

}  // namespace

std::optional<Conversion> convert_unit(Dimension dimension, std::string_view unit) {
  const std::string wanted = normalised(unit);
  for (const Spelling& spelling : kSpellings) {
    if (spelling.dimension == dimension && spelling.unit == wanted) return spelling.conversion;
  }
  return std::nullopt;
}

std::string_view recommended_units(Dimension dimension) {
  switch (dimension) {
    case Dimension::kRate:
      return "deg/s, rad/s, deg/h";
    case Dimension::kTemperature:
      return "degC, K";
    case Dimension::kAcceleration:
      return "g, m/s^2";
    case Dimension::kSpeed:
      return "m/s, km/h, mph";
    case Dimension::kVoltage:
      return "V, mV";
  }
  return "";
}

}  // namespace vgyro::gateway
