#include "gap/rest.h"

#include <cmath>

#include <gtest/gtest.h>

#include "made_faults.h"

namespace vgyro::gap {
namespace {

constexpr std::size_t kSeconds = 180;
constexpr double kTurn_dps = 25.0;

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = kSeconds + 0.5;  // so that the last second has samples
  making.rest_s = 60.0;
  making.seed = seed;
  return making;
}

// To and fro between two instants, at rest before and after.
double to_and_fro(double t_s, double from_s, double to_s) {
  if (t_s <= from_s || t_s >= to_s) return 0.0;
  return kTurn_dps * std::sin(2.0 * kPi * 0.3 * (t_s - from_s));
}

// 1 from one instant to another.
double between(double t_s, double from_s, double to_s) {
  return t_s >= from_s && t_s < to_s ? 1.0 : 0.0;
}

RestingSeconds rest_of(const Recording& recording) {
  return find_rest(recording, check_both(recording));
}

// Spans of whole seconds, as text: "0-59 120-180".
std::string spans(const RestingSeconds& rest) {
  std::string text;
  for (std::size_t second = 0; second < kSeconds;) {
    std::size_t end = second;
    while (end < kSeconds && rest.at(static_cast<double>(end) + 0.5))
      ++end;
    if (end > second)
      text += (text.empty() ? "" : " ") + std::to_string(second) + "-" + std::to_string(end);
    second = std::max(end, second + 1);
  }
  return text;
}

TEST(RestingSeconds, AreThoseThatWereGiven) {
  const RestingSeconds rest({0, 1, 1, 0});
  EXPECT_EQ(rest.count(), 2.0);
  EXPECT_FALSE(rest.at(0.999));
  EXPECT_TRUE(rest.at(1.0));
  EXPECT_TRUE(rest.at(2.999));
  EXPECT_FALSE(rest.at(3.0));
  EXPECT_FALSE(rest.at(4.0));
  EXPECT_FALSE(rest.at(1e6));
}

TEST(RestingSeconds, OfTimesBeforeTheFirstAreThoseOfTheFirst) {
  EXPECT_TRUE(RestingSeconds({1, 0}).at(-5.0));
  EXPECT_FALSE(RestingSeconds({0, 1}).at(-5.0));
}

TEST(RestingSeconds, AreNoneUnlessGiven) {
  EXPECT_EQ(RestingSeconds().count(), 0.0);
  EXPECT_FALSE(RestingSeconds().at(0.0));
}

// The last second before a motion is left out, because the motion may begin in it.
TEST(Rest, EndsASecondBeforeTheMotion) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const RestingSeconds rest = rest_of(without_reference(make_recording(making_of(seed))));
    EXPECT_EQ(spans(rest), "0-59") << "seed " << seed;
    EXPECT_EQ(rest.count(), 59.0);
  }
}

TEST(Rest, IsFoundAgainAfterTheMotion) {
  const Recording recording =
      turned(making_of(4), [](double t_s) { return to_and_fro(t_s, 60.0, 120.0); });
  const RestingSeconds rest = rest_of(recording);
  EXPECT_EQ(spans(rest), "0-59 121-180");
}

TEST(Rest, IsTheWholeRecordingWhereNothingMoves) {
  const RestingSeconds rest = rest_of(turned(making_of(5), [](double) { return 0.0; }));
  EXPECT_EQ(spans(rest), "0-180");
}

TEST(Rest, IsAsNoisyAsTheGyroIs) {
  for (const double factor : {0.1, 10.0}) {
    Making making = making_of(6);
    for (double& density : making.white_dps_rthz)
      density *= factor;
    const Recording recording =
        turned(making, [](double t_s) { return to_and_fro(t_s, 60.0, 120.0); });
    EXPECT_EQ(spans(rest_of(recording)), "0-59 121-180") << factor;
  }
}

// As steady as rest, but not what the gyros read in the beginning.
TEST(Rest, IsNoSlowTurn) {
  for (const double rate_dps : {0.3, 0.5, 1.5, 5.0, -0.5, -20.0}) {
    const Recording recording =
        turned(making_of(7), [&](double t_s) { return rate_dps * between(t_s, 60.0, 120.0); });
    EXPECT_EQ(spans(rest_of(recording)), "0-59 121-180") << rate_dps;
  }
}

// A bias may drift by as much; only where it begins and ends it is seen.
TEST(Rest, HoldsATurnThatIsSlowerThanBiasesDrift) {
  const Recording recording =
      turned(making_of(8), [&](double t_s) { return 0.1 * between(t_s, 60.0, 120.0); });
  EXPECT_EQ(spans(rest_of(recording)), "0-59 61-119 121-180");
}

TEST(Rest, TakesBiasesForWhatTheyAre) {
  Making making = making_of(9);
  making.error = [](std::size_t gyro, double, double) { return gyro == 0 ? -1.0 : 7.0; };
  EXPECT_EQ(spans(rest_of(without_reference(make_recording(making)))), "0-59");
}

