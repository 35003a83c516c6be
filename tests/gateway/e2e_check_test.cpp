#include "gateway/e2e_check.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::codec_of;
using rig::frame_of;
using rig::signal_of;

constexpr std::uint32_t kId = 0x101;

// Counter 0…14 in byte 1, CRC in byte 0: profile 1 A of data ID 0x123.
E2ePlan plan_of(std::uint32_t max_delta, bool crc) {
  E2ePlan plan;
  plan.counter = AliveCounter{
      "Counter", codec_of(signal_of(8, 4, 1.0, 0.0, dbc::ValueType::kUnsigned)), 15, max_delta};
  if (crc) {
    plan.crc =
        CheckValue{"Crc", "profile_1a",
                   dbc::E2eProtection({.kind = dbc::E2eKind::kProfile1A, .data_ids = {0x123}})};
  }
  return plan;
}

can::Frame counted(unsigned counter) {
  return frame_of(kId, {0, static_cast<std::uint8_t>(counter), 0, 0, 0, 0, 0, 0});
}

std::optional<Reject> judge(E2eCheck& check, unsigned counter) {
  return check.judge(counted(counter));
}

TEST(E2eCheck, AsksNothingThatNobodyNamed) {
  E2eCheck check;
  for (int i = 0; i < 3; ++i)
    EXPECT_FALSE(check.judge(counted(5)));
}

TEST(E2eCheck, TakesNoFrameThatHoldsNoData) {
  E2eCheck check;
  can::Frame remote = counted(1);
  remote.flags |= can::kRemote;
  EXPECT_EQ(check.judge(remote), Reject::kNotData);
}

TEST(E2eCheck, TakesOnlyTheRightCheckValue) {
  const E2ePlan plan = plan_of(0, true);
  E2eCheck check(plan);
  EXPECT_EQ(check.judge(counted(0)), Reject::kCrcWrong);
  EXPECT_FALSE(check.judge(frame_of(kId, {0xCC, 0, 0, 0, 0, 0, 0, 0})));
  EXPECT_FALSE(check.judge(frame_of(kId, {0x91, 1, 0, 0, 0, 0, 0, 0})));
  EXPECT_EQ(check.judge(frame_of(kId, {0x91, 1, 0, 0, 0, 0, 0, 1})), Reject::kCrcWrong);
}

TEST(E2eCheck, TakesNoFrameTooShortToBeProtected) {
  const E2ePlan plan = plan_of(0, true);
  E2eCheck check(plan);
  EXPECT_EQ(check.judge(frame_of(kId, {0xCC, 0, 0})), Reject::kTruncated);
}

// Otherwise a corrupted frame would make the good one after it look repeated.
TEST(E2eCheck, DoesNotCountAFrameThatIsSpoilt) {
  const E2ePlan plan = plan_of(0, true);
  E2eCheck check(plan);
  EXPECT_FALSE(check.judge(frame_of(kId, {0xCC, 0, 0, 0, 0, 0, 0, 0})));
  EXPECT_EQ(check.judge(frame_of(kId, {0x00, 1, 0, 0, 0, 0, 0, 0})), Reject::kCrcWrong);
  EXPECT_FALSE(check.judge(frame_of(kId, {0x91, 1, 0, 0, 0, 0, 0, 0})));
  EXPECT_EQ(check.counter(), 1U);
}

TEST(E2eCheck, TakesStepsUpToTheLongestAllowed) {
  const E2ePlan plan = plan_of(3, false);
  E2eCheck check(plan);
  EXPECT_FALSE(judge(check, 13));
  EXPECT_FALSE(judge(check, 14));
  EXPECT_FALSE(judge(check, 2));  // past the end: 14, 0, 1, 2
  EXPECT_EQ(judge(check, 2), Reject::kCounterRepeated);
  EXPECT_EQ(judge(check, 6), Reject::kWrongSequence);
  EXPECT_FALSE(judge(check, 5));
}

TEST(E2eCheck, CountsWhatIsMissingInLongSteps) {
  const E2ePlan plan = plan_of(3, false);
  E2eCheck check(plan);
  std::uint32_t missing = 0;
  EXPECT_FALSE(check.count(counted(1).payload(), missing));
  EXPECT_FALSE(check.count(counted(4).payload(), missing));
  EXPECT_EQ(missing, 2U);
  EXPECT_EQ(check.count(counted(9).payload(), missing), Reject::kWrongSequence);
  EXPECT_EQ(missing, 0U);
}

