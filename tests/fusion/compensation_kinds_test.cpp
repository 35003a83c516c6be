// The readings of a gyro and their correction in the live path, for every kind of the catalogue: a
// new row is tested here without being named.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "fusion/compensation.h"
#include "model/catalogue.h"
#include "model/equation.h"
#include "model/temperature_past.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using model::Effect;
using model::Equation;
using model::KindInfo;
using model::Nature;
using model::Parameter;
using model::Surroundings;

constexpr std::uint64_t kSeed = 4711;
constexpr int kParameterSets = 12;
constexpr int kPlaces = 12;
constexpr int kCombinations = 1000;
constexpr std::uint64_t kEffectsMost = 12;
/// Half a step of VG_Rate in dbc/vgyro_fd.dbc; dbc/vgyro.dbc has steps fifty times as wide.
constexpr double kWire_dps = 0.5e-6;
constexpr double kRateMost_dps = 300.0;
constexpr double kRateStep_dps = 12.5;
// Responses that a gyro can have: a slope of at least a tenth and at most two, nearly the same at
// all rates. The search for the rate begins at the reading, which must lie within the model's
// range.
constexpr double kSlopeLeast = 0.1;
constexpr double kSlopeMost = 2.0;
constexpr double kBendMost = 0.3;

bool is_strength(const Parameter& parameter) {
  return parameter.form == Parameter::Form::kNumber && !parameter.preset &&
         parameter.minimum <= 0.0;
}

double drawn(const Parameter& parameter, Random& random) {
  if (parameter.form != Parameter::Form::kNumber) {
    const double choices = parameter.maximum - parameter.minimum + 1.0;
    return parameter.minimum +
           static_cast<double>(random.below(static_cast<std::uint64_t>(choices)));
  }
  if (parameter.preset) {
    const double reference = *parameter.preset + random.uniform(-60.0, 60.0);
    return std::clamp(reference, parameter.minimum, parameter.maximum);
  }
  if (!is_strength(parameter)) {
    const double powers = std::log(parameter.maximum / parameter.minimum);
    return parameter.minimum * std::exp(random.uniform(0.0, powers));
  }
  const bool negative = parameter.minimum < 0.0 && random.below(2) == 0;
  const double limit = negative ? parameter.minimum : parameter.maximum;
  return limit * std::pow(10.0, random.uniform(-8.0, 0.0));
}

Effect drawn(const KindInfo& row, Random& random) {
  Effect effect{.gyro = 0, .kind = row.kind};
  for (std::size_t i = 0; i < row.parameters.size(); ++i) {
    effect.parameters[i] = drawn(row.parameters[i], random);
    EXPECT_TRUE(row.parameters[i].allows(effect.parameters[i])) << row.name;
  }
  return effect;
}

model::TemperaturePast past_of(std::initializer_list<double> temperatures_c) {
  model::TemperaturePast past;
  for (const double temperature_c : temperatures_c)
    past.add(temperature_c);
  return past;
}

/// Every input that may be unknown is unknown now and then.
Surroundings somewhere(Random& random, bool may_be_unknown) {
  const auto known = [&](double from, double to) {
    const double value = random.uniform(from, to);
    return may_be_unknown && random.below(4) == 0 ? Surroundings::kUnknown : value;
  };
  Surroundings s{.t_s = random.uniform(0.0, 1000.0), .angle_rad = random.uniform(-3.0, 3.0)};
  s.temperature_c = known(-40.0, 85.0);
  s.temperature_slope_c_s = known(-0.1, 0.1);
  for (double& axis_g : s.acceleration_g)
    axis_g = known(-2.0, 2.0);
  s.vibration_g2 = known(0.0, 0.1);
  s.supply_v = known(3.0, 14.0);
  for (double& rate_dps : s.other_rate_dps)
    rate_dps = known(-100.0, 100.0);
  static const model::TemperaturePast past = past_of({20.0, 90.0, -45.0, 30.0, 10.0});
  s.temperature_past = may_be_unknown && random.below(4) == 0 ? nullptr : &past;
  return s;
}

