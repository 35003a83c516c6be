// The corrector's findings as text: the exact sentences, and an empty text if there is nothing to
// report.

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
            "2 steady stretches: 2 refused: turning together; 1 of these left open: stop "
            "and turn could not be distinguished");
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

// 1 deg/h an hour is 1/3600² (deg/s)/s.
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
  EXPECT_NE(restarts_text(1).find("was restarted once: a fault of vgyro itself"),
            std::string::npos);
  EXPECT_NE(restarts_text(2).find("was restarted 2 times"), std::string::npos);
}

fusion::PairVerdict pair_of(fusion::Contradiction contradiction, double slope) {
  fusion::PairVerdict pair;
  pair.contradiction = contradiction;
  pair.slope = slope;
  return pair;
}

TEST(ConditionText, SaysHowAPairContradictsItself) {
  using fusion::Contradiction;
  const auto text = [](Contradiction contradiction, double slope) {
    return contradiction_text(pair_of(contradiction, slope), kNames);
  };
  EXPECT_EQ(text(Contradiction::kNone, 1.0), "");
  EXPECT_EQ(text(Contradiction::kSign, -0.998), "mems moves -1.00 times fog: sign = -1?");
  EXPECT_EQ(text(Contradiction::kSign, -57.1),
            "mems moves -57.10 times fog: sign = -1? And rad/s and deg/s?");
  EXPECT_EQ(text(Contradiction::kScale, 57.4), "mems moves 57.40 times fog: rad/s and deg/s?");
  EXPECT_EQ(text(Contradiction::kScale, 1.0 / 3600.0),
            "mems moves 0.00028 times fog: deg/s and deg/h?");
  EXPECT_EQ(text(Contradiction::kScale, 30.0),
            "mems moves 30.00 times fog: is its unit, or its factor, right?");
  EXPECT_NE(text(Contradiction::kUnrelated, NAN).find("fog and mems both move, and not together"),
            std::string::npos);
  fusion::PairVerdict late = pair_of(Contradiction::kLag, 1.0);
  late.lag_s = -1.5;
  EXPECT_NE(contradiction_text(late, kNames).find("fog moves 1.5 s later than mems"),
            std::string::npos);
  fusion::PairVerdict erratic = pair_of(Contradiction::kErratic, NAN);
  erratic.gyro = 0;
  EXPECT_NE(contradiction_text(erratic, kNames).find("the values of fog jump"), std::string::npos);
}

}  // namespace
}  // namespace vgyro::gateway