// Two frames in sequence are a sender that restarted.
TEST(E2eCheck, FollowsASenderThatBeganAnew) {
  const E2ePlan plan = plan_of(2, false);
  E2eCheck check(plan);
  EXPECT_FALSE(judge(check, 7));
  EXPECT_EQ(judge(check, 0), Reject::kWrongSequence);
  EXPECT_FALSE(judge(check, 1));
  EXPECT_FALSE(judge(check, 2));
}

// A second sender counts on the same identifier: while the true sender is active, none of the
// foreign frames is accepted and none of its own is lost.
TEST(E2eCheck, ASecondSenderDoesNotPushTheFirstOut) {
  const E2ePlan plan = plan_of(2, false);
  E2eCheck check(plan);
  EXPECT_FALSE(judge(check, 0));
  for (unsigned n = 1; n < 100; ++n) {
    EXPECT_EQ(judge(check, (n + 7) % 15), Reject::kWrongSequence) << n;
    EXPECT_FALSE(judge(check, n % 15)) << n;
  }
}

TEST(E2eCheck, AnythingNewIsRightAfterASilence) {
  const E2ePlan plan = plan_of(1, false);
  E2eCheck check(plan);
  EXPECT_FALSE(judge(check, 3));
  check.fall_silent();
  EXPECT_EQ(judge(check, 3), Reject::kCounterRepeated);
  EXPECT_FALSE(judge(check, 11));
  EXPECT_EQ(judge(check, 13), Reject::kWrongSequence);
}

// --- multiplexed messages ------------------------------------------------------------------------

std::optional<Reject> judge_other(E2eCheck& check, unsigned counter) {
  return check.judge(counted(counter), E2eCheck::Page::kOther);
}

// Four pages and a counter of 0…3: the own page always has the same count.
TEST(E2eCheck, FollowsACounterOverAllPages) {
  E2ePlan plan = plan_of(1, false);
  plan.counter->modulus = 4;
  E2eCheck check(plan);
  for (int round = 0; round < 10; ++round) {
    EXPECT_FALSE(judge_other(check, 0));
    EXPECT_FALSE(judge_other(check, 1));
    EXPECT_FALSE(judge(check, 2)) << round;
    EXPECT_EQ(judge(check, 2), Reject::kCounterRepeated) << round;
    EXPECT_FALSE(judge_other(check, 3));
  }
}

TEST(E2eCheck, CountsWhatIsMissingOnOtherPages) {
  const E2ePlan plan = plan_of(0, false);
  E2eCheck check(plan);
  std::uint32_t missing = 0;
  EXPECT_FALSE(check.count(counted(0).payload(), missing));
  EXPECT_FALSE(check.count(counted(3).payload(), missing, E2eCheck::Page::kOther));
  EXPECT_EQ(missing, 2U);
  EXPECT_FALSE(check.count(counted(4).payload(), missing));
  EXPECT_EQ(missing, 0U);
}

// A counter of rounds is constant within a round.
TEST(E2eCheck, TakesACounterOfRounds) {
  const E2ePlan plan = plan_of(1, false);
  E2eCheck check(plan);
  for (unsigned round = 0; round < 30; ++round) {
    EXPECT_FALSE(judge_other(check, round % 15));
    EXPECT_FALSE(judge(check, round % 15)) << round;
    EXPECT_FALSE(judge_other(check, round % 15));
  }
}

// All pages arrive, but the counter is constant: nothing is new.
TEST(E2eCheck, FindsACounterThatStandsOnAllPages) {
  const E2ePlan plan = plan_of(0, false);
  E2eCheck check(plan);
  EXPECT_FALSE(judge_other(check, 5));
  EXPECT_FALSE(judge(check, 5));
  for (int i = 0; i < 5; ++i) {
    EXPECT_FALSE(judge_other(check, 5));
    EXPECT_EQ(judge(check, 5), Reject::kCounterRepeated);
  }
}

