#include "daemon/host_time.h"

#include <gtest/gtest.h>

#include "daemon/deadline_timer.h"
#include "daemon/service.h"

namespace vgyro::daemon {
namespace {

using namespace std::chrono_literals;

constexpr TimePoint at(Duration t) {
  return time_from_ns(1'700'000'000'000'000'000) + t;
}
constexpr TimePoint steady(Duration t) {
  return time_from_ns(5'000'000'000) + t;
}

TEST(ForwardTime, IsTheWallClockWhileThatGoesForward) {
  ForwardTime time;
  EXPECT_EQ(time.update(at(0s), steady(0s)), at(0s));
  EXPECT_EQ(time.update(at(1s), steady(1s)), at(1s));
  EXPECT_EQ(time.update(at(1h), steady(2s)), at(1h)) << "set ahead";
  EXPECT_EQ(time.update(at(1h + 1s), steady(3s)), at(1h + 1s));
}

TEST(ForwardTime, GoesOnWhenTheClockIsSetBack) {
  ForwardTime time;
  time.update(at(0s), steady(0s));
  EXPECT_EQ(time.update(at(-1h), steady(1s)), at(1s));
  EXPECT_EQ(time.update(at(-1h + 1s), steady(2s)), at(2s));
  EXPECT_EQ(time.update(at(-2h), steady(3s)), at(3s)) << "and again";
}

TEST(ForwardTime, IsTheWallClockAgainWhenASampleHasToldOfIt) {
  ForwardTime time;
  time.update(at(0s), steady(0s));
  time.update(at(-1h), steady(1s));
  time.sample_came(at(-1h + 500ms));
  EXPECT_EQ(time.update(at(-1h + 1s), steady(2s)), at(-1h + 1s));
}

// While samples come the clock is not read; a step back in the silence after them is noticed all
// the same.
TEST(ForwardTime, GoesOnFromTheLastSampleWhenTheClockIsSetBackBehindIt) {
  ForwardTime time;
  time.update(at(0s), steady(0s));
  time.sample_came(at(30s));
  EXPECT_EQ(time.update(at(30s - 1h), steady(31s)), at(30s));
  EXPECT_EQ(time.update(at(31s - 1h), steady(32s)), at(31s));
}

// A step back between samples is left to their stamps.
TEST(ForwardTime, LeavesAStepBetweenSamplesToTheirStamps) {
  ForwardTime time;
  time.update(at(0s), steady(0s));
  time.sample_came(at(30s));
  time.sample_came(at(-1h + 31s));
  EXPECT_EQ(time.update(at(-1h + 32s), steady(32s)), at(-1h + 32s));
}

TEST(ForwardTime, LetsAClockBeSlewed) {
  ForwardTime time;
  time.update(at(0s), steady(0s));
  for (int i = 1; i < 100; ++i)
    EXPECT_EQ(time.update(at(i * 999ms), steady(i * 1000ms)), at(i * 999ms));
}

int readings = 0;
TimePoint next_second() {
  return at(std::chrono::seconds(++readings));
}

TEST(TurnClock, ReadsOnceATurnAndOnlyWhenAsked) {
  readings = 0;
  TurnClock clock(&next_second, &next_second);
  clock.begin_turn();
  EXPECT_EQ(readings, 0);
  EXPECT_EQ(clock.wall(), at(1s));
  EXPECT_EQ(clock.steady(), at(2s));
  EXPECT_EQ(clock.wall(), at(1s));
  EXPECT_EQ(clock.steady(), at(2s));
  clock.begin_turn();
  EXPECT_EQ(clock.steady(), at(3s));
}

TEST(Alarm, GoesOffForTheEarlierDeadline) {
  Alarm alarm;
  EXPECT_TRUE(alarm.is_late_for(at(40ms), steady(0s)));
  EXPECT_EQ(alarm.set(at(40ms), at(0ms), steady(300ms), steady(0ms)), Duration(40ms));
  EXPECT_EQ(alarm.set(at(400ms), at(0ms), steady(30ms), steady(0ms)), Duration(30ms));
  EXPECT_EQ(alarm.set(at(400ms), at(0ms), TimePoint::max(), steady(0ms)), Duration(400ms));
}

// A deadline that moves to a later time does not set the alarm: it goes off and is set again then.
TEST(Alarm, IsLateOnlyForADeadlineThatCameNearer) {
  Alarm alarm;
  alarm.set(at(40ms), at(0ms), TimePoint::max(), steady(0ms));
  EXPECT_FALSE(alarm.is_late_for(at(40ms), TimePoint::max()));
  EXPECT_FALSE(alarm.is_late_for(at(90ms), steady(50ms)));
  EXPECT_TRUE(alarm.is_late_for(at(39ms), TimePoint::max()));
  EXPECT_TRUE(alarm.is_late_for(at(40ms), steady(39ms)));
  EXPECT_TRUE(alarm.is_late_for(at(-1h), TimePoint::max())) << "the clock was set back";
}

// Neither a busy loop nor a sleep that outlasts a change of the clock.
TEST(Alarm, WaitsForAMillisecondAtLeastAndASecondAtMost) {
  Alarm alarm;
  EXPECT_EQ(alarm.set(at(-5s), at(0s), TimePoint::max(), steady(0s)), Alarm::kLeast);
  EXPECT_EQ(alarm.set(TimePoint::max(), at(0s), TimePoint::min(), steady(0s)), Alarm::kLeast);
  EXPECT_EQ(alarm.set(TimePoint::max(), at(0s), TimePoint::max(), steady(0s)), Alarm::kMost);
  EXPECT_EQ(alarm.set(at(1h), at(0s), steady(2s), steady(0s)), Alarm::kMost);
}

TEST(Patience, IsTwoPeriodsOfTheRate) {
  for (const Duration period : {Duration(2ms), Duration(10ms), Duration(20ms), Duration(50ms)}) {
    Patience patience;
    for (int i = 0; i < 200; ++i)
      patience.rate_at(at(i * period));
    EXPECT_NEAR(to_seconds(patience.value()), 2.0 * to_seconds(period), 1e-5);
  }
}

TEST(Patience, HasLimitsAndIsNotMovedByPausesOrClocks) {
  Patience fast;
  Patience slow;
  for (int i = 0; i < 500; ++i) {
    fast.rate_at(at(i * 100us));
    slow.rate_at(at(i * 900ms));
  }
  EXPECT_EQ(fast.value(), Duration(2ms));
  EXPECT_EQ(slow.value(), Duration(200ms));
  Patience patience;
  const Duration before = patience.value();
  for (const Duration t : {Duration(0s), Duration(1h), Duration(2s), Duration(2s)})
    patience.rate_at(at(t));
  EXPECT_EQ(patience.value(), before);
}

TEST(LifeSign, IsGivenWhileFramesGoOut) {
  LifeSign life;
  std::uint64_t put_out = 0;
  for (int i = 0; i < 10; ++i)
    EXPECT_TRUE(life.has_moved(steady(i * 5s), put_out += 30));
}

TEST(LifeSign, EndsWhenNothingGoesOutAlthoughTheLoopTurns) {
  LifeSign life;
  EXPECT_TRUE(life.has_moved(steady(0s), 10));
  EXPECT_FALSE(life.has_moved(steady(5s), 10));
  EXPECT_FALSE(life.has_moved(steady(10s), 10));
  EXPECT_TRUE(life.has_moved(steady(15s), 11));
}

// Calls between two frames must not count as a hang.
TEST(LifeSign, MayBeAskedMoreOftenThanFramesGoOut) {
  LifeSign life;
  EXPECT_TRUE(life.has_moved(steady(0ms), 10));
  EXPECT_TRUE(life.has_moved(steady(50ms), 10));
  EXPECT_TRUE(life.has_moved(steady(100ms), 12));
}

TEST(LifeSign, IsNoneBeforeTheFirstFrame) {
  LifeSign life;
  EXPECT_FALSE(life.has_moved(time_from_ns(0), 0));
}

}  // namespace
}  // namespace vgyro::daemon
