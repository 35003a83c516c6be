#include "model/catalogue.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "model/temperature_past.h"

namespace vgyro::model {
namespace {

/// Up to 35 degC and back to 31: 4 K below the highest, 11 K above the first.
const TemperaturePast& a_day_so_far() {
  static const TemperaturePast past = [] {
    TemperaturePast day;
    for (const double temperature_c : {20.0, 35.0, 31.0})
      day.add(temperature_c);
    return day;
  }();
  return past;
}

Surroundings a_day_in_the_car() {
  return {.t_s = 20.0,
          .temperature_c = 31.0,
          .temperature_slope_c_s = 0.02,
          .temperature_past = &a_day_so_far(),
          .acceleration_g = {0.1, -0.2, 0.98},
          .vibration_g2 = 0.004,
          .supply_v = 5.2,
          .other_rate_dps = {3.0, -7.0, 0.5},
          .angle_rad = 0.7};
}

double added(Kind kind, Parameters parameters, double rate_dps) {
  return added_dps({.gyro = 0, .kind = kind, .parameters = parameters}, rate_dps,
                   a_day_in_the_car());
}

// Computed by hand from the table in docs/model-file.md.
TEST(Catalogue, AddsWhatTheTableSays) {
  EXPECT_DOUBLE_EQ(added(Kind::kBias, {0.3}, -5.0), 0.3);
  EXPECT_DOUBLE_EQ(added(Kind::kBiasRamp, {1e-3}, -5.0), 0.02);
  EXPECT_DOUBLE_EQ(added(Kind::kBiasStep, {0.5, 20.0}, -5.0), 0.5);
  EXPECT_DOUBLE_EQ(added(Kind::kBiasStep, {0.5, 20.001}, -5.0), 0.0);
  EXPECT_DOUBLE_EQ(added(Kind::kWarmUp, {0.2, 10.0}, -5.0), 0.2 * std::exp(-2.0));
  EXPECT_DOUBLE_EQ(added(Kind::kRunIn, {0.2, 10.0}, -5.0), 0.2 * std::log(3.0));
  EXPECT_DOUBLE_EQ(added(Kind::kTemperatureBias, {1e-3, 25.0}, -5.0), 6e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kTemperatureBiasQuadratic, {1e-3, 41.0}, -5.0), 0.1);
  EXPECT_DOUBLE_EQ(added(Kind::kTemperatureRateBias, {0.5}, -5.0), 0.01);
  // With a play of 3 K the follower was dragged to 32 and stays there, with 1 K it was dragged
  // back.
  EXPECT_DOUBLE_EQ(added(Kind::kTemperatureHysteresis, {1e-3, 3.0}, -5.0), 1e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kTemperatureHysteresis, {1e-3, 1.0}, -5.0), 1e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kTemperatureHysteresis, {1e-3, 14.0}, -5.0), -10e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kScaleFactor, {1e-3}, -5.0), -5e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kScaleFactorAsymmetry, {1e-3}, -5.0), 5e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kScaleFactorQuadratic, {1e-3}, -5.0), 25e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kScaleFactorCubic, {1e-3}, -5.0), -125e-3);
  EXPECT_DOUBLE_EQ(added(Kind::kScaleFactorTemperature, {1e-3, 21.0}, -5.0), -0.05);
  EXPECT_DOUBLE_EQ(added(Kind::kGSensitivity, {1.0, 0.01}, -5.0), -0.002);
  EXPECT_DOUBLE_EQ(added(Kind::kCrossAxis, {1.0, 0.01}, -5.0), -0.07);
  EXPECT_DOUBLE_EQ(added(Kind::kVibrationRectification, {2.0}, -5.0), 0.008);
  EXPECT_NEAR(added(Kind::kSupplyVoltageBias, {0.03, 5.0}, -5.0), 0.006, 1e-15);
  EXPECT_DOUBLE_EQ(added(Kind::kAngleHarmonic, {4.0, 0.1, 1.0}, -5.0), 0.1 * std::cos(3.8));
  EXPECT_NEAR(added(Kind::kLine, {1.2125, 0.1, 0.3}, -5.0),
              0.1 * std::sin(2.0 * std::numbers::pi * 0.25 + 0.3), 1e-14);
}

TEST(Catalogue, SlopesAreTheDerivatives) {
  const double h = 1e-4;
  for (const KindInfo& row : catalogue()) {
    ASSERT_EQ(row.slope != nullptr, row.nature == Nature::kResponse) << row.name;
    ASSERT_EQ(row.added != nullptr,
              row.nature == Nature::kResponse || row.nature == Nature::kOffset)
        << row.name;
    if (row.slope == nullptr) continue;
    for (const double rate_dps : {-90.0, -1.0, 0.5, 200.0}) {
      const Parameters p{1e-3, 20.0};
      const Surroundings s = a_day_in_the_car();
      const double difference = row.added(p, rate_dps + h, s) - row.added(p, rate_dps - h, s);
      EXPECT_NEAR(row.slope(p, rate_dps, s), difference / (2.0 * h), 1e-8) << row.name;
    }
  }
}

TEST(Catalogue, AddsNothingForWhatIsNotKnown) {
  for (const KindInfo& row : catalogue()) {
    if (row.needs == kNeedsNothing) continue;
    EXPECT_EQ(added_dps({.gyro = 0, .kind = row.kind, .parameters = {1.0, 1.0}}, 5.0, {}), 0.0)
        << row.name;
  }
}

