#include "gateway/units.h"

#include <algorithm>
#include <cctype>
#include <iterator>

#include <fmt/format.h>

#include "base/angle.h"

namespace vgyro::gateway {

namespace {

struct Spelling {
  Dimension dimension;
  std::string_view unit;
  Conversion conversion;
};

constexpr double kStandardGravity = 9.80665;  // m/s², CGPM 1901
constexpr double kMetrePerMile = 1609.344;

constexpr Spelling kSpellings[] = {
    {Dimension::kRate, "dps", {1.0}},
    {Dimension::kRate, "mdps", {1e-3}},
    {Dimension::kRate, "rpm", {6.0}},
    {Dimension::kTemperature, "degc", {1.0}},
    {Dimension::kTemperature, "°c", {1.0}},
    {Dimension::kTemperature, "c", {1.0}},
    {Dimension::kTemperature, "celsius", {1.0}},
    {Dimension::kTemperature, "degcelsius", {1.0}},
    {Dimension::kTemperature, "degreec", {1.0}},
    {Dimension::kTemperature, "degreesc", {1.0}},
    {Dimension::kTemperature, "degreecelsius", {1.0}},
    {Dimension::kTemperature, "degreescelsius", {1.0}},
    {Dimension::kTemperature, "degrecelsi", {1.0}},  // as in "Unit_DegreCelsi"
    {Dimension::kTemperature, "gradc", {1.0}},
    {Dimension::kTemperature, "gradcelsius", {1.0}},
    {Dimension::kTemperature, "degk", {1.0, -273.15}},
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
    {Dimension::kAcceleration, "m/s**2", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "m/ss", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "m/sec^2", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "m/sec2", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "meterperseconsquar", {1.0 / kStandardGravity}},
    {Dimension::kAcceleration, "meterpersecondsquared", {1.0 / kStandardGravity}},
    {Dimension::kSpeed, "m/s", {1.0}},
    {Dimension::kSpeed, "m/sec", {1.0}},
    {Dimension::kSpeed, "meterpersecon", {1.0}},
    {Dimension::kSpeed, "meterpersecond", {1.0}},
    {Dimension::kSpeed, "km/h", {1.0 / 3.6}},
    {Dimension::kSpeed, "km/hr", {1.0 / 3.6}},
    {Dimension::kSpeed, "kmph", {1.0 / 3.6}},
    {Dimension::kSpeed, "kilometerperhour", {1.0 / 3.6}},
    {Dimension::kSpeed, "kph", {1.0 / 3.6}},
    {Dimension::kSpeed, "kmh", {1.0 / 3.6}},
    {Dimension::kSpeed, "mph", {kMetrePerMile / 3600.0}},
    {Dimension::kSpeed, "mi/h", {kMetrePerMile / 3600.0}},
    {Dimension::kVoltage, "v", {1.0}},
    {Dimension::kVoltage, "volt", {1.0}},
    {Dimension::kVoltage, "volts", {1.0}},
    {Dimension::kVoltage, "mv", {1e-3}},
};

// A word for an angle or a time, with its size in degrees or seconds.
struct Word {
  std::string_view word;
  double size;
};
// German "Grad" is a degree, not a gon. Some tools export units in words, and DBC names end after
// 32 characters: "Unit_DegreOfArcPerSecon".
constexpr Word kAngles[] = {{"deg", 1.0},
                            {"degree", 1.0},
                            {"degrees", 1.0},
                            {"degreeofarc", 1.0},
                            {"degofarc", 1.0},
                            {"degreofarc", 1.0},
                            {"degreesofarc", 1.0},
                            {"°", 1.0},
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
// The text between angle and time, and after the time.
struct Quotient {
  std::string_view between;
  std::string_view behind;
};
constexpr Quotient kQuotients[] = {{"/", ""},    {"per", ""},  {"pro", ""},  {"", "^-1"},
                                   {"*", "^-1"}, {"·", "^-1"}, {".", "^-1"}, {"", "-1"},
                                   {"*", "-1"},  {"·", "-1"},  {".", "-1"},  {"", "⁻¹"},
                                   {"*", "⁻¹"},  {"·", "⁻¹"},  {".", "⁻¹"}};

// Characters used instead of the degree sign: the ordinal indicator, the ring, UTF-8 mistaken for
// cp1252 and encoded again; and characters that include it.
struct Sign {
  std::string_view typed;
  std::string_view meant;
};
constexpr Sign kSigns[] = {{"Â°", "°"}, {"Âº", "°"}, {"º", "°"},
                           {"˚", "°"},  {"℃", "°c"}, {"℉", "°f"}};

std::string normalised(std::string_view unit) {
  std::string text;
  for (const char c : unit) {
    if (c != ' ' && c != '_')
      text += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  for (const Sign& sign : kSigns) {
    for (std::size_t at = text.find(sign.typed); at != text.npos; at = text.find(sign.typed, at))
      text.replace(at, sign.typed.size(), sign.meant);
  }
  constexpr std::string_view kPrefix = "unit";
  if (text.starts_with(kPrefix)) text.erase(0, kPrefix.size());
  return text;
}

std::optional<double> degrees_of(std::string_view angle) {
  for (const Word& prefix : kPrefixes) {
    if (!angle.starts_with(prefix.word)) continue;
    const std::string_view word = angle.substr(prefix.word.size());
    const auto* const found = std::find_if(std::begin(kAngles), std::end(kAngles),
                                           [&](const Word& one) { return one.word == word; });
    if (found != std::end(kAngles)) return prefix.size * found->size;
  }
  return std::nullopt;
}

// An angle over a time, in deg/s.
std::optional<double> rate_unit(std::string_view unit) {
  for (const Quotient& quotient : kQuotients) {
    for (const Word& time : kTimes) {
      const std::string tail = fmt::format("{}{}{}", quotient.between, time.word, quotient.behind);
      if (!unit.ends_with(tail)) continue;
      const auto degrees = degrees_of(unit.substr(0, unit.size() - tail.size()));
      if (degrees) return *degrees / time.size;
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
