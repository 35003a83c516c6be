#include "gap/kinds.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "gap/evidence.h"
#include "model/catalogue.h"
#include "model/equation.h"
#include "model/temperature_past.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;
using model::Nature;
using model::Parameters;

// Parameters that a gyro may have, in the order of the catalogue.
Parameters usual(Kind kind) {
  switch (kind) {
    case Kind::kBiasStep:
      return {0.01, 20.0};
    case Kind::kWarmUp:
    case Kind::kRunIn:
      return {0.05, 12.0};
    case Kind::kTemperatureBias:
    case Kind::kTemperatureBiasQuadratic:
    case Kind::kScaleFactorTemperature:
      return {1e-3, 25.0};
    case Kind::kTemperatureHysteresis:
      return {1e-3, 1.0};
    case Kind::kGSensitivity:
    case Kind::kCrossAxis:
      return {1.0, 0.01};
    case Kind::kDelay:
      return {0.012};
    case Kind::kBandwidth:
      return {5.0};
    case Kind::kBandwidthSecondOrder:
      return {5.0, 0.7};
    case Kind::kAngleHarmonic:
      return {3.0, 0.02, 1.1};
    case Kind::kLine:
      return {4.7, 0.02, 1.1};
    case Kind::kGaussMarkov:
      return {1e-3, 30.0};
    case Kind::kClockSkew:
      return {80.0};
    case Kind::kSpikes:
      return {0.1, 2.0};
    case Kind::kStuck:
      return {10.0, 11.0};
    default:
      return {1e-3};
  }
}

std::string name(Kind kind) {
  return std::string(model::info(kind).name);
}

bool is_scanned(Kind kind) {
  const Finder finder = row(kind).finder;
  return finder == Finder::kShape || finder == Finder::kStep || finder == Finder::kLine;
}

TEST(Kinds, HaveARowEachUnderTheirOwnName) {
  ASSERT_EQ(kinds().size(), model::kKindCount);
  for (const model::KindInfo& info : model::catalogue())
    EXPECT_EQ(*row(info.kind).kind, info.kind) << info.name;
  for (const InputRow& input : inputs())
    EXPECT_EQ(&input_row(input.input), &input);
  EXPECT_EQ(inputs().size(), kInputCount);
}

TEST(Kinds, EstimateOnlyParametersThatTheCatalogueHas) {
  for (const KindRow& its : kinds()) {
    const auto parameters = model::info(its.kind).parameters;
    std::set<std::size_t> seen;
    for (const Free& free : *its.free) {
      ASSERT_LT(free.parameter, parameters.size()) << name(its.kind);
      EXPECT_EQ(parameters[free.parameter].form, model::Parameter::Form::kNumber) << name(its.kind);
      EXPECT_TRUE(seen.insert(free.parameter).second) << name(its.kind);
      if (!free.linear) {
        EXPECT_GT(free.step, 0.0) << name(its.kind);
      }
    }
    for (const Bound& bound : *its.bounds) {
      ASSERT_LT(bound.parameter, parameters.size()) << name(its.kind);
      EXPECT_GE(bound.least, parameters[bound.parameter].minimum) << name(its.kind);
      EXPECT_LE(bound.most, parameters[bound.parameter].maximum) << name(its.kind);
      EXPECT_LT(bound.least, bound.most) << name(its.kind);
    }
    // Standard errors are told of something that was estimated.
    if (its.errors_of == kNoErrors || its.finder == Finder::kFrames) continue;
    EXPECT_TRUE(seen.contains(its.errors_of)) << name(its.kind);
  }
}

// Twice the parameter adds twice as much, by the catalogue's equation: where a row says so.
TEST(Kinds, AreLinearInWhatTheirRowSays) {
  for (const KindRow& its : kinds()) {
    if (model::info(its.kind).added == nullptr) continue;
    for (const Free& free : *its.free) {
      for (const double t_s : {3.0, 30.0, 300.0}) {
        model::Surroundings s;
        s.t_s = t_s;
        s.temperature_c = 31.0;
        s.temperature_slope_c_s = 0.02;
        s.acceleration_g = {0.1, -0.2, 0.97};
        s.vibration_g2 = 2e-3;
        s.other_rate_dps = {3.0, -2.0, 0.4};
        s.angle_rad = 0.7;
        const auto added = [&](double value) {
          Effect effect{0, its.kind, usual(its.kind), 0};
          effect.parameters[free.parameter] = value;
          return model::added_dps(effect, 37.0, s);
        };
        if (free.linear) {
          EXPECT_EQ(added(0.0), 0.0) << name(its.kind);
          EXPECT_NEAR(added(2.0), 2.0 * added(1.0), 1e-12 * std::abs(added(2.0))) << name(its.kind);
        }
      }
    }
  }
}

