// Which stamps can be the time of an arrival, also after waits, stops and set clocks.

#include "can/arrival_watch.h"

#include <gtest/gtest.h>

namespace vgyro::can {
namespace {

using namespace std::chrono_literals;

constexpr Duration kDay = 24h;
/// The wall clock's lead over the steady one.
constexpr Duration kEpoch = 20'000 * kDay;

ArrivalWatch::Clocks clocks_at(Duration since, Duration set_by = {}) {
  return {TimePoint(kEpoch + since + set_by), TimePoint(since)};
}

TimePoint wall_at(Duration since) {
  return clocks_at(since).wall;
}

/// The queue is checked every second up to the tenth.
class ArrivalWatchTest : public testing::Test {
 protected:
  ArrivalWatchTest() {
    watch.opened(clocks_at(0s));
    for (int second = 1; second <= 10; ++second)
      watch.seen_empty(clocks_at(std::chrono::seconds(second)));
  }
  ArrivalWatch watch;
};

TEST_F(ArrivalWatchTest, AFrameOfThisSecondNeedsNoClock) {
  for (const Duration since : {9'900ms, 10'000ms, 10'500ms, 11'000ms}) {
    EXPECT_TRUE(watch.is_near(wall_at(since)));
    EXPECT_TRUE(watch.may_be_arrival(wall_at(since), clocks_at(since + 1ms)));
  }
}

TEST_F(ArrivalWatchTest, ALaunchTimeOnAnotherClockIsNoArrival) {
  const ArrivalWatch::Clocks now = clocks_at(10'400ms);
  const TimePoint monotonic = now.steady;
  const TimePoint tai = now.wall + 37s;
  for (const TimePoint launch : {monotonic, tai, TimePoint{}, TimePoint::max(), TimePoint::min(),
                                 now.wall + 3s, now.wall - 3s}) {
    EXPECT_FALSE(watch.is_near(launch));
    EXPECT_FALSE(watch.may_be_arrival(launch, now));
  }
}

TEST_F(ArrivalWatchTest, WhatWaitedWhileTheProcessWasStoppedHasComeWhenItsStampSays) {
  const ArrivalWatch::Clocks now = clocks_at(10'300ms + 60s);
  for (const Duration since : {10'301ms, 15'000ms, 40'000ms, 70'299ms})
    EXPECT_TRUE(watch.may_be_arrival(wall_at(since), now));
  EXPECT_FALSE(watch.may_be_arrival(wall_at(5s), now)) << "it would have been read before";
  EXPECT_FALSE(watch.may_be_arrival(wall_at(73s), now)) << "it has not come yet";
}

TEST_F(ArrivalWatchTest, WhatIsLeftOfALongQueueIsJudgedByWhenTheQueueWasLastEmpty) {
  // Stopped for a minute; seconds later the queue still holds frames, so it was not seen empty.
  const ArrivalWatch::Clocks now = clocks_at(73s);
  EXPECT_TRUE(watch.may_be_arrival(wall_at(12s), now));
}

TEST_F(ArrivalWatchTest, AStopBetweenTheLookAndTheReadingOfTheClockTurnsNothingAway) {
  // The queue was empty at 10.9 s; then the process was stopped for 20 s, and read the clock.
  watch.seen_empty(clocks_at(31s));
  EXPECT_TRUE(watch.may_be_arrival(wall_at(12s), clocks_at(31'100ms)));
}

TEST_F(ArrivalWatchTest, AClockThatIsSetIsNoSendersFault) {
  for (const Duration set_by : {Duration(3h), -Duration(3h)}) {
    const ArrivalWatch::Clocks now = clocks_at(10'400ms, set_by);
    EXPECT_TRUE(watch.may_be_arrival(now.wall - 1ms, now)) << "came after the clock was set";
    EXPECT_TRUE(watch.may_be_arrival(wall_at(10'100ms), now)) << "came before";
    EXPECT_FALSE(watch.may_be_arrival(now.wall - set_by / 2, now));
    // The next checks are on the new clock.
    ArrivalWatch later = watch;
    later.seen_empty(clocks_at(11s, set_by));
    EXPECT_TRUE(later.is_near(clocks_at(11'500ms, set_by).wall));
  }
}

TEST_F(ArrivalWatchTest, ASuspendedHostsClockIsOneThatWasSet) {
  // The steady clock stops during the suspension.
  const ArrivalWatch::Clocks now = clocks_at(10'400ms, 5h);
  EXPECT_TRUE(watch.may_be_arrival(wall_at(10'200ms), now));
  EXPECT_TRUE(watch.may_be_arrival(now.wall, now));
}

}  // namespace
}  // namespace vgyro::can
