#include "can/stamp_clock.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgyro::can {
namespace {

using namespace std::chrono_literals;

constexpr TimePoint at(Duration since_start) {
  return time_from_ns(1'700'000'000'000'000'000) + since_start;
}

TEST(StampClock, PassesSoftwareStampsOnWhereThereIsNoHardwareClock) {
  StampClock clock;
  EXPECT_EQ(clock.host_time(at(5ms), TimePoint{}), at(5ms));
}

TEST(StampClock, GivesHardwarePrecisionOnTheHostsClock) {
  StampClock clock;
  const double drift = 80e-6;
  Duration worst_after_a_second{};
  for (int i = 0; i < 2000; ++i) {
    const Duration truth = i * 5ms;
    const Duration late = std::chrono::microseconds(5 + (i * 7919) % 900);
    const auto hardware = time_from_ns(7'000'000) + truth + from_seconds(to_seconds(truth) * drift);
    const Duration error = clock.host_time(at(truth) + late, hardware) - at(truth);
    if (truth > 1s) worst_after_a_second = std::max(worst_after_a_second, std::chrono::abs(error));
  }
  EXPECT_LT(worst_after_a_second, 2 * 80us + 15us) << "two intervals of drift and the least delay";
}

TEST(StampClock, FollowsAClockThatWasSet) {
  StampClock clock;
  for (int i = 0; i < 100; ++i)
    clock.host_time(at(i * 10ms), time_from_ns(1) + i * 10ms);
  EXPECT_EQ(clock.host_time(at(1h), time_from_ns(1) + 1s), at(1h));
  EXPECT_EQ(clock.host_time(at(2s), time_from_ns(1) + 1010ms), at(2s));
}

}  // namespace
}  // namespace vgyro::can