// A start is a shape of size 1, whose size the scan solves for; all else of it must be allowed.
TEST(Kinds, StartWithinTheirLimits) {
  for (const KindRow& its : kinds()) {
    const auto parameters = model::info(its.kind).parameters;
    for (const Parameters& start : *its.starts) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        if (its.form == Form::kSize && i == (*its.free)[0].parameter) {
          EXPECT_EQ(start[i], 1.0) << name(its.kind);
          continue;
        }
        EXPECT_TRUE(parameters[i].allows(start[i])) << name(its.kind) << ", " << start[i];
        Effect effect{0, its.kind, start, 0};
        clamp(effect);
        EXPECT_EQ(effect.parameters[i], start[i]) << name(its.kind);
      }
    }
  }
}

// Whatever can be in a model file is looked for, by those who could see it.
TEST(Kinds, EachIsLookedForBySomebody) {
  std::set<Random> parts;
  for (const model::KindInfo& info : model::catalogue()) {
    const KindRow& its = row(info.kind);
    switch (info.nature) {
      case Nature::kOffset:
      case Nature::kResponse:
        EXPECT_TRUE(is_scanned(info.kind)) << info.name;
        EXPECT_FALSE(model::moves_in_time(its.kind)) << info.name;
        break;
      case Nature::kLag:
        EXPECT_TRUE(is_scanned(info.kind)) << info.name;
        EXPECT_TRUE(model::moves_in_time(its.kind)) << info.name;
        break;
      case Nature::kNoise:
        EXPECT_EQ(*its.finder, Finder::kNoise) << info.name;
        EXPECT_TRUE(parts.insert(its.random).second) << info.name;
        break;
      case Nature::kClip:
        EXPECT_EQ(*its.finder, Finder::kFrames) << info.name;
        break;
      case Nature::kDisturbance:
        EXPECT_EQ(*its.finder, info.kind == Kind::kClockSkew ? Finder::kShape : Finder::kFrames)
            << info.name;
        break;
    }
  }
  EXPECT_EQ(parts, (std::set<Random>{Random::kWhite, Random::kRatio, Random::kWalk, Random::kMarkov,
                                     Random::kFlicker}));
}

// What the equation needs to know must move, or nothing of it can be seen.
TEST(Kinds, NeedWhatTheirEquationNeeds) {
  const Inputs temperature = bit(Input::kTemperature) | bit(Input::kTemperatureSlope);
  const Inputs acceleration = bit(Input::kAccelerationX) | bit(Input::kAccelerationY) |
                              bit(Input::kAccelerationZ) | bit(Input::kVibration);
  for (const model::KindInfo& info : model::catalogue()) {
    const Inputs needs = row(info.kind).needs;
    EXPECT_EQ((needs & temperature) != 0, (info.needs & model::kNeedsTemperature) != 0)
        << info.name;
    EXPECT_EQ((needs & acceleration) != 0, (info.needs & model::kNeedsAcceleration) != 0)
        << info.name;
    const Inputs other_axes = bit(Input::kRateX) | bit(Input::kRateY) | bit(Input::kRateZ);
    EXPECT_EQ((needs & other_axes) != 0, (info.needs & model::kNeedsOtherAxes) != 0) << info.name;
    const bool of_rate = info.nature == Nature::kResponse || info.nature == Nature::kLag;
    if (of_rate) {
      EXPECT_NE(needs & bit(Input::kRate), 0) << info.name;
    }
    const bool has_axis =
        !info.parameters.empty() && info.parameters[0].form == model::Parameter::Form::kAxis;
    EXPECT_EQ(*row(info.kind).by_axis, has_axis) << info.name;
  }
}

