// What the corrector thinks, in words: the exact sentences, and nothing where there is nothing.

#include "gateway/condition_text.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgyro::gateway {
namespace {

using fusion::Hypothesis;

const GyroNames kNames{"fog", "mems"};

Probabilities with(std::initializer_list<std::pair<Hypothesis, double>> given) {
  Probabilities probability{};
  for (const auto& [hypothesis, p] : given)
    probability[static_cast<std::size_t>(hypothesis)] = p;
  return probability;
}

TEST(ConditionText, CountsSteadyStretchesByWhatBecameOfThem) {
  EXPECT_EQ(stretches_text({}), "");
  EXPECT_EQ(stretches_text({.learned = 1}), "1 steady stretch: 1 stop learned");
  EXPECT_EQ(stretches_text({.learned = 7, .refused = 1}),
            "8 steady stretches: 7 stops learned, 1 refused: turning together");
  EXPECT_EQ(stretches_text({.refused = 2, .open = 1}),
            "2 steady stretches: 2 refused: turning together; 1 of these left open: standing or "
            "turning could not be told apart");
}

TEST(ConditionText, SaysWhatToLookAtOnlyWhereMostStretchesTaughtLittle) {
  EXPECT_EQ(stretches_advice({}), "");
  EXPECT_EQ(stretches_advice({.refused = 2}), "") << "too few to be a habit";
  EXPECT_EQ(stretches_advice({.learned = 3, .refused = 3}), "") << "no more than half";
  for (const SteadyStretches& most :
       {SteadyStretches{.learned = 2, .refused = 3}, SteadyStretches{.learned = 5, .open = 3},
        SteadyStretches{.learned = 3, .refused = 2, .open = 1}}) {
    const std::string advice = stretches_advice(most);
    for (const char* key : {"rate_dps", "latitude_deg", "max_bias_dps", "[speed]"})
      EXPECT_NE(advice.find(key), std::string::npos) << key << ": " << advice;
  }
}

TEST(ConditionText, NamesWhatMayBeTheCaseAboveOneInTwenty) {
  EXPECT_EQ(hypotheses_text({}, kNames), "");
  EXPECT_EQ(hypotheses_text(with({{Hypothesis::kStanding, 0.93},
                                  {Hypothesis::kTurning, 0.07},
                                  {Hypothesis::kGyro1Stepped, 0.6},
                                  {Hypothesis::kGyro2Stepped, 0.04},
                                  {Hypothesis::kGyro2Blind, 0.1}}),
                            kNames),
            "standing 93 %, turning steadily 7 %; gyro fog has stepped 60 %; gyro mems feels no "
            "rotation 10 %");
  EXPECT_EQ(hypotheses_text(with({{Hypothesis::kStanding, NAN}}), kNames), "");
}

TEST(ConditionText, NamesTheKindOfDriftWhereItIsMoreThanAWalk) {
  EXPECT_EQ(drift_kind_text({}), "");
  EXPECT_EQ(drift_kind_text(with({{Hypothesis::kWarmingUp, 0.03}})), "");
  EXPECT_EQ(drift_kind_text(with({{Hypothesis::kWarmingUp, 0.7}, {Hypothesis::kOwnSlopes, 0.1}})),
            "warming up 70 %, slopes of their own 10 %, random walk 20 %");
  EXPECT_EQ(drift_kind_text(with({{Hypothesis::kAlikeSlopes, 0.98}})), "slopes alike 98 %");
}

TEST(ConditionText, SaysThatSigmaSpansBothReadings) {
  EXPECT_EQ(ambiguity_text(
                with({{Hypothesis::kGyro1Stepped, 0.6}, {Hypothesis::kGyro2Stepped, 0.4}}), kNames),
            "what the gyros show can be read in two ways, and σ spans both: gyro fog has stepped "
            "60 %; gyro mems has stepped 40 %");
  EXPECT_EQ(ambiguity_text({}, kNames),
            "what the gyros show can be read in two ways, and σ spans both");
}

// 1 deg/h an hour is 1/3600² deg/s a second.
TEST(ConditionText, TellsSlopesToTheSecondDigitOfTheirDoubt) {
  constexpr double kUnit = 1.0 / 3600.0 / 3600.0;
  EXPECT_EQ(slopes_text({3.14159 * kUnit, -2100.0 * kUnit}, {0.41 * kUnit, 312.0 * kUnit}, kNames),
            "fog +3.14 ± 0.41, mems -2100 ± 312 deg/h an hour");
  EXPECT_EQ(slopes_text({NAN, 1.0 * kUnit}, {NAN, 2.3 * kUnit}, kNames),
            "mems +1.0 ± 2.3 deg/h an hour");
  EXPECT_EQ(slopes_text({-0.3 * kUnit, NAN}, {559.0 * kUnit, NAN}, kNames),
            "fog +0 ± 559 deg/h an hour");
  EXPECT_EQ(slopes_text({1.0, 1.0}, {0.0, NAN}, kNames), "") << "0 stands for not known";
}

TEST(ConditionText, TakesALostEstimateForAFaultOfOurOwn) {
  EXPECT_NE(restarts_text(1).find("began anew once: a fault of vgyro itself"), std::string::npos);
  EXPECT_NE(restarts_text(2).find("began anew 2 times"), std::string::npos);
}

}  // namespace
}  // namespace vgyro::gateway
