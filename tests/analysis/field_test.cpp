// Tests whether bytes are one quantity that moves like a rate.

#include "analysis/field.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

constexpr unsigned kSeed = 97;
constexpr int kSamples = 4000;

std::vector<double> made(double (*value)(int)) {
  std::vector<double> values;
  values.reserve(kSamples);
  for (int i = 0; i < kSamples; ++i)
    values.push_back(value(i));
  return values;
}

bool as_a_rate(double (*value)(int)) {
  return moves_as_a_rate(field_figures(made(value)));
}

TEST(Field, ARateGoesToAndFroInSmallSteps) {
  EXPECT_TRUE(as_a_rate([](int i) { return std::round(3000.0 * std::sin(0.01 * i)); }));
  // A coarse rate with a dozen steps.
  EXPECT_TRUE(as_a_rate([](int i) { return std::round(6.0 * std::sin(0.01 * i)); }));
}

TEST(Field, CountersWrapsFlagsAndGrowthAreNoRate) {
  EXPECT_FALSE(as_a_rate([](int i) { return static_cast<double>(i % 256); }));
  EXPECT_FALSE(as_a_rate([](int i) { return static_cast<double>(i / 3); }));
  EXPECT_FALSE(as_a_rate([](int i) { return static_cast<double>(i / 100 % 2); }));
  EXPECT_FALSE(as_a_rate([](int) { return 17.0; }));
  // A rate that is read without its sign leaps across the whole range.
  EXPECT_FALSE(as_a_rate(
      [](int i) { return std::fmod(65536.0 + std::round(300.0 * std::sin(0.01 * i)), 65536.0); }));
}

TEST(Field, ChanceIsNoRate) {
  std::mt19937 random(kSeed);
  std::vector<double> values;
  for (int i = 0; i < kSamples; ++i)
    values.push_back(static_cast<double>(random() % 65536));
  EXPECT_FALSE(moves_as_a_rate(field_figures(values)));
}

TEST(Field, BytesOfOneNumberCarryThoseOfTwoDoNot) {
  std::mt19937 random(kSeed);
  std::vector<std::int64_t> one;
  std::vector<std::int64_t> two;
  for (int i = 0; i < kSamples; ++i) {
    one.push_back(std::lround(3000.0 * std::sin(0.01 * i)) + static_cast<int>(random() % 64));
    two.push_back(std::lround(12.0 * std::sin(0.01 * i)) * 256 + static_cast<int>(random() % 256));
  }
  EXPECT_TRUE(carries_into(one, 8));
  EXPECT_FALSE(carries_into(two, 8));
  EXPECT_FALSE(carries_into(std::vector<std::int64_t>(kSamples, 5), 8));
  EXPECT_FALSE(carries_into({}, 8));
}

}  // namespace
}  // namespace vgyro::analysis