TEST(Kinds, NeedTheAxisThatTheyAreOf) {
  const auto needs = [](double axis) {
    return needs_of({0, Kind::kGSensitivity, {axis, 0.01}, 0});
  };
  EXPECT_EQ(needs(0.0), bit(Input::kAccelerationX));
  EXPECT_EQ(needs(1.0), bit(Input::kAccelerationY));
  EXPECT_EQ(needs(2.0), bit(Input::kAccelerationZ));
  // The first parameter of others is no axis.
  EXPECT_EQ(needs_of({0, Kind::kScaleFactor, {2.0}, 0}), bit(Input::kRate));
  EXPECT_EQ(needs_of({0, Kind::kBias, {2.0}, 0}), 0);
}

TEST(Kinds, InputsAreReadWhereTheyStand) {
  model::Surroundings s;
  s.temperature_c = 20.0;
  s.temperature_slope_c_s = 0.5;
  s.acceleration_g = {0.1, 0.2, 0.3};
  s.vibration_g2 = 0.04;
  s.supply_v = 4.9;
  s.other_rate_dps = {-3.0, -4.0, -5.0};
  const std::array<double, kInputCount> truth{7.0,  20.0, 0.5,  0.1,  0.2, 0.3,
                                              0.04, 4.9,  -3.0, -4.0, -5.0};
  for (std::size_t i = 0; i < kInputCount; ++i) {
    EXPECT_EQ(inputs()[i].value(7.0, s), truth[i]) << i;
    EXPECT_GT(inputs()[i].least, 0.0) << i;
  }
  EXPECT_TRUE(std::isnan(input_row(Input::kVibration).value(7.0, {})));
}

TEST(Kinds, ClampKeepsWhatIsAllowedAndNothingElse) {
  for (const KindRow& its : kinds()) {
    const auto parameters = model::info(its.kind).parameters;
    const auto within = [&](const Effect& effect) {
      for (std::size_t i = 0; i < parameters.size(); ++i) {
        const double value = effect.parameters[i];
        EXPECT_GE(value, parameters[i].minimum) << name(its.kind);
        EXPECT_LE(value, parameters[i].maximum) << name(its.kind);
        EXPECT_TRUE(value == 0.0 || std::abs(value) >= parameters[i].least) << name(its.kind);
      }
      for (const Bound& bound : *its.bounds) {
        EXPECT_GE(effect.parameters[bound.parameter], bound.least) << name(its.kind);
        EXPECT_LE(effect.parameters[bound.parameter], bound.most) << name(its.kind);
      }
    };
    for (const double wild : {-1e12, -1e-15, 0.0, 1e-15, 1e12}) {
      Effect effect{0, its.kind, {wild, wild, wild}, 0};
      clamp(effect);
      within(effect);
      Effect again = effect;
      clamp(again);
      EXPECT_EQ(again, effect) << name(its.kind);
    }
    Effect good{0, its.kind, usual(its.kind), 0};
    clamp(good);
    EXPECT_EQ(good.parameters, usual(its.kind)) << name(its.kind);
  }
}

TEST(Kinds, TidyPhaseKeepsTheWave) {
  for (const KindRow& its : kinds()) {
    for (const double amplitude : {0.3, -0.3}) {
      for (const double phase : {-40.0, -1.0, 0.0, 2.0, 7.0, 500.0}) {
        const Effect before{0, its.kind, {4.0, amplitude, phase}, 0};
        Effect after = before;
        tidy_phase(after);
        if (its.form != Form::kWave) {
          EXPECT_EQ(after, before) << name(its.kind);
          continue;
        }
        EXPECT_GE(after.parameters[1], 0.0) << name(its.kind);
        EXPECT_GE(after.parameters[2], 0.0) << name(its.kind);
        EXPECT_LT(after.parameters[2], 2.0 * kPi) << name(its.kind);
        for (double x = 0.0; x < 3.0; x += 0.037) {
          model::Surroundings s;
          s.t_s = x;
          s.angle_rad = x;
          EXPECT_NEAR(model::added_dps(after, 10.0, s), model::added_dps(before, 10.0, s), 1e-12)
              << name(its.kind) << ", phase " << phase;
        }
      }
    }
  }
}

