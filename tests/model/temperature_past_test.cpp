#include "model/temperature_past.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::model {
namespace {

constexpr std::uint64_t kSeed = 12;

/// Simulates the play itself, step by step, for one play.
class Follower {
 public:
  explicit Follower(double play_k) : play_k_(play_k) {}

  double follow(double temperature_c) {
    if (std::isnan(followed_c_)) followed_c_ = temperature_c;
    followed_c_ = std::min(std::max(followed_c_, temperature_c - play_k_), temperature_c + play_k_);
    return followed_c_;
  }

 private:
  double play_k_;
  double followed_c_ = std::nan("");
};

const std::vector<double> kPlays_k{0.0, 1e-3, 0.1, 0.35, 0.8, 1.5, 2.0, 5.0, 40.0};

void expect_follows(const std::vector<double>& temperatures_c, double close_k) {
  TemperaturePast past;
  std::vector<Follower> followers(kPlays_k.begin(), kPlays_k.end());
  for (std::size_t i = 0; i < temperatures_c.size(); ++i) {
    // Compared before the temperature is added to the past, and after.
    if (i > 0) {
      for (const double play_k : kPlays_k) {
        const double ahead_c = past.followed_c(play_k, temperatures_c[i]);
        TemperaturePast later = past;
        later.add(temperatures_c[i]);
        EXPECT_NEAR(later.followed_c(play_k, temperatures_c[i]), ahead_c, std::max(1e-12, close_k));
      }
    }
    past.add(temperatures_c[i]);
    for (std::size_t k = 0; k < kPlays_k.size(); ++k) {
      EXPECT_NEAR(past.followed_c(kPlays_k[k], temperatures_c[i]),
                  followers[k].follow(temperatures_c[i]), close_k)
          << "sample " << i << ", play " << kPlays_k[k];
    }
  }
}

TEST(TemperaturePast, BeginsAtTheFirstTemperature) {
  TemperaturePast past;
  EXPECT_TRUE(past.empty());
  past.add(21.0);
  EXPECT_FALSE(past.empty());
  for (const double play_k : kPlays_k)
    EXPECT_EQ(past.followed_c(play_k, 21.0), 21.0);
}

// Up by 3, back by 1, computed by hand for a play of 1 on both sides.
TEST(TemperaturePast, StaysBehindWhereTheTemperatureTurnsRound) {
  TemperaturePast past;
  past.add(20.0);
  EXPECT_EQ(past.followed_c(1.0, 20.5), 20.0);
  EXPECT_EQ(past.followed_c(1.0, 23.0), 22.0);
  past.add(23.0);
  EXPECT_EQ(past.followed_c(1.0, 22.0), 22.0);
  EXPECT_EQ(past.followed_c(1.0, 21.5), 22.0);
  EXPECT_EQ(past.followed_c(1.0, 20.0), 21.0);
}

TEST(TemperaturePast, FollowsWithEveryPlayAtOnce) {
  RecordProperty("seed", std::to_string(kSeed));
  std::mt19937_64 random(kSeed);
  std::vector<double> waves_c;
  std::vector<double> jumps_c;
  std::uniform_real_distribution<double> level(-3.0, 3.0);
  for (int i = 0; i < 2000; ++i) {
    const double x = 0.01 * i;
    waves_c.push_back(25.0 + 4.0 * std::sin(x) + 1.3 * std::sin(2.9 * x) +
                      0.2 * std::sin(17.0 * x));
    jumps_c.push_back(20.0 + level(random));
  }
  expect_follows(waves_c, 1e-9);
  // Random jumps: now and then they nest deeper than the number of bends kept.
  expect_follows(jumps_c, 0.02);
}

// Each swing is smaller than the last, and there are more than are kept. The error has the size of
// the smallest ones.
TEST(TemperaturePast, LosesOnlyTheSmallestSwings) {
  std::vector<double> ringing_c;
  for (int i = 0; i < 60; ++i)
    ringing_c.push_back(25.0 + 8.0 * std::pow(0.8, i) * (i % 2 == 0 ? 1.0 : -1.0));
  expect_follows(ringing_c, 8.0 * std::pow(0.8, TemperaturePast::kBendsMax - 3));
  // A large swing erases them all.
  ringing_c.push_back(0.0);
  TemperaturePast past;
  for (const double temperature_c : ringing_c)
    past.add(temperature_c);
  EXPECT_NEAR(past.followed_c(1.0, 0.0), 1.0, 1e-12);
  EXPECT_NEAR(past.followed_c(1.0, 5.0), 4.0, 1e-12);
}

// Noise that reverses at every sample, for any length of time, erases only swings of its own size.
TEST(TemperaturePast, IsNotWornOutByNoise) {
  std::mt19937_64 random(kSeed);
  std::normal_distribution<double> noise(0.0, 0.01);
  std::vector<double> noisy_c;
  for (int i = 0; i < 20000; ++i)
    noisy_c.push_back(25.0 + 6.0 * std::sin(2.0 * std::numbers::pi * i / 5000.0) + noise(random));
  TemperaturePast past;
  Follower follower(1.5);
  for (const double temperature_c : noisy_c) {
    past.add(temperature_c);
    ASSERT_NEAR(past.followed_c(1.5, temperature_c), follower.follow(temperature_c), 1e-3);
  }
}

}  // namespace
}  // namespace vgyro::model
