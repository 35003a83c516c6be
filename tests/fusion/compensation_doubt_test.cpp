#include "fusion/compensation_doubt.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::fusion {
namespace {

using model::Effect;
using model::Kind;
using model::Surroundings;

Effect effect(Kind kind, model::Parameters parameters, model::Parameters sigma,
              bool ambiguous = false) {
  return {.kind = kind, .parameters = parameters, .sigma = sigma, .ambiguous = ambiguous};
}

CompensationDoubt doubt_of(const Effect& one) {
  return CompensationDoubt(std::vector<Effect>{one});
}

TEST(CompensationDoubt, IsNothingWhereNothingIsSaid) {
  EXPECT_FALSE(CompensationDoubt().any());
  EXPECT_FALSE(doubt_of(effect(Kind::kScaleFactor, {0.01}, {})).any());
  EXPECT_FALSE(doubt_of(effect(Kind::kWhiteNoise, {0.01}, {1e-3})).any())
      << "nothing is taken back";
  EXPECT_FALSE(doubt_of(effect(Kind::kDelay, {0.01}, {1e-3})).any()) << "the corrector's to know";
}

TEST(CompensationDoubt, OfAScaleFactorGrowsWithTheRateEitherWay) {
  const CompensationDoubt doubt = doubt_of(effect(Kind::kScaleFactor, {0.0}, {1e-3}));
  EXPECT_DOUBLE_EQ(doubt.at(0.0, {}).own_dps, 0.0);
  EXPECT_NEAR(doubt.at(50.0, {}).own_dps, 0.05, 1e-12);
  EXPECT_NEAR(doubt.at(-50.0, {}).own_dps, 0.05, 1e-12);
  EXPECT_DOUBLE_EQ(doubt.at(50.0, {}).common_dps, 0.0);
}

TEST(CompensationDoubt, IsOfTheRateNotOfTheReading) {
  // A gyro that reads half of the rate: an error of its reading is twice that of the rate.
  const CompensationDoubt doubt = doubt_of(effect(Kind::kScaleFactor, {-0.5}, {1e-3}));
  EXPECT_NEAR(doubt.at(50.0, {}).own_dps, 0.1, 1e-12);
}

TEST(CompensationDoubt, OfAnAmbiguousEffectIsAllOfItAndCommon) {
  const CompensationDoubt doubt = doubt_of(effect(Kind::kScaleFactor, {-8e-3}, {}, true));
  EXPECT_NEAR(doubt.at(50.0, {}).common_dps, 0.4 / (1.0 - 8e-3), 1e-12);
  EXPECT_DOUBLE_EQ(doubt.at(50.0, {}).own_dps, 0.0);
}

TEST(CompensationDoubt, OfAnOffsetCountsFromWhereTheBiasWasLearned) {
  CompensationDoubt doubt = doubt_of(effect(Kind::kTemperatureBias, {5e-3, 25.0}, {5e-4, 0.0}));
  const Surroundings cold{.temperature_c = 10.0};
  const Surroundings warm{.temperature_c = 30.0};
  EXPECT_NEAR(doubt.at(3.0, cold).own_dps, 15 * 5e-4, 1e-12) << "nothing was learned yet";
  doubt.settle(cold);
  EXPECT_NEAR(doubt.at(3.0, cold).own_dps, 0.0, 1e-12);
  EXPECT_NEAR(doubt.at(3.0, warm).own_dps, 20 * 5e-4, 1e-12);
}

TEST(CompensationDoubt, OfAConstantIsGoneOnceTheBiasWasLearned) {
  CompensationDoubt doubt = doubt_of(effect(Kind::kBias, {0.03}, {1e-3}));
  doubt.settle({});
  EXPECT_DOUBLE_EQ(doubt.at(50.0, {.t_s = 1000.0}).own_dps, 0.0);
}

TEST(CompensationDoubt, OfALineIsNotLearnedAway) {
  CompensationDoubt doubt = doubt_of(effect(Kind::kLine, {1.0, 0.02, 0.0}, {0.0, 3e-3, 0.0}));
  doubt.settle({.t_s = 0.25});
  EXPECT_NEAR(doubt.at(0.0, {.t_s = 0.25}).own_dps, 3e-3, 1e-12);
}

TEST(CompensationDoubt, OfSeveralParametersAddsInSquares) {
  const CompensationDoubt doubt(
      std::vector<Effect>{effect(Kind::kScaleFactor, {0.0}, {3e-3}),
                          effect(Kind::kScaleFactorAsymmetry, {0.0}, {4e-3})});
  EXPECT_NEAR(doubt.at(10.0, {}).own_dps, 0.05, 1e-12);
}

TEST(CompensationDoubt, OfAnInputThatIsNotKnownIsNothing) {
  const CompensationDoubt doubt = doubt_of(effect(Kind::kGSensitivity, {0.0, 1e-3}, {0.0, 1e-3}));
  EXPECT_DOUBLE_EQ(doubt.at(10.0, {}).own_dps, 0.0);
}

TEST(CompensationDoubt, StaysFiniteWhereAParameterHasItsEnd) {
  const CompensationDoubt doubt = doubt_of(effect(Kind::kWarmUp, {0.1, 5.0}, {0.0, 3000.0}));
  EXPECT_TRUE(std::isfinite(doubt.at(0.0, {.t_s = 100.0}).own_dps));
}

}  // namespace
}  // namespace vgyro::fusion
