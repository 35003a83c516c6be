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
    {Dimension::kRate, "dps", {1.0}},
    {Dimension::kRate, "mdps", {1e-3}},
    {Dimension::kRate, "rpm", {6.0}},
    {Dimension::kTemperature, "degc", {1.0}},
    {Dimension::kTemperature, "°c", {1.0}},
    {Dimension::kTemperature, "ºc", {1.0}},
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

// An angle or a time as people write it, in degrees or seconds.
struct Word {
  std::string_view word;
  double size;
};
// German "Grad" is a degree, not a gon; "º", the ordinal indicator, is typed for the degree sign.
// Exports of some tools spell units out, and DBC names end after 32 characters:
// "Unit_DegreOfArcPerSecon".
constexpr Word kAngles[] = {{"deg", 1.0},
                            {"degree", 1.0},
                            {"degrees", 1.0},
                            {"degreeofarc", 1.0},
                            {"degofarc", 1.0},
                            {"degreofarc", 1.0},
                            {"degreesofarc", 1.0},
                            {"°", 1.0},
                            {"º", 1.0},
                            {"grad", 1.0},
                            {"rad", kDegPerRad},
                            {"rads", kDegPerRad},
                            {"radian", kDegPerRad},
                            {"radians", kDegPerRad},
                            {"radiant", kDegPerRad}};
constexpr double kMinute_s = 60.0;
constexpr double kHour_s = 3600.0;
constexpr Word kTimes[] = {
    {"s", 1.0},      {"sec", 1.0},      {"secon", 1.0},     {"second", 1.0},       {"seconds", 1.0},
    {"sek", 1.0},    {"sekunde", 1.0},  {"min", kMinute_s}, {"minute", kMinute_s}, {"h", kHour_s},
    {"hr", kHour_s}, {"hour", kHour_s}, {"std", kHour_s},   {"stunde", kHour_s}};
constexpr Word kPrefixes[] = {{"milli", 1e-3}, {"m", 1e-3}, {"", 1.0}};
// What stands between angle and time, and behind the time.
struct Quotient {
  std::string_view between;
  std::string_view behind;
};
constexpr Quotient kQuotients[] = {{"/", ""},    {"per", ""},  {"pro", ""},  {"", "^-1"},
                                   {"*", "^-1"}, {"·", "^-1"}, {".", "^-1"}, {"", "-1"},
                                   {"*", "-1"},  {"·", "-1"},  {".", "-1"},  {"", "⁻¹"},
                                   {"*", "⁻¹"},  {"·", "⁻¹"},  {".", "⁻¹"}};

std::string normalised(std::string_view unit) {
  std::string text;
  for (const char c : unit) {
    if (c != ' ' && c != '_')
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  constexpr std::string_view kPrefix = "unit";
  if (text.starts_with(kPrefix)) text.erase(0, kPrefix.size());
  return text;
}

// An angle by a time, in deg/s.
std::optional<double> rate_unit(std::string_view unit) {
  for (const Word& prefix : kPrefixes) {
    for (const Word& angle : kAngles) {
      for (const Word& time : kTimes) {
        for (const Quotient& quotient : kQuotients) {
          std::string_view rest = unit;
          bool fits = true;
          for (const std::string_view part :
               {prefix.word, angle.word, quotient.between, time.word, quotient.behind}) {
            fits = fits && rest.starts_with(part);
            if (fits) rest.remove_prefix(part.size());
          }
          if (fits && rest.empty()) return prefix.size * angle.size / time.size;
        }
      }
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<Conversion> convert_unit(Dimension dimension, std::string_view unit) {
  const std::string wanted = normalised(unit);
  for (const Spelling& spelling : kSpellings) {
    if (spelling.dimension == dimension && spelling.unit == wanted) return spelling.conversion;
  }
  if (dimension != Dimension::kRate) return std::nullopt;
  const auto scale = rate_unit(wanted);
  return scale ? std::optional(Conversion{*scale}) : std::nullopt;
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
