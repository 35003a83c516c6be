#include "gap/leftover.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

Making making_of(std::uint64_t seed, double seconds = 90.0) {
  Making making;
  making.seconds = seconds;
  making.rest_s = 30.0;
  making.seed = seed;
  return making;
}

Found found_of(const Effect& effect, double statistic) {
  Found found;
  found.effect = effect;
  found.statistic = statistic;
  return found;
}

// Names of every family for gyro 1, a small line among them, and noise for gyro 2.
std::vector<Found> some_names() {
  return {found_of({0, Kind::kScaleFactor, {1e-3}, 0}, 5000.0),
          found_of({0, Kind::kWhiteNoise, {1e-3}, 0}, 1000.0),
          found_of({0, Kind::kLine, {7.0, 1e-3, 0.0}, 0}, 20.0),
          found_of({0, Kind::kRateRandomWalk, {1e-3}, 0}, 800.0),
          found_of({0, Kind::kGaussMarkov, {1e-3, 10.0}, 0}, 600.0),
          found_of({1, Kind::kWhiteNoise, {1e-3}, 0}, 500.0),
          found_of({1, Kind::kRateRandomWalk, {1e-3}, 0}, 400.0)};
}

bool holds(const std::vector<Found>& found, std::size_t gyro, Kind kind) {
  return std::any_of(found.begin(), found.end(), [&](const Found& one) {
    return one.effect.gyro == gyro && one.effect.kind == kind;
  });
}

const Unexplained* find(const std::vector<Unexplained>& list, const std::string& signature) {
  const auto found = std::find_if(
      list.begin(), list.end(), [&](const Unexplained& one) { return one.signature == signature; });
  return found == list.end() ? nullptr : &*found;
}

struct Left {
  std::vector<Unexplained> list;
  std::vector<Found> found;
};

// Of a search that has not begun: all that is known is the noise of `known`.
Left left_of(const Making& making, const Making& known, std::vector<Found> found) {
  const MadeStudy made(make_recording(making), noise_effects(known));
  EXPECT_NE(made.study(), nullptr);
  if (made.study() == nullptr) return {};
  const Search search(made.study(), noise_effects(known));
  Left left{{}, std::move(found)};
  left.list = leftovers(search, left.found);
  return left;
}

TEST(Leftovers, OfCleanRecordingsAreNoneAndNoNameIsTakenBack) {
  for (const std::uint64_t seed : {131U, 132U, 133U, 134U}) {
    const Making making = making_of(seed);
    const Left left = left_of(making, making, some_names());
    EXPECT_TRUE(left.list.empty()) << "seed " << seed << ": " << left.list.front().text;
    EXPECT_EQ(left.found.size(), some_names().size());
  }
}

TEST(Leftovers, ColouredNoiseTakesAllNoiseOfItsGyroBack) {
  Making making = making_of(135);
  const Making known = making;
  const double sigma = making.white_dps_rthz[0] / std::sqrt(making.interval_s);
  making.white_dps_rthz[0] = 0.0;
  std::mt19937_64 random(135);
  std::normal_distribution<double> normal;
  double value = 0.0;
  constexpr double kKeeps = 0.5;
  making.error = [&](std::size_t gyro, double, double) {
    if (gyro != 0) return 0.0;
    value = kKeeps * value + std::sqrt(1.0 - kKeeps * kKeeps) * normal(random);
    return sigma * value;
  };
  const Left left = left_of(making, known, some_names());
  EXPECT_FALSE(holds(left.found, 0, Kind::kWhiteNoise));
  EXPECT_FALSE(holds(left.found, 0, Kind::kRateRandomWalk));
  EXPECT_FALSE(holds(left.found, 0, Kind::kGaussMarkov));
  // A line of a fiftieth of what is taken back may be a part of it; the scale factor is not.
  EXPECT_FALSE(holds(left.found, 0, Kind::kLine));
  EXPECT_TRUE(holds(left.found, 0, Kind::kScaleFactor));
  EXPECT_TRUE(holds(left.found, 1, Kind::kWhiteNoise));
  EXPECT_TRUE(holds(left.found, 1, Kind::kRateRandomWalk));
  const Unexplained* const noise = find(left.list, "noise");
  ASSERT_NE(noise, nullptr);
  EXPECT_EQ(noise->gyro, 0U);
  EXPECT_EQ(noise->from_s, 0.0);
  EXPECT_EQ(noise->to_s, making.seconds);
  EXPECT_NE(noise->text.find("the noise is not white"), std::string::npos) << noise->text;
  const Unexplained* const line = find(left.list, "line");
  ASSERT_NE(line, nullptr);
  EXPECT_EQ(line->frequency_hz, 7.0);
  EXPECT_EQ(line->amplitude_dps, 1e-3);
  EXPECT_EQ(line->text, "line near 7 Hz, 0.001 deg/s, not steady");
}

