#include "fusion/stamp_guard.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using namespace std::chrono_literals;
using StampVerdict = StampGuard::StampVerdict;

constexpr std::size_t kReference = 2;
constexpr TimePoint kStart = time_from_ns(1'700'000'000'000'000'000);

/// A guard with all streams running at 100 Hz from kStart to kStart + until.
StampGuard running_until(Duration until) {
  StampGuard guard;
  TimePoint t;
  for (Duration d{0}; d <= until; d += 10ms) {
    for (std::size_t stream = 0; stream < StampGuard::kStreams; ++stream)
      EXPECT_EQ(guard.check(stream, kStart + d, t), StampVerdict::kAccepted);
  }
  return guard;
}

struct Checked {
  StampVerdict verdict;
  Duration since_start;
};

Checked check(StampGuard& guard, std::size_t stream, Duration since_start) {
  TimePoint t;
  const StampVerdict verdict = guard.check(stream, kStart + since_start, t);
  return {verdict, t - kStart};
}

// Stamps in order are not changed, wherever the clock began.
TEST(StampGuard, PassesOrderlyStampsOnUnchanged) {
  for (const TimePoint start : {time_from_ns(0), kStart}) {
    StampGuard guard;
    TimePoint t;
    for (int i = 0; i < 1000; ++i) {
      const TimePoint raw = start + i * 10ms;
      ASSERT_EQ(guard.check(static_cast<std::size_t>(i) % 3, raw, t), StampVerdict::kAccepted);
      ASSERT_EQ(t, raw);
    }
    EXPECT_EQ(guard.offset(), 0ns);
  }
}

// The same frame seen twice must not count twice.
TEST(StampGuard, RefusesARepeatedStamp) {
  StampGuard guard = running_until(100ms);
  EXPECT_EQ(check(guard, 0, 100ms).verdict, StampVerdict::kRepeated);
  EXPECT_EQ(check(guard, 0, 100ms).verdict, StampVerdict::kRepeated);
  EXPECT_EQ(check(guard, 0, 110ms).verdict, StampVerdict::kAccepted);
  EXPECT_EQ(check(guard, 1, 110ms).verdict, StampVerdict::kAccepted) << "streams may share a stamp";
}

// Two queues of one kernel deliver slightly out of order: the clock was not set.
TEST(StampGuard, LetsSmallReorderingPass) {
  StampGuard guard = running_until(1s);
  const Checked late = check(guard, 0, 1s - 249ms);
  EXPECT_EQ(late.verdict, StampVerdict::kAccepted);
  EXPECT_EQ(late.since_start, 751ms);
  EXPECT_EQ(check(guard, 0, 1s).verdict, StampVerdict::kRepeated) << "the newest stays the newest";
  EXPECT_EQ(check(guard, 0, 1010ms).verdict, StampVerdict::kAccepted);
  EXPECT_EQ(guard.offset(), 0ns);
}

// A garbage stamp in the middle of good ones, far ahead or far behind, leaves no trace.
TEST(StampGuard, RefusesSingleOutliers) {
  for (const Duration outlier : std::initializer_list<Duration>{-1'699'999'999s, -3600s, -1s,
                                                                -252ms, 10s + 100ms, 24h * 365}) {
    StampGuard guard = running_until(1s);
    for (int i = 1; i <= 5; ++i) {
      EXPECT_EQ(check(guard, 0, 1s + outlier + i * 1ms).verdict, StampVerdict::kUnconfirmed)
          << to_seconds(outlier);
      const Checked good = check(guard, 0, 1s + i * 10ms);
      EXPECT_EQ(good.verdict, StampVerdict::kAccepted);
      EXPECT_EQ(good.since_start, 1s + i * 10ms);
    }
    EXPECT_EQ(guard.offset(), 0ns);
  }
}