TEST(Kinds, SameFormIsTheSameShapeOfTheSameGyro) {
  const auto same = [](Kind kind, double a, double b, std::size_t other_gyro = 0) {
    return same_form({0, kind, {a, 1.0}, 0}, {other_gyro, kind, {b, 2.0}, 0});
  };
  // Another cut-off is another start, another axis or harmonic another shape.
  EXPECT_TRUE(same(Kind::kBandwidth, 1.0, 40.0));
  EXPECT_TRUE(same(Kind::kScaleFactor, 1.0, 2.0));
  EXPECT_TRUE(same(Kind::kGSensitivity, 1.0, 1.0));
  EXPECT_FALSE(same(Kind::kGSensitivity, 0.0, 1.0));
  EXPECT_FALSE(same(Kind::kAngleHarmonic, 2.0, 3.0));
  EXPECT_FALSE(same(Kind::kScaleFactor, 1.0, 1.0, 1));
  EXPECT_FALSE(same_form({0, Kind::kScaleFactor, {1.0}, 0}, {0, Kind::kBias, {1.0}, 0}));
}

// Observations of a gyro whose temperature swings.
struct Warmed {
  Observations data;
  std::vector<model::TemperaturePast> past;

  explicit Warmed(const Making& making) : data(*observations_of_one(making)) {
    std::vector<model::Surroundings>& surroundings = data.surroundings[0];
    past.reserve(surroundings.size());
    for (model::Surroundings& s : surroundings) {
      s.temperature_c = true_temperature_c(s.t_s);
      past.push_back(past.empty() ? model::TemperaturePast{} : past.back());
      past.back().add(s.temperature_c);
      s.temperature_past = &past.back();
    }
  }
};

// A difference quotient is good where a step four times as wide gives the same.
TEST(Kinds, StepsOfDerivativesAreSmallAndLargeEnough) {
  Making making;
  making.seconds = 60.0;
  making.rest_s = 10.0;
  const Warmed warmed(making);
  const Observations* const data = &warmed.data;
  constexpr double kWider = 4.0;
  constexpr double kAgrees = 1e-4;
  for (const KindRow& its : kinds()) {
    const Effect effect{0, its.kind, usual(its.kind), 0};
    for (const Free& free : *its.free) {
      if (free.linear) continue;
      Free wide = free;
      wide.step *= kWider;
      const Eigen::VectorXd narrow = data->derivative({}, effect, free);
      const Eigen::VectorXd wider = data->derivative({}, effect, wide);
      ASSERT_GT(narrow.norm(), 0.0) << name(its.kind);
      EXPECT_LT((narrow - wider).norm(), kAgrees * narrow.norm())
          << name(its.kind) << ", parameter " << free.parameter;
    }
  }
}

// Sentences are formatted at run time: each with the fields that there are.
TEST(Kinds, TellPeopleWhatGaveThemAway) {
  for (const KindRow& its : kinds()) {
    const Effect effect{1, its.kind, usual(its.kind), 0};
    Parameters sigma = usual(its.kind);
    for (double& one : sigma)
      one /= 50.0;
    const std::string text = evidence_text(effect, sigma, "the second one", 480.0);
    EXPECT_NE(text.find("the second one"), std::string::npos) << text;
    EXPECT_EQ(text.find('{'), std::string::npos) << text;
    EXPECT_EQ(text.find("nan"), std::string::npos) << text;
    EXPECT_EQ(text.find("standard errors") != std::string::npos, its.errors_of != kNoErrors)
        << text;
    EXPECT_FALSE(std::string_view(its.against).empty()) << name(its.kind);
    EXPECT_FALSE(std::string_view(its.signature).empty()) << name(its.kind);
  }
  std::set<std::string_view> experiments;
  for (const Experiment experiment :
       {Experiment::kFasterMotion, Experiment::kManyRates, Experiment::kTemperatureCycles,
        Experiment::kTilt, Experiment::kSupplySteps, Experiment::kOtherTurns, Experiment::kLonger})
    experiments.insert(experiment_text(experiment));
  EXPECT_EQ(experiments.size(), 7U);
  EXPECT_FALSE(experiments.contains(""));
}

}  // namespace
}  // namespace vgyro::gap
