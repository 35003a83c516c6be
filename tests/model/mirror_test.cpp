#include "model/mirror.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "model/temperature_past.h"

namespace vgyro::model {
namespace {

// Within the limits of every kind; axes are 0, 1 or 2.
Parameters some_parameters(const KindInfo& kind, std::mt19937& random) {
  Parameters parameters{};
  for (std::size_t i = 0; i < kind.parameters.size(); ++i) {
    const Parameter& parameter = kind.parameters[i];
    const double low = std::max(parameter.minimum, -3.0);
    const double high = std::min(parameter.maximum, 3.0);
    double value = std::uniform_real_distribution(low, high)(random);
    if (parameter.form != Parameter::Form::kNumber) value = std::round(value);
    parameters[i] = std::clamp(value, parameter.minimum, parameter.maximum);
  }
  return parameters;
}

Surroundings some_surroundings(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-2.0, 2.0);
  Surroundings around;
  around.t_s = 50.0 + any(random);
  around.temperature_c = 25.0 + 5.0 * any(random);
  around.temperature_slope_c_s = any(random);
  around.acceleration_g = {any(random), any(random), any(random)};
  around.vibration_g2 = 2.0 + any(random);
  around.supply_v = 5.0 + any(random);
  around.other_rate_dps = {any(random), any(random), any(random)};
  around.angle_rad = any(random);
  return around;
}

// The law: a gyro that is turned over reads the negative of its reading at the negative rate.
TEST(Mirror, IsWhatAGyroReadsThatIsTurnedOver) {
  std::mt19937 random(1);
  for (const KindInfo& kind : catalogue()) {
    if (kind.added == nullptr) continue;
    for (int trial = 0; trial < 20; ++trial) {
      const Effect effect{.kind = kind.kind, .parameters = some_parameters(kind, random)};
      TemperaturePast past;
      past.add(20.0);
      past.add(32.0);
      past.add(24.0);
      Surroundings around = some_surroundings(random);
      around.temperature_past = &past;
      const double rate_dps = std::uniform_real_distribution(-9.0, 9.0)(random);
      const double reads_dps = rate_dps + added_dps(effect, rate_dps, around);
      Surroundings over = around;
      over.angle_rad = -around.angle_rad;
      const double over_dps = -rate_dps + added_dps(mirrored(effect), -rate_dps, over);
      EXPECT_NEAR(reads_dps, -over_dps, 1e-9 * (1.0 + std::abs(reads_dps))) << kind.name;
    }
  }
}

TEST(Mirror, IsItsOwnInverse) {
  std::mt19937 random(2);
  for (const KindInfo& kind : catalogue()) {
    for (int trial = 0; trial < 20; ++trial) {
      const Effect effect{.gyro = 1,
                          .kind = kind.kind,
                          .parameters = some_parameters(kind, random),
                          .sigma = {0.1, 0.2, 0.3},
                          .ambiguous = true,
                          .of_axis = 2};
      const Effect twice = mirrored(mirrored(effect));
      EXPECT_EQ(twice.sigma, effect.sigma) << kind.name;
      EXPECT_EQ(twice.of_axis, effect.of_axis) << kind.name;
      for (std::size_t i = 0; i < kind.parameters.size(); ++i)
        EXPECT_NEAR(twice.parameters[i], effect.parameters[i], 1e-12) << kind.name;
    }
  }
}

TEST(Mirror, StaysWithinTheLimitsOfTheFormat) {
  std::mt19937 random(3);
  for (const KindInfo& kind : catalogue()) {
    const Effect image = mirrored({.kind = kind.kind, .parameters = some_parameters(kind, random)});
    for (std::size_t i = 0; i < kind.parameters.size(); ++i)
      EXPECT_TRUE(kind.parameters[i].allows(image.parameters[i])) << kind.name;
  }
}

}  // namespace
}  // namespace vgyro::model