/// Computed from differences of readings, not from the slopes that the correction uses.
bool a_gyro_could_have(const std::vector<Effect>& effects, const Surroundings& s) {
  const Equation equation(effects);
  double least = 1e300;
  double most = -1e300;
  for (double rate = -kRateMost_dps; rate < kRateMost_dps; rate += kRateStep_dps) {
    const double rise =
        (equation.reading_dps(rate + kRateStep_dps, s) - equation.reading_dps(rate, s)) /
        kRateStep_dps;
    least = std::min(least, rise);
    most = std::max(most, rise);
  }
  return least >= kSlopeLeast && most <= kSlopeMost && most - least <= kBendMost * least;
}

/// Weakens the responses until a gyro can have them.
void tame(std::vector<Effect>& effects, const Surroundings& s) {
  while (!a_gyro_could_have(effects, s)) {
    for (Effect& effect : effects) {
      const KindInfo& row = model::info(effect.kind);
      if (row.nature != Nature::kResponse) continue;
      for (std::size_t i = 0; i < row.parameters.size(); ++i)
        effect.parameters[i] *= is_strength(row.parameters[i]) ? 0.5 : 1.0;
    }
  }
}

std::string text_of(const std::vector<Effect>& effects) {
  std::string text;
  for (const Effect& effect : effects)
    text += std::string(model::info(effect.kind).name) + " " + parameters_text(effect) + "; ";
  return text;
}

/// Returns the largest change of a reading by the effects.
double expect_taken_back(std::vector<Effect> effects, const Surroundings& s) {
  tame(effects, s);
  const Equation equation(effects);
  const Compensation compensation(effects);
  double moved_dps = 0.0;
  for (double rate = -kRateMost_dps; rate <= kRateMost_dps; rate += kRateStep_dps) {
    const double reading = equation.reading_dps(rate, s);
    moved_dps = std::max(moved_dps, std::abs(reading - rate));
    EXPECT_NEAR(compensation.correct(reading, s), rate, kWire_dps) << text_of(effects);
  }
  return moved_dps;
}

/// Behind a low-pass a ramp is late by 1 / (2 pi cutoff).
void expect_dated_back(const std::vector<Effect>& effects, const Surroundings& s, Random& random) {
  const Equation equation(effects);
  const Compensation compensation(effects);
  const double start_dps = random.uniform(-50.0, 50.0);
  const double slope_dps_s = random.uniform(-100.0, 100.0);
  const auto ramp = [&](double t_s) { return start_dps + slope_dps_s * t_s; };
  double group_delay_s = 0.0;
  for (const double cutoff_hz : equation.cutoffs_hz())
    group_delay_s += 1.0 / (2.0 * std::numbers::pi * cutoff_hz);
  for (const model::SecondOrder& second : equation.second_orders())
    group_delay_s += second.damping / (std::numbers::pi * second.cutoff_hz);
  const auto low_passed = [&](double t_s) { return ramp(t_s - group_delay_s); };
  const double t_s = random.uniform(0.0, 1.0);
  const double rate_dps = compensation.correct(equation.late_rate_dps(low_passed, t_s), s);
  EXPECT_NEAR(rate_dps, ramp(t_s - to_seconds(compensation.lag())), kWire_dps) << text_of(effects);
}

/// Effects that are random, lose frames, or concern frames and clocks leave the reading unchanged.
void expect_left(const std::vector<Effect>& effects, const Surroundings& s) {
  const Equation equation(effects);
  const Compensation compensation(effects);
  EXPECT_FALSE(compensation.takes_any()) << text_of(effects);
  EXPECT_EQ(compensation.lag(), Duration{0}) << text_of(effects);
  for (double rate = -kRateMost_dps; rate <= kRateMost_dps; rate += kRateStep_dps) {
    EXPECT_EQ(equation.reading_dps(rate, s), rate);
    const double finished = equation.clipped_dps(rate);
    EXPECT_EQ(compensation.correct(finished, s), finished) << text_of(effects);
  }
  const double true_s = equation.true_time_s(equation.stamp_s(s.t_s));
  EXPECT_NEAR(true_s, s.t_s, 1e-9) << text_of(effects);
}

