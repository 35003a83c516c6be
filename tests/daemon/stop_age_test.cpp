// The age of the last stop that was learned from, for every change of the pipeline's counter.

#include "daemon/stop_age.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgyro::daemon {
namespace {

TimePoint second(std::int64_t count) {
  return TimePoint{std::chrono::seconds(count)};
}

TEST(StopAge, IsUnknownBeforeTheFirstStop) {
  StopAge age;
  age.count_is(0, second(10));
  EXPECT_TRUE(std::isnan(age.age_s(second(20))));
}

TEST(StopAge, GrowsFromTheLastStop) {
  StopAge age;
  age.count_is(1, second(10));
  age.count_is(1, second(11));
  EXPECT_DOUBLE_EQ(age.age_s(second(40)), 30.0);
  age.count_is(3, second(41));
  EXPECT_DOUBLE_EQ(age.age_s(second(42)), 1.0);
}

TEST(StopAge, ACounterThatFallsIsNoStop) {
  StopAge age;
  age.count_is(5, second(10));
  age.count_is(4, second(20));
  EXPECT_DOUBLE_EQ(age.age_s(second(20)), 10.0);
  age.count_is(0, second(30));
  EXPECT_DOUBLE_EQ(age.age_s(second(30)), 20.0);
  age.count_is(1, second(40));
  EXPECT_DOUBLE_EQ(age.age_s(second(40)), 0.0);
}

}  // namespace
}  // namespace vgyro::daemon