// Noise of two sides, with the model's variance: its fourth powers are twice a Gaussian's.
TEST(Leftovers, HeavyTailsTakeWhiteNoiseBackButNoDrift) {
  Making making = making_of(136);
  const Making known = making;
  const double sigma = making.white_dps_rthz[0] / std::sqrt(making.interval_s);
  making.white_dps_rthz[0] = 0.0;
  std::mt19937_64 random(136);
  std::exponential_distribution<double> exponential(std::sqrt(2.0));
  std::bernoulli_distribution sign;
  making.error = [&](std::size_t gyro, double, double) {
    if (gyro != 0) return 0.0;
    const double size = sigma * exponential(random);
    return sign(random) ? size : -size;
  };
  const Left left = left_of(making, known, some_names());
  const Unexplained* const outliers = find(left.list, "outliers");
  ASSERT_NE(outliers, nullptr);
  EXPECT_EQ(outliers->gyro, 0U);
  EXPECT_FALSE(holds(left.found, 0, Kind::kWhiteNoise));
  EXPECT_TRUE(holds(left.found, 0, Kind::kRateRandomWalk));
  EXPECT_TRUE(holds(left.found, 1, Kind::kWhiteNoise));
}

TEST(Leftovers, StretchOfOtherNoiseIsSaidWithItsSeconds) {
  Making making = making_of(137);
  std::mt19937_64 random(137);
  std::normal_distribution<double> normal;
  const double sigma = making.white_dps_rthz[1] / std::sqrt(making.interval_s);
  making.error = [&](std::size_t gyro, double t_s, double) {
    return gyro == 1 && t_s >= 40.0 && t_s < 50.0 ? sigma * normal(random) : 0.0;
  };
  const Left left = left_of(making, making_of(137), some_names());
  const Unexplained* const noise = find(left.list, "noise");
  ASSERT_NE(noise, nullptr);
  EXPECT_EQ(noise->gyro, 1U);
  EXPECT_EQ(noise->from_s, 40.0);
  EXPECT_EQ(noise->to_s, 50.0);
  EXPECT_EQ(noise->text.substr(0, 43), "the noise is another one from 40 to 50 s, b")
      << noise->text;
  EXPECT_FALSE(holds(left.found, 1, Kind::kWhiteNoise));
  EXPECT_TRUE(holds(left.found, 1, Kind::kRateRandomWalk));
  EXPECT_TRUE(holds(left.found, 0, Kind::kWhiteNoise));
}

TEST(Leftovers, BurstsOfDriftTakeDriftBackButNoWhiteNoise) {
  Making making = making_of(138);
  std::mt19937_64 random(138);
  std::normal_distribution<double> normal;
  double drift_dps = 0.0;
  making.error = [&](std::size_t gyro, double t_s, double) {
    if (gyro != 0) return 0.0;
    if (t_s >= 60.0 && t_s < 70.0)
      drift_dps += 4e-3 * std::sqrt(making.interval_s) * normal(random);
    return drift_dps;
  };
  const Left left = left_of(making, making_of(138), some_names());
  const Unexplained* const bursts = find(left.list, "bursts");
  ASSERT_NE(bursts, nullptr);
  EXPECT_EQ(bursts->gyro, 0U);
  // A filter that expects little drift follows late.
  EXPECT_GE(bursts->from_s, 60.0);
  EXPECT_FALSE(holds(left.found, 0, Kind::kRateRandomWalk));
  EXPECT_FALSE(holds(left.found, 0, Kind::kGaussMarkov));
  EXPECT_TRUE(holds(left.found, 0, Kind::kWhiteNoise));
  EXPECT_TRUE(holds(left.found, 1, Kind::kRateRandomWalk));
}

// A scale factor that comes halfway is in no model file: it is said, not named.
TEST(Leftovers, SaysWhatTheSearchHasRejected) {
  Making making = making_of(139, 80.0);
  making.interval_s = 0.02;
  making.error = [](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 1 && t_s > 55.0 ? 2e-3 * rate_dps : 0.0;
  };
  const MadeStudy made(making);
  ASSERT_NE(made.study(), nullptr);
  Search search(made.study(), noise_effects(making));
  search.run();
  EXPECT_FALSE(search.rejected().empty());
  std::vector<Found> found = search.found();
  EXPECT_FALSE(holds(found, 1, Kind::kScaleFactor));
  const std::vector<Unexplained> list = leftovers(search, found);
  const Unexplained* const rate = find(list, "rate");
  ASSERT_NE(rate, nullptr);
  EXPECT_EQ(rate->gyro, 1U);
  EXPECT_EQ(rate->text.substr(0, 10), "resembles ") << rate->text;
  EXPECT_NE(rate->text.find("does not keep its size"), std::string::npos) << rate->text;
}

}  // namespace
}  // namespace vgyro::gap
