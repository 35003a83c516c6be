#include "fusion/moving_variance.h"

#include <deque>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr Duration ms(std::int64_t count) {
  return std::chrono::milliseconds(count);
}

double variance_of(const std::deque<double>& values) {
  double mean = 0.0;
  for (const double value : values)
    mean += value / static_cast<double>(values.size());
  double sum = 0.0;
  for (const double value : values)
    sum += (value - mean) * (value - mean);
  return sum / static_cast<double>(values.size());
}

TEST(MovingVariance, IsThatOfTheLastSecond) {
  constexpr std::uint64_t kSeed = 5;
  SCOPED_TRACE(kSeed);
  Random random(kSeed);
  MovingVariance moving;
  std::deque<double> last_second;
  for (int i = 0; i < 20'000; ++i) {
    const double value = 9.81 + random.normal(i < 10'000 ? 0.3 : 1e-4);
    moving.add(TimePoint{ms(10 * i)}, value);
    last_second.push_back(value);
    if (last_second.size() > 100) last_second.pop_front();
    ASSERT_NEAR(moving.variance(), variance_of(last_second), 1e-12) << i;
  }
}

TEST(MovingVariance, OfNothingIsZero) {
  MovingVariance moving;
  EXPECT_EQ(moving.variance(), 0.0);
  moving.add(TimePoint{}, 3.0);
  EXPECT_EQ(moving.variance(), 0.0);
  EXPECT_EQ(moving.count(), 1U);
}

TEST(MovingVariance, ForgetsWhatAnOldLargeValueLeftInTheSums) {
  MovingVariance moving;
  moving.add(TimePoint{ms(0)}, 1e8);
  for (int i = 1; i < 10'000; ++i)
    moving.add(TimePoint{ms(i)}, 1.0 + (i % 2) * 1e-3);
  EXPECT_NEAR(moving.variance(), 0.25e-6, 1e-9);
}

TEST(MovingVariance, IsBounded) {
  MovingVariance moving;
  for (int i = 0; i < 100'000; ++i)
    moving.add(TimePoint{Duration{1'000 * i}}, i % 2);
  EXPECT_EQ(moving.count(), MovingVariance::kCapacity);
  EXPECT_NEAR(moving.variance(), 0.25, 1e-9);
}

// The stream had run ahead by an hour and returns.
TEST(MovingVariance, BeginsAnewWhenTimeIsSetBack) {
  MovingVariance moving;
  for (int i = 0; i < 10; ++i)
    moving.add(TimePoint{ms(3'600'000 + 10 * i)}, i % 2 == 0 ? 5.0 : -5.0);
  for (int i = 0; i < 10; ++i)
    moving.add(TimePoint{ms(10 * i)}, i % 2 == 0 ? 1.0 : 3.0);
  EXPECT_EQ(moving.count(), 10U);
  EXPECT_NEAR(moving.variance(), 1.0, 1e-12);
}

}  // namespace
}  // namespace vgyro::fusion