// Garbage is rarely consistent: stamps that do not follow each other confirm nothing.
TEST(StampGuard, RefusesOutliersThatDoNotAgree) {
  constexpr std::uint64_t kSeed = 1;
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  Random random(kSeed);
  StampGuard guard = running_until(1s);
  for (int i = 0; i < 10'000; ++i) {
    const auto outlier = std::chrono::hours(1 + static_cast<int>(random.below(100'000)));
    ASSERT_EQ(check(guard, 0, i % 2 == 0 ? outlier : -outlier).verdict, StampVerdict::kUnconfirmed);
  }
  EXPECT_EQ(check(guard, 0, 1010ms).since_start, 1010ms);
}

// Stamps whose spacing fits no gyro confirm nothing either.
TEST(StampGuard, RefusesOutliersThatLieFarApart) {
  StampGuard guard = running_until(1s);
  for (int i = 1; i < 100; ++i)
    ASSERT_EQ(check(guard, 0, i * 3600s).verdict, StampVerdict::kUnconfirmed);
  EXPECT_EQ(check(guard, 0, 1010ms).since_start, 1010ms);
}

// Centuries lie between the stamps that a damaged log may hold, and their differences do not
// overflow (the sanitizers would report it); good stamps are accepted again afterwards.
TEST(StampGuard, SurvivesEveryStampThatALogMayHold) {
  constexpr TimePoint kEarliest = time_from_ns(0);
  constexpr TimePoint kLatest = time_from_ns(9'000'000'000'000'000'000);
  StampGuard guard = running_until(1s);
  TimePoint t;
  for (int turn = 0; turn < 5; ++turn) {
    for (const TimePoint base : {kLatest, kEarliest}) {
      for (int i = 0; i < 4; ++i)
        guard.check(static_cast<std::size_t>(turn % 2), base + i * 10ms, t);
    }
    guard.check(0, kLatest, t);
    guard.check(0, kEarliest, t);
  }
  for (int i = 1; i <= 200; ++i)
    guard.check(0, kStart + i * 10ms, t);
  EXPECT_EQ(guard.check(0, kStart + 2010ms, t), StampVerdict::kAccepted);
}

// A computer without a battery begins in 1970. When its clock is set, the monotone axis does not
// jump by half a century, so the biases stay valid.
TEST(StampGuard, TakesDecadesForAClockThatWasSet) {
  StampGuard guard;
  TimePoint t;
  for (int i = 0; i <= 100; ++i) {
    guard.check(0, time_from_ns(0) + i * 10ms, t);
    guard.check(1, time_from_ns(0) + i * 10ms, t);
  }
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(guard.check(0, kStart + i * 10ms, t), StampVerdict::kUnconfirmed);
  EXPECT_EQ(guard.check(0, kStart + 20ms, t), StampVerdict::kClockStep);
  EXPECT_EQ(t, time_from_ns(0) + 1s + 1us);
  EXPECT_EQ(guard.check(1, kStart + 30ms, t), StampVerdict::kAccepted);
  EXPECT_EQ(t, time_from_ns(0) + 1s + 10ms + 1us);
}

// A stream that still has stamps of 1970 after the gyros' clock was set lies before the beginning
// of the axis; such stamps are never accepted, whether the stream is new or not.
TEST(StampGuard, TakesNothingFromBeforeTheAxisBegins) {
  StampGuard guard;
  TimePoint t;
  for (int i = 0; i <= 100; ++i)
    guard.check(0, time_from_ns(0) + i * 10ms, t);
  for (int i = 0; i <= 3; ++i)
    guard.check(0, kStart + i * 10ms, t);
  ASSERT_LT(guard.offset(), 0ns);
  for (int i = 1; i <= 10; ++i) {
    EXPECT_EQ(guard.check(kReference, time_from_ns(0) + i * 10ms, t), StampVerdict::kUnconfirmed)
        << i;
  }
  EXPECT_EQ(guard.check(kReference, kStart + 40ms, t), StampVerdict::kAccepted);
  EXPECT_GE(t, TimePoint{});
}

// A silent bus returns after minutes: the third stamp is accepted, and time continues from it.
TEST(StampGuard, BelievesThreeAgreeingStampsBehindALongGap) {
  StampGuard guard = running_until(1s);
  EXPECT_EQ(check(guard, 0, 600s).verdict, StampVerdict::kUnconfirmed);
  EXPECT_EQ(check(guard, 0, 600s + 10ms).verdict, StampVerdict::kUnconfirmed);
  const Checked third = check(guard, 0, 600s + 20ms);
  EXPECT_EQ(third.verdict, StampVerdict::kAccepted);
  EXPECT_EQ(third.since_start, 600s + 20ms);
  EXPECT_EQ(check(guard, 0, 600s + 30ms).since_start, 600s + 30ms);
  EXPECT_EQ(guard.offset(), 0ns);
}

// Up to one second needs no confirmation: no frame is lost to an ordinary pause.
TEST(StampGuard, TakesAnOrdinaryPauseAtOnce) {
  StampGuard guard = running_until(1s);
  EXPECT_EQ(check(guard, 0, 2s).verdict, StampVerdict::kAccepted);
}

// If one stamp a few seconds ahead were accepted, all later ones would look set back, and the axis
// would move.
TEST(StampGuard, IsNotMovedByOneStampSecondsAhead) {
  StampGuard guard = running_until(1s);
  EXPECT_EQ(check(guard, 0, 6s).verdict, StampVerdict::kUnconfirmed);
  for (Duration raw = 1010ms; raw < 8s; raw += 10ms) {
    const Checked next = check(guard, 0, raw);
    ASSERT_EQ(next.verdict, StampVerdict::kAccepted);
    ASSERT_EQ(next.since_start, raw);
  }
  EXPECT_EQ(guard.offset(), 0ns);
}

// The host's clock was set back: the axis continues from the newest time of any stream, and the
// other streams follow without a step of their own.
TEST(StampGuard, TakesASteppedBackClockUpMonotonically) {
  for (const Duration step : {300ms, 1000ms, 3'600'000ms}) {
    StampGuard guard = running_until(1s);
    TimePoint t;
    ASSERT_EQ(guard.check(1, kStart + 1015ms, t), StampVerdict::kAccepted);
    EXPECT_EQ(check(guard, 0, 1020ms - step).verdict, StampVerdict::kUnconfirmed);
    EXPECT_EQ(check(guard, 0, 1030ms - step).verdict, StampVerdict::kUnconfirmed);
    const Checked third = check(guard, 0, 1040ms - step);
    EXPECT_EQ(third.verdict, StampVerdict::kClockStep);
    EXPECT_EQ(third.since_start, 1015ms + 1us) << "newest of all streams, and a little";
    EXPECT_EQ(guard.offset(), step - 25ms + 1us);
    for (int i = 0; i < 100; ++i) {
      const Duration raw = 1045ms + i * 10ms - step;
      const Checked other = check(guard, 1, raw);
      EXPECT_EQ(other.verdict, StampVerdict::kAccepted);
      EXPECT_EQ(other.since_start, raw + guard.offset());
      EXPECT_GT(other.since_start, 1015ms);
      EXPECT_EQ(check(guard, 0, raw + 5ms).verdict, StampVerdict::kAccepted);
    }
  }
}

// A clock that is set again and again never takes the axis back, and never stops the streams.
TEST(StampGuard, KeepsTheAxisMonotoneOverManySteps) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    Random random(seed);
    StampGuard guard;
    Duration clock{0};
    std::array<TimePoint, 2> last{};
    TimePoint newest{};
    int steps = 0;
    int accepted = 0;
    for (int i = 0; i < 20'000; ++i) {
      clock += 5ms;
      if (random.below(500) == 0) clock -= from_seconds(random.uniform(0.3, 5000.0));
      const std::size_t stream = static_cast<std::size_t>(i) % 2;
      TimePoint t;
      const StampVerdict verdict = guard.check(stream, kStart + clock, t);
      if (verdict == StampVerdict::kUnconfirmed) continue;
      ASSERT_NE(verdict, StampVerdict::kRepeated);
      if (verdict == StampVerdict::kClockStep) {
        ++steps;
        ASSERT_GT(t, newest);
      }
      ++accepted;
      ASSERT_GT(t, last[stream]) << i;
      last[stream] = t;
      newest = std::max(newest, t);
    }
    EXPECT_GT(steps, 10);
    // Each step costs five stamps until one stream has sent three.
    EXPECT_GE(accepted, 20'000 - 6 * (steps + 5));
  }
}

// A reference often has a clock of its own: it waits until that agrees with the gyros.
TEST(StampGuard, LetsNoReferenceSetTheClockBack) {
  StampGuard guard = running_until(100s);
  for (int i = 0; i < 1000; ++i)
    ASSERT_EQ(check(guard, kReference, 20s + i * 10ms).verdict, StampVerdict::kUnconfirmed);
  EXPECT_EQ(guard.offset(), 0ns);
  EXPECT_EQ(check(guard, 0, 100s + 10ms).since_start, 100s + 10ms);
  EXPECT_EQ(check(guard, kReference, 100s + 10ms).verdict, StampVerdict::kAccepted);
}

// A reference that ran an hour ahead must not pull the gyros there when their clock steps back.
TEST(StampGuard, LetsNoReferenceAheadMoveTheGyrosTime) {
  StampGuard guard = running_until(10s);
  for (int i = 0; i < 3; ++i)
    check(guard, kReference, 3600s + i * 10ms);
  check(guard, 0, 5s);
  check(guard, 0, 5s + 10ms);
  const Checked third = check(guard, 0, 5s + 20ms);
  EXPECT_EQ(third.verdict, StampVerdict::kClockStep);
  EXPECT_EQ(third.since_start, 10s + 1us);
  EXPECT_EQ(check(guard, kReference, 5s + 30ms).verdict, StampVerdict::kAccepted)
      << "and its own clock, set right with theirs, is believed at once";
}

// When the gyros' clock steps back, a reference on the same host continues with them.
TEST(StampGuard, CarriesTheReferenceOverAStepOfTheGyrosClock) {
  StampGuard guard = running_until(10s);
  for (int i = 0; i < 3; ++i)
    check(guard, 0, 5s + i * 10ms);
  const Checked reference = check(guard, kReference, 5s + 25ms);
  EXPECT_EQ(reference.verdict, StampVerdict::kAccepted);
  EXPECT_EQ(reference.since_start, 10s + 5ms + 1us);
}

// --- difficult streams ---------------------------------------------------------------------------

/// How many of these stamps are accepted, with any accepting verdict.
int accepted_of(StampGuard& guard, std::size_t stream, Duration from, Duration interval, int count,
                int times_each = 1) {
  int accepted = 0;
  for (int i = 0; i < count; ++i) {
    for (int copy = 0; copy < times_each; ++copy) {
      const StampVerdict verdict = check(guard, stream, from + i * interval).verdict;
      if (verdict == StampVerdict::kAccepted || verdict == StampVerdict::kClockStep) ++accepted;
    }
  }
  return accepted;
}

// One frame a second; one of them is slightly late, or lost.
TEST(StampGuard, GoesOnWithAStreamOfOneHertzBehindALateFrame) {
  StampGuard guard;
  EXPECT_EQ(accepted_of(guard, 0, 0s, 1s, 10), 10);
  EXPECT_EQ(accepted_of(guard, 0, 10s + 15ms, 1s, 10), 10);
  EXPECT_EQ(accepted_of(guard, 0, 21s, 1s, 10), 10);
}

// Slower than a second from the first frame on: its own even pace confirms it.
TEST(StampGuard, TakesStreamsThatAreSlowerThanASecond) {
  for (const Duration interval : {1001ms, 1500ms, 3000ms, 5000ms}) {
    StampGuard guard;
    EXPECT_GE(accepted_of(guard, 0, 0s, interval, 100), 97) << to_seconds(interval);
    StampGuard fast = running_until(10s);
    EXPECT_GE(accepted_of(fast, 0, 20s, interval, 100), 97) << to_seconds(interval);
    StampGuard set_back = running_until(1000s);
    EXPECT_GE(accepted_of(set_back, 0, 20s, interval, 100), 97) << to_seconds(interval);
  }
  StampGuard guard;
  EXPECT_EQ(accepted_of(guard, 0, 0s, 6s, 100), 1) << "that is no gyro";
}

// A relay sends everything twice, or the last but one again, across a hole and a step back.
TEST(StampGuard, BelievesDoubledFramesBehindAHole) {
  for (const Duration from : {12s, 600s, 5s}) {
    StampGuard guard = running_until(10s);
    EXPECT_EQ(accepted_of(guard, 0, from, 10ms, 100, 2), 98) << to_seconds(from);
  }
  StampGuard guard = running_until(10s);
  int accepted = 0;
  for (int i = 0; i < 100; ++i) {
    accepted += check(guard, 0, 12s + i * 10ms).verdict == StampVerdict::kAccepted ? 1 : 0;
    check(guard, 0, 12s + (i - 1) * 10ms);
  }
  EXPECT_EQ(accepted, 98);
}

// A reference that had run ahead returns to the gyros' time and is accepted again.
TEST(StampGuard, HearsAReferenceAgainThatHadRunAhead) {
  StampGuard guard = running_until(10s);
  EXPECT_GT(accepted_of(guard, kReference, 3600s, 10ms, 100), 90);
  for (const std::size_t stream : {0U, 1U})
    EXPECT_EQ(accepted_of(guard, stream, 10s + 10ms, 10ms, 100), 100);
  EXPECT_GE(accepted_of(guard, kReference, 11s, 10ms, 100), 98);
  EXPECT_EQ(guard.offset(), 0ns);
}

}  // namespace
}  // namespace vgyro::fusion