// With a configured highest value, a higher one cannot be from the sender.
TEST(E2eCheck, RefusesNumbersBeyondTheConfiguredHighest) {
  E2ePlan plan = plan_of(0, false);
  plan.counter->modulus = 10;
  plan.counter->strict = true;
  E2eCheck check(plan);
  EXPECT_FALSE(judge(check, 8));
  EXPECT_FALSE(judge(check, 9));
  EXPECT_EQ(judge(check, 12), Reject::kWrongSequence);
  std::uint32_t missing = 7;
  EXPECT_FALSE(check.count(counted(0).payload(), missing));
  EXPECT_EQ(missing, 0U);
}

// The next frame in order takes a fast path; whatever precedes it, the result must be that of the
// full check. The rules are implemented once more here, on numbers that only increase.
TEST(E2eCheck, JudgesEveryOrderOfFramesByTheSameRules) {
  constexpr std::uint64_t kSeed = 20'261'201;
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  std::mt19937_64 random(kSeed);
  for (const std::uint32_t modulus : {2U, 10U, 15U}) {
    for (const std::uint32_t most : {0U, 1U, 3U}) {
      E2ePlan plan = plan_of(most, false);
      plan.counter->modulus = modulus;
      E2eCheck check(plan);
      std::uint64_t sent = random() % modulus;
      std::uint64_t newest = sent;
      std::optional<std::uint64_t> odd_one;
      ASSERT_FALSE(judge(check, static_cast<unsigned>(sent)));
      for (int i = 0; i < 5000; ++i) {
        sent += random() % 4 == 0 ? random() % modulus : 1;
        const auto shown = static_cast<unsigned>(sent % modulus);
        const std::uint64_t moved = (sent - newest) % modulus;
        std::optional<Reject> expected;
        std::uint32_t lost = 0;
        if (moved == 0) {
          expected = Reject::kCounterRepeated;
        } else if (most == 0 || moved <= most) {
          lost = static_cast<std::uint32_t>(moved - 1);
        } else {
          const std::uint64_t since = odd_one ? (sent - *odd_one) % modulus : 0;
          if (since == 0 || since > most) expected = Reject::kWrongSequence;
          odd_one = sent;
        }
        if (!expected) {
          newest = sent;
          odd_one.reset();
        }
        std::uint32_t missing = 99;
        ASSERT_EQ(check.count(counted(shown).payload(), missing), expected) << "frame " << i;
        ASSERT_EQ(missing, lost) << "frame " << i;
        ASSERT_EQ(check.counter(), newest % modulus) << "frame " << i;
      }
    }
  }
}

// --- what counter_max should be ------------------------------------------------------------------

TEST(E2eCheck, SaysWhereACounterTurnsEarly) {
  for (const std::uint32_t max_delta : {0U, 1U}) {
    SCOPED_TRACE(max_delta);
    const E2ePlan plan = plan_of(max_delta, false);
    E2eCheck check(plan);
    for (unsigned i = 0; i < 12 * 15; ++i)
      (void)judge(check, i % 12);
    EXPECT_FALSE(check.early_turn()) << "14 turns may be chance";
    for (unsigned i = 0; i < 12 * 10; ++i)
      (void)judge(check, i % 12);
    EXPECT_EQ(check.early_turn(), 11U);
    for (unsigned i = 0; i < 16; ++i)
      (void)judge(check, i % 15);
    EXPECT_FALSE(check.early_turn()) << "it does go on";
  }
}

TEST(E2eCheck, TakesNoLostFramesAndNoOtherPaceForAnEarlyTurn) {
  constexpr unsigned kSeed = 77;
  std::mt19937 random(kSeed);
  for (const unsigned pace : {1U, 2U, 3U, 4U, 7U}) {
    for (const double lost : {0.0, 0.05, 0.3, 0.6}) {
      SCOPED_TRACE(::testing::Message() << pace << " a frame, " << lost << " lost, seed " << kSeed);
      const E2ePlan plan = plan_of(0, false);
      E2eCheck check(plan);
      for (unsigned i = 0; i < 20'000; ++i) {
        if (std::uniform_real_distribution<double>()(random) < lost) continue;
        (void)judge(check, pace * i % 15);
        ASSERT_FALSE(check.early_turn());
      }
    }
  }
}

}  // namespace
}  // namespace vgyro::gateway