TEST(CompensationKinds, EachIsTakenBackDatedBackOrLeft) {
  RecordProperty("seed", std::to_string(kSeed));
  Random random(kSeed);
  for (const KindInfo& row : model::catalogue()) {
    SCOPED_TRACE(::testing::Message() << row.name << ", seed " << kSeed);
    double moved_dps = 0.0;
    for (int i = 0; i < kParameterSets * kPlaces; ++i) {
      const std::vector<Effect> one{drawn(row, random)};
      const Surroundings s = somewhere(random, false);
      switch (row.nature) {
        case Nature::kOffset:
        case Nature::kResponse:
          moved_dps = std::max(moved_dps, expect_taken_back(one, s));
          break;
        case Nature::kLag:
          expect_dated_back(one, s, random);
          break;
        case Nature::kClip:
        case Nature::kNoise:
        case Nature::kDisturbance:
          expect_left(one, s);
          break;
      }
    }
    const bool moves = row.nature == Nature::kOffset || row.nature == Nature::kResponse;
    EXPECT_EQ(moved_dps > 1e3 * kWire_dps, moves) << "there was nothing to take back";
  }
}

TEST(CompensationKinds, SeveralAtOnceAreTakenBackTogether) {
  RecordProperty("seed", std::to_string(kSeed));
  Random random(kSeed);
  const auto kinds = model::catalogue();
  for (int i = 0; i < kCombinations; ++i) {
    SCOPED_TRACE(::testing::Message() << "combination " << i << ", seed " << kSeed);
    std::vector<Effect> effects;
    for (std::uint64_t count = 1 + random.below(kEffectsMost); count > 0; --count)
      effects.push_back(drawn(kinds[random.below(kinds.size())], random));
    expect_taken_back(effects, somewhere(random, true));
    std::erase_if(effects, [](const Effect& effect) {
      const Nature nature = model::info(effect.kind).nature;
      return nature == Nature::kOffset || nature == Nature::kResponse;
    });
    expect_dated_back(effects, somewhere(random, true), random);
  }
}

/// Conditions in which an effect adds nothing, by docs/model-file.md: temperature and voltage
/// steady at the effect's reference, no acceleration.
Surroundings at_reference(const Effect& effect) {
  Surroundings s{.t_s = 10.0, .temperature_c = 25.0, .temperature_slope_c_s = 0.0};
  s.acceleration_g = {0.0, 0.0, 0.0};
  s.vibration_g2 = 0.0;
  s.other_rate_dps = {0.0, 0.0, 0.0};
  const auto parameters = model::info(effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].preset) s.temperature_c = s.supply_v = effect.parameters[i];
  }
  return s;
}

TEST(CompensationKinds, WhatIsNotKnownIsTakenForItsReference) {
  RecordProperty("seed", std::to_string(kSeed));
  Random random(kSeed);
  for (const KindInfo& row : model::catalogue()) {
    if (row.needs == model::kNeedsNothing) continue;
    for (int i = 0; i < kParameterSets; ++i) {
      std::vector<Effect> one{drawn(row, random)};
      const Surroundings unknown{.t_s = 10.0};
      const double rate_dps = random.uniform(-kRateMost_dps, kRateMost_dps);
      const double reading_dps = Equation(one).reading_dps(rate_dps, at_reference(one[0]));
      EXPECT_NEAR(reading_dps, rate_dps, kWire_dps) << text_of(one);
      EXPECT_NEAR(Compensation(one).correct(reading_dps, unknown), rate_dps, kWire_dps)
          << text_of(one) << "seed " << kSeed;
    }
  }
}

}  // namespace
}  // namespace vgyro::fusion
