#include "gateway/units.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace vgyro::gateway {
namespace {

double converted(Dimension dimension, std::string_view unit, double value) {
  const auto conversion = convert_unit(dimension, unit);
  if (!conversion) return std::nan("");
  return value * conversion->scale + conversion->shift;
}

// One turn per minute is 6 deg/s in every family of spellings.
TEST(Units, TurnEveryRateIntoDegreesPerSecond) {
  constexpr double kRad = std::numbers::pi / 180.0;
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "deg/s", 6.0), 6.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "°/s", 6.0), 6.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "mdps", 6000.0), 6.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "deg/h", 21600.0), 6.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "rad/s", 6.0 * kRad), 6.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "mrad/s", 6000.0 * kRad), 6.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "rpm", 1.0), 6.0);
}

// Spellings found in public DBC files.
TEST(Units, ReadRatesAsPeopleWriteThem) {
  constexpr double kRad = std::numbers::pi / 180.0;
  for (const std::string_view unit :
       {"Grad/sec", "deg/sek", "Unit_DegreePerSecond", "Unit_DegreOfArcPerSecon", "º/s", "º/sec",
        "deg per s", "DegPerSec", "degrees per second", "Grad/Sekunde", "deg*s^-1", "°·s⁻¹",
        "deg/second", "degree/sec", "deg s-1"}) {
    EXPECT_DOUBLE_EQ(converted(Dimension::kRate, unit, 6.0), 6.0) << unit;
  }
  for (const std::string_view unit : {"radians/second", "radian/s", "Unit_RadianPerSecond",
                                      "rads/s", "rad*s^-1", "rad per sec"}) {
    EXPECT_DOUBLE_EQ(converted(Dimension::kRate, unit, 6.0 * kRad), 6.0) << unit;
  }
  for (const std::string_view unit : {"mdeg/s", "m°/s", "millidegrees/second", "mdeg per sec"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kRate, unit, 6000.0), 6.0) << unit;
  for (const std::string_view unit : {"deg/min", "°/minute"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kRate, unit, 360.0), 6.0) << unit;
  for (const std::string_view unit : {"deg/hr", "°/hour", "Grad/Std"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kRate, unit, 21600.0), 6.0) << unit;
  for (const std::string_view unit :
       {"m/sec", "s", "/s", "per s", "degs", "deg/", "deg/s/s", "deg/s^-1^-1", "m", "Unit_None",
        "min/s", "deg/m", "unit", "mm/s", "gradient/s"}) {
    EXPECT_FALSE(convert_unit(Dimension::kRate, unit)) << unit;
  }
}

// 5 V in every spelling is 5 V.
TEST(Units, TurnEveryVoltageIntoVolts) {
  EXPECT_DOUBLE_EQ(converted(Dimension::kVoltage, "V", 5.0), 5.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kVoltage, "Volt", 5.0), 5.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kVoltage, "mV", 4950.0), 4.95);
  EXPECT_FALSE(convert_unit(Dimension::kVoltage, "degC"));
}

// Water freezes at 0 degC in every unit.
TEST(Units, TurnEveryTemperatureIntoCelsius) {
  EXPECT_DOUBLE_EQ(converted(Dimension::kTemperature, "degC", 20.0), 20.0);
  EXPECT_NEAR(converted(Dimension::kTemperature, "K", 273.15), 0.0, 1e-12);
  EXPECT_NEAR(converted(Dimension::kTemperature, "degF", 32.0), 0.0, 1e-12);
  EXPECT_NEAR(converted(Dimension::kTemperature, "degF", 212.0), 100.0, 1e-12);
}

// Standard gravity and the mile are definitions, so the factors must be exact.
TEST(Units, TurnAccelerationIntoGAndSpeedIntoMetresPerSecond) {
  EXPECT_DOUBLE_EQ(converted(Dimension::kAcceleration, "m/s^2", 9.80665), 1.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kAcceleration, "mg", 1000.0), 1.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kSpeed, "km/h", 36.0), 10.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kSpeed, "mph", 1.0), 0.44704);
}

// DBC authors differ in letter case and blanks.
TEST(Units, IgnoreLetterCaseAndBlanks) {
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, " Deg / S ", 1.0), 1.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kRate, "RAD/S", std::numbers::pi), 180.0);
  EXPECT_DOUBLE_EQ(converted(Dimension::kSpeed, "Km/H", 3.6), 1.0);
}

// Spellings of temperature, acceleration and speed, too; "Â°" is UTF-8 that was taken for cp1252.
TEST(Units, AreKnownAsPublicFilesWriteThem) {
  for (const std::string_view unit : {"ºC", "˚C", "℃", "Â°C", "deg C", "degrees C",
                                      "Degree Celsius", "Grad C", "Unit_DegreCelsi"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kTemperature, unit, 20.0), 20.0) << unit;
  for (const std::string_view unit : {"m/s**2", "m/sec^2", "m/ss", "Unit_MeterPerSeconSquar"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kAcceleration, unit, 9.80665), 1.0) << unit;
  for (const std::string_view unit : {"km/hr", "KPH", "kmph", "Unit_KiloMeterPerHour"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kSpeed, unit, 36.0), 10.0) << unit;
  for (const std::string_view unit : {"º/s", "˚/s", "Â°/s", "°/Sek", "Grad/sec"})
    EXPECT_DOUBLE_EQ(converted(Dimension::kRate, unit, 6.0), 6.0) << unit;
}

// A unit of another dimension is not a rate with an odd scale: m/s must not be accepted as deg/s.
TEST(Units, RefuseOtherDimensions) {
  for (const std::string_view unit : {"m/s", "deg", "V", "", "g", "degC", "deg/s^2", "rad"}) {
    EXPECT_FALSE(convert_unit(Dimension::kRate, unit)) << unit;
  }
  EXPECT_FALSE(convert_unit(Dimension::kTemperature, "deg/s"));
  EXPECT_FALSE(convert_unit(Dimension::kAcceleration, "m/s"));
  EXPECT_FALSE(convert_unit(Dimension::kSpeed, "m/s^2"));
}

// The units that an error recommends must be accepted.
TEST(Units, RecommendOnlyWhatIsAccepted) {
  for (const Dimension dimension :
       {Dimension::kRate, Dimension::kTemperature, Dimension::kAcceleration, Dimension::kSpeed,
        Dimension::kVoltage}) {
    std::string_view rest = recommended_units(dimension);
    ASSERT_FALSE(rest.empty());
    while (!rest.empty()) {
      const std::string_view unit = rest.substr(0, rest.find(", "));
      EXPECT_TRUE(convert_unit(dimension, unit)) << unit;
      rest.remove_prefix(std::min(rest.size(), unit.size() + 2));
    }
  }
}

}  // namespace
}  // namespace vgyro::gateway
