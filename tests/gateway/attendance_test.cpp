// Which gyros are in use: time-outs follow the gyros' paces, silence is reported once, and one gyro
// is used alone only when the other is missing.

#include "gateway/attendance.h"

#include <gtest/gtest.h>

#include "rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::ms;

class AttendanceTest : public ::testing::Test {
 protected:
  /// Samples of both gyros, from which the aligner measures their intervals.
  void teach_pace(Duration pace, std::int64_t samples = 40) {
    fusion::AlignedPair pair;
    for (std::int64_t i = 0; i < samples; ++i) {
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        TimePoint t;
        guard.check(gyro, TimePoint{std::chrono::hours(1)} + i * pace, t);
        aligner.push(gyro, t, 1.0);
      }
      while (aligner.pop(pair)) {
      }
    }
    ASSERT_TRUE(aligner.chosen());
  }

  const Plan plan = rig::two_gyros();
  fusion::StampGuard guard;
  fusion::Aligner aligner;
  Attendance attendance{plan, aligner, guard};
};

// Ten usual intervals, at least 100 ms and at most 1 s, but never before three intervals.
TEST_F(AttendanceTest, TimeOutFollowsThePaceWithinItsLimits) {
  const struct {
    Duration pace;
    Duration time_out;
  } cases[] = {{ms(1), ms(100)},    {ms(10), ms(100)},   {ms(20), ms(200)},
               {ms(100), ms(1000)}, {ms(200), ms(1000)}, {ms(500), ms(1500)}};
  for (const auto& one : cases) {
    guard = {};
    aligner = fusion::Aligner{};
    teach_pace(one.pace);
    EXPECT_EQ(attendance.time_out(0), one.time_out) << to_seconds(one.pace);
    EXPECT_EQ(attendance.time_out(1), one.time_out) << to_seconds(one.pace);
    EXPECT_EQ(attendance.pair_interval(), one.pace);
  }
}

// Before the intervals are known, the time-out is a second.
TEST_F(AttendanceTest, UnknownPaceIsGivenASecond) {
  EXPECT_EQ(attendance.time_out(0), ms(1000));
  EXPECT_EQ(attendance.pair_interval(), Duration::zero());
}

// Silence is reported once, for each gyro, with the time at which the next one would be missing.
TEST_F(AttendanceTest, SilenceIsToldOnceAndByGyro) {
  attendance.hear(0, at_ms(5000));
  attendance.hear(1, at_ms(5300));
  EXPECT_TRUE(attendance.hear_pair());
  EXPECT_FALSE(attendance.hear_pair());
  Attendance::Silence silence = attendance.look_for_silence(at_ms(5999));
  EXPECT_FALSE(silence.fell_silent[0] || silence.fell_silent[1]);
  EXPECT_EQ(silence.next, at_ms(6000));
  silence = attendance.look_for_silence(at_ms(6000));
  EXPECT_TRUE(silence.fell_silent[0]);
  EXPECT_FALSE(silence.fell_silent[1]);
  EXPECT_EQ(silence.next, at_ms(6300));
  EXPECT_FALSE(attendance.pairing());
  EXPECT_TRUE(attendance.any_in_use());
  EXPECT_EQ(attendance.health_bits(), kGyro1Missing);
  silence = attendance.look_for_silence(at_ms(6300));
  EXPECT_FALSE(silence.fell_silent[0]);
  EXPECT_TRUE(silence.fell_silent[1]);
  EXPECT_FALSE(attendance.any_in_use());
  EXPECT_EQ(attendance.look_for_silence(at_ms(9000)).next, TimePoint::max());
}

// A gyro is used alone once the other has dropped out, and until both are paired again; at the
// start only after the other had a second to appear.
TEST_F(AttendanceTest, GyroSpeaksAloneOnlyWhereTheOtherHasGone) {
  attendance.begin_waiting(at_ms(1000));
  attendance.hear(0, at_ms(1000));
  EXPECT_FALSE(attendance.may_speak_alone(0, at_ms(2000), false));
  EXPECT_TRUE(attendance.may_speak_alone(0, at_ms(2001), false));
  attendance.hear_alone(0);
  attendance.hear(1, at_ms(2002));
  EXPECT_TRUE(attendance.may_speak_alone(0, at_ms(2003), false));
  EXPECT_FALSE(attendance.may_speak_alone(1, at_ms(2003), false));
  attendance.hear_pair();
  EXPECT_FALSE(attendance.may_speak_alone(0, at_ms(2004), true));
}

// An unusable frame takes its gyro out of use once, if the health says so, and the gyro does not
// become silent.
TEST_F(AttendanceTest, SickGyroIsSetAsideAndNotMissing) {
  attendance.hear(0, at_ms(1000));
  attendance.hear(1, at_ms(1000));
  attendance.hear_pair();
  attendance.judge_refused(0, at_ms(1010), Reject::kFlaggedInvalid);
  EXPECT_TRUE(attendance.hear_refused(0, at_ms(1010)));
  EXPECT_FALSE(attendance.pairing());
  EXPECT_FALSE(attendance.in_use(0));
  attendance.judge_refused(0, at_ms(1900), Reject::kFlaggedInvalid);
  EXPECT_FALSE(attendance.hear_refused(0, at_ms(1900)));
  attendance.hear(1, at_ms(1900));
  const Attendance::Silence silence = attendance.look_for_silence(at_ms(2500));
  EXPECT_FALSE(silence.fell_silent[0]);
  EXPECT_EQ(attendance.health_bits(), kGyro1Suspect);
}

}  // namespace
}  // namespace vgyro::gateway