// Where a slow motion turns round the gyros read next to nothing for less than a second or two.
TEST(Rest, IsNoTurningPoint) {
  const Recording recording = turned(making_of(10), [](double t_s) {
    return t_s < 60.0 ? 0.0 : 2.0 * std::sin(2.0 * kPi * 0.05 * (t_s - 60.0));
  });
  EXPECT_EQ(spans(rest_of(recording)), "0-59");
}

TEST(Rest, IsNoStopOfThreeSeconds) {
  const Recording recording = turned(making_of(11), [](double t_s) {
    return to_and_fro(t_s, 60.0, 100.0) + to_and_fro(t_s, 103.0, 140.0);
  });
  EXPECT_EQ(spans(rest_of(recording)), "0-59 141-180");
}

TEST(Rest, IsReadAsZeroByADeadBand) {
  for (const std::size_t gyro : {0U, 1U}) {
    Recording recording =
        turned(making_of(12), [](double t_s) { return to_and_fro(t_s, 60.0, 120.0); });
    for (double& rate_dps : recording.gyros[gyro].rate_dps)
      rate_dps = std::abs(rate_dps) < 0.3 ? 0.0 : rate_dps;
    const std::array<Transport, 2> transports = check_both(recording);
    ASSERT_FALSE(masked_samples(transports[gyro]).empty());
    EXPECT_EQ(spans(find_rest(recording, transports)), "0-59 121-180") << gyro + 1;
  }
}

// A gyro at its limit is steadier than any at rest, and would pass for the steadiest seconds.
TEST(Rest, IsNoTurnAtAGyrosLimit) {
  Recording recording = turned(making_of(13), [](double t_s) {
    return 40.0 * between(t_s, 60.0, 170.0) + to_and_fro(t_s, 60.0, 170.0);
  });
  for (GyroSeries& series : recording.gyros) {
    for (double& rate_dps : series.rate_dps)
      rate_dps = std::clamp(rate_dps, -12.0, 12.0);
  }
  EXPECT_EQ(spans(rest_of(recording)), "0-59 171-180");
}

// One feels a turn that the other, frozen or clipped, does not.
TEST(Rest, IsWhereBothGyrosRest) {
  Recording recording =
      turned(making_of(14), [](double t_s) { return to_and_fro(t_s, 60.0, 120.0); });
  const Recording still = turned(making_of(15), [](double) { return 0.0; });
  recording.gyros[1] = still.gyros[1];
  EXPECT_EQ(spans(rest_of(recording)), "0-59 121-180");
}

TEST(Rest, IsNotKnownWhereAGyroIsSilent) {
  Recording recording = turned(making_of(16), [](double) { return 0.0; });
  lose(recording.gyros[1], [](std::size_t i) { return i >= 8000 && i < 10000; });
  EXPECT_EQ(spans(rest_of(recording)), "0-80 100-180");
}

// A recording that begins in motion has no second near what it begins with.
TEST(Rest, IsNoneWhereNothingIsSteady) {
  Making making = making_of(17);
  making.rest_s = 0.0;
  const Recording recording = turned(making, [](double t_s) {
    return 60.0 * std::sin(2.0 * kPi * 0.013 * t_s) + 40.0 * std::sin(2.0 * kPi * 0.7 * t_s);
  });
  EXPECT_EQ(rest_of(recording).count(), 0.0);
}

TEST(Rest, ShowsADriftThatIsTakenOffBetweenStopsToo) {
  std::vector<std::uint8_t> seconds(kSeconds, 0);
  for (std::size_t second = 0; second < kSeconds; ++second)
    seconds[second] = second < 60 || second >= 120 ? 1 : 0;
  const RestingSeconds rest(seconds);
  constexpr double kRest_dps = 0.003;
  constexpr double kSlope_dps_s = 5e-4;
  std::vector<double> t_s;
  std::vector<double> rate_dps;
  for (std::size_t i = 0; i < 100 * kSeconds; ++i) {
    t_s.push_back(0.01 * static_cast<double>(i));
    rate_dps.push_back(kRest_dps + kSlope_dps_s * t_s.back() + to_and_fro(t_s.back(), 60.0, 120.0));
  }
  take_off_drift_at_rest(rest, t_s, kRest_dps, rate_dps);
  // Straight between the middles of pieces of ten seconds, level before the first: five seconds.
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const double left_dps = rate_dps[i] - to_and_fro(t_s[i], 60.0, 120.0) - kRest_dps;
    EXPECT_LE(std::abs(left_dps), 7.0 * kSlope_dps_s) << t_s[i];
    if (t_s[i] > 10.0 && t_s[i] < 170.0) {
      EXPECT_NEAR(left_dps, 0.0, 1e-9) << t_s[i];
    }
  }
}

TEST(Rest, OfAMomentShowsNoDrift) {
  std::vector<std::uint8_t> seconds(10, 0);
  seconds[5] = seconds[6] = 1;
  std::vector<double> t_s;
  for (int i = 0; i < 1000; ++i)
    t_s.push_back(0.01 * i);
  std::vector<double> rate_dps(t_s.size(), 0.7);
  take_off_drift_at_rest(RestingSeconds(seconds), t_s, 0.0, rate_dps);
  EXPECT_EQ(rate_dps, std::vector<double>(t_s.size(), 0.7));
}

}  // namespace
}  // namespace vgyro::gap