TEST(Catalogue, ClipsReadings) {
  const auto clipped = [](Kind kind, double parameter, double reading_dps) {
    return clipped_dps({.gyro = 0, .kind = kind, .parameters = {parameter}}, reading_dps);
  };
  EXPECT_EQ(clipped(Kind::kSaturation, 100.0, -130.0), -100.0);
  EXPECT_EQ(clipped(Kind::kSaturation, 100.0, 99.0), 99.0);
  EXPECT_EQ(clipped(Kind::kDeadBand, 0.5, -0.49), 0.0);
  EXPECT_EQ(clipped(Kind::kDeadBand, 0.5, -0.5), -0.5);
  EXPECT_EQ(clipped(Kind::kQuantization, 0.25, 0.4), 0.5);
}

TEST(Catalogue, LagOfALowPassIsItsGroupDelay) {
  EXPECT_DOUBLE_EQ(lag_s({.gyro = 0, .kind = Kind::kDelay, .parameters = {0.004}}), 0.004);
  EXPECT_DOUBLE_EQ(lag_s({.gyro = 0, .kind = Kind::kBandwidth, .parameters = {10.0}}),
                   1.0 / (20.0 * std::numbers::pi));
  EXPECT_DOUBLE_EQ(
      lag_s({.gyro = 0, .kind = Kind::kBandwidthSecondOrder, .parameters = {10.0, 0.7}}),
      0.7 / (10.0 * std::numbers::pi));
}

// Every parameter at either limit, in any surroundings: nothing overflows.
TEST(Catalogue, StaysFiniteAtTheLimitsOfItsParameters) {
  for (const KindInfo& row : catalogue()) {
    for (unsigned corner = 0; corner < 1U << row.parameters.size(); ++corner) {
      Effect effect{.gyro = 0, .kind = row.kind};
      for (std::size_t i = 0; i < row.parameters.size(); ++i) {
        const Parameter& p = row.parameters[i];
        effect.parameters[i] = (corner >> i & 1U) != 0 ? p.maximum : std::max(p.minimum, p.least);
        EXPECT_TRUE(p.allows(effect.parameters[i])) << row.name << " " << p.name;
      }
      for (const double rate_dps : {-1e5, 0.0, 1e5}) {
        double sum_dps = 0.0;
        if (row.added != nullptr) sum_dps += added_dps(effect, rate_dps, a_day_in_the_car());
        if (row.slope != nullptr) sum_dps += slope(effect, rate_dps, a_day_in_the_car());
        if (row.nature == Nature::kClip) sum_dps += clipped_dps(effect, rate_dps);
        if (row.nature == Nature::kLag) sum_dps += lag_s(effect);
        EXPECT_TRUE(std::isfinite(sum_dps)) << row.name << " corner " << corner;
      }
    }
  }
}

// The names are a format: files and other programs depend on them.
TEST(Catalogue, KeepsTheNamesOfTheFormat) {
  std::string names;
  for (const KindInfo& row : catalogue()) {
    names += std::string(row.name) + ":";
    for (const Parameter& parameter : row.parameters)
      names += " " + std::string(parameter.name);
    names += "\n";
    EXPECT_EQ(find_kind(row.name), &row);
    EXPECT_EQ(&info(row.kind), &row);
  }
  EXPECT_EQ(names,
            "bias: value_dps\nbias_ramp: slope_dps_s\nbias_step: size_dps at_s\n"
            "warm_up: amplitude_dps tau_s\ntemperature_bias: coefficient_dps_k reference_c\n"
            "temperature_bias_quadratic: coefficient_dps_k2 reference_c\n"
            "temperature_rate_bias: coefficient_dps_s_k\nscale_factor: error\n"
            "scale_factor_asymmetry: error\nscale_factor_quadratic: coefficient_per_dps\n"
            "scale_factor_cubic: coefficient_per_dps2\n"
            "scale_factor_temperature: coefficient_per_k reference_c\n"
            "g_sensitivity: axis coefficient_dps_g\nvibration_rectification: coefficient_dps_g2\n"
            "delay: seconds\nbandwidth: cutoff_hz\n"
            "angle_harmonic: harmonic amplitude_dps phase_rad\n"
            "line: frequency_hz amplitude_dps phase_rad\nsaturation: limit_dps\n"
            "dead_band: width_dps\nquantization: step_dps\nwhite_noise: density_dps_rthz\n"
            "rate_random_walk: density_dps_rts\ngauss_markov: sigma_dps tau_s\n"
            "rate_noise: ratio_rthz\nspikes: rate_hz size_dps\nstuck: from_s to_s\n"
            "dropped_frames: fraction\nclock_skew: ppm\ntimestamp_jitter: sigma_s\n"
            "supply_voltage_bias: coefficient_dps_v reference_v\n"
            "run_in: coefficient_dps tau_s\ntemperature_hysteresis: coefficient_dps_k play_k\n"
            "bias_instability: coefficient_dps\ncross_axis: from coefficient\n"
            "bandwidth_second_order: cutoff_hz damping\n");
}

}  // namespace
}  // namespace vgyro::model
