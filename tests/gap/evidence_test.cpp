#include "gap/evidence.h"

#include <gtest/gtest.h>

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

// What people are told, word by word: numbers in the units that the words say.
TEST(Evidence, SaysWhoFollowsWhatByHowMuch) {
  EXPECT_EQ(evidence_text({1, Kind::kScaleFactor, {2e-3}, 0}, {2e-3 / 63.0}, "b", 480.0),
            "the residual of b follows the rate: +0.002 of it, 63 standard errors");
  EXPECT_EQ(evidence_text({0, Kind::kBias, {-0.0123}, 0}, {0.0123 / 7.0}, "a", 480.0),
            "a reads -0.0123 deg/s beside the truth all the time, 7 standard errors");
  EXPECT_EQ(evidence_text({0, Kind::kBiasStep, {0.02, 100.26}, 0}, {0.001}, "a", 480.0),
            "the residual of a jumps by +0.02 deg/s at 100.3 s, 20 standard errors");
}

TEST(Evidence, SaysHowFarARampGoesInTheWholeRecording) {
  EXPECT_EQ(evidence_text({0, Kind::kBiasRamp, {-1e-4}, 0}, {1e-5}, "a", 250.0),
            "the residual of a climbs by -0.0001 deg/s every second, -0.025 deg/s over the "
            "recording, 10 standard errors");
}

TEST(Evidence, CountsADelayInMilliseconds) {
  EXPECT_EQ(evidence_text({0, Kind::kDelay, {0.0125}, 0}, {0.0005}, "a", 480.0),
            "the residual of a follows the slope of the rate: it comes +12.5 ms late, 25 standard "
            "errors");
}

TEST(Evidence, NamesTheAxis) {
  constexpr double kCoefficient = 0.004;
  for (const auto& [axis, letter] :
       {std::pair{0.0, 'x'}, std::pair{1.0, 'y'}, std::pair{2.0, 'z'}}) {
    const std::string text = evidence_text({1, Kind::kGSensitivity, {axis, kCoefficient}, 0},
                                           {0.0, kCoefficient / 5.0}, "b", 480.0);
    EXPECT_EQ(text, std::string("the residual of b follows the acceleration along ") + letter +
                        ": +0.004 deg/s per g, 5 standard errors");
  }
}

// The size of a wave has no sign, and its errors are those of the amplitude.
TEST(Evidence, SaysTheSizeOfAWave) {
  EXPECT_EQ(evidence_text({0, Kind::kLine, {37.02, -1e-3, 0.3}, 0}, {1e-4, 1e-4}, "a", 480.0),
            "the residual of a holds a sine of 37.02 Hz and 0.001 deg/s, 10 standard errors");
  EXPECT_EQ(evidence_text({0, Kind::kAngleHarmonic, {3.0, 2e-3, 0.3}, 0}, {0.0, 1e-4}, "a", 480.0),
            "the residual of a repeats 3 times a turn, by 0.002 deg/s, 20 standard errors");
}

// Nothing was estimated, or the number would mean nothing: no standard errors are told.
TEST(Evidence, KeepsStillAboutErrorsThatThereAreNot) {
  EXPECT_EQ(evidence_text({0, Kind::kScaleFactor, {1e-3}, 0}, {}, "a", 480.0),
            "the residual of a follows the rate: +0.001 of it");
  EXPECT_EQ(
      evidence_text({0, Kind::kBandwidth, {5.0}, 0}, {0.1}, "a", 480.0),
      "the residual of a grows with the frequency of the motion as behind a low-pass of 5 Hz");
  EXPECT_EQ(evidence_text({0, Kind::kGaussMarkov, {1e-3, 42.0}, 0}, {1e-4, 3.0}, "a", 480.0),
            "a wanders by 0.001 deg/s and forgets it within 42 s, beyond what the model says");
}

// A name from a configuration may hold what a format would take for a field.
TEST(Evidence, TakesAnyName) {
  EXPECT_EQ(evidence_text({0, Kind::kStuck, {1.0, 2.0}, 0}, {}, "{p0} {", 480.0),
            "{p0} { shows stuck");
}

}  // namespace
}  // namespace vgyro::gap
