#include "gateway/reference_calibration.h"

#include <gtest/gtest.h>

#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;

fusion::AlignedPair pair_at(std::int64_t t_ms) {
  return {.t = at_ms(t_ms), .complete = at_ms(t_ms), .rate_dps = {1.0, 2.0}};
}

// Between two reference samples the true rate is on the line through them.
TEST(ReferenceCalibration, InterpolatesBetweenTheNeighbours) {
  ReferenceCalibration reference;
  reference.add_reference(at_ms(0), 10.0);
  reference.add_pair(pair_at(25));
  EXPECT_FALSE(reference.next());
  reference.add_reference(at_ms(100), 20.0);
  const auto ready = reference.next();
  ASSERT_TRUE(ready);
  EXPECT_DOUBLE_EQ(ready->true_rate_dps, 12.5);
  EXPECT_EQ(ready->pair.t, at_ms(25));
  EXPECT_FALSE(reference.next());
}

// At the stamp of a reference sample the sample itself is the truth, at either end.
TEST(ReferenceCalibration, TakesTheSampleItselfAtItsOwnStamp) {
  ReferenceCalibration reference;
  reference.add_reference(at_ms(0), 10.0);
  reference.add_reference(at_ms(100), 20.0);
  reference.add_pair(pair_at(0));
  reference.add_pair(pair_at(100));
  const auto first = reference.next();
  const auto last = reference.next();
  ASSERT_TRUE(first && last);
  EXPECT_DOUBLE_EQ(first->true_rate_dps, 10.0);
  EXPECT_DOUBLE_EQ(last->true_rate_dps, 20.0);
}

// Pairs from before the reference began are skipped and do not delay later ones.
TEST(ReferenceCalibration, PassesOverPairsBeforeTheReference) {
  ReferenceCalibration reference;
  for (std::int64_t t = 0; t < 10; ++t)
    reference.add_pair(pair_at(t * 10));
  reference.add_reference(at_ms(45), 4.5);
  reference.add_reference(at_ms(95), 9.5);
  std::vector<TimePoint> covered;
  while (const auto ready = reference.next()) {
    covered.push_back(ready->pair.t);
    EXPECT_NEAR(ready->true_rate_dps, 100.0 * to_seconds(ready->pair.t.time_since_epoch()), 1e-9);
  }
  EXPECT_EQ(covered, (std::vector{at_ms(50), at_ms(60), at_ms(70), at_ms(80), at_ms(90)}));
}

// Nothing is interpolated across a gap of more than a second, since the motion in it is unknown.
TEST(ReferenceCalibration, DoesNotInterpolateAcrossAGap) {
  ReferenceCalibration reference;
  reference.add_reference(at_ms(0), 0.0);
  reference.add_pair(pair_at(500));
  reference.add_reference(at_ms(1001), 1.0);
  EXPECT_FALSE(reference.next());
  reference.add_pair(pair_at(1500));
  reference.add_reference(at_ms(2001), 2.0);
  ASSERT_TRUE(reference.next());
}

// A reference sample that is not newer than the last one changes nothing.
TEST(ReferenceCalibration, IgnoresReferenceSamplesOutOfOrder) {
  ReferenceCalibration reference;
  reference.add_reference(at_ms(0), 0.0);
  reference.add_reference(at_ms(100), 1.0);
  reference.add_reference(at_ms(50), 1e6);
  reference.add_reference(at_ms(100), 1e6);
  reference.add_pair(pair_at(50));
  const auto ready = reference.next();
  ASSERT_TRUE(ready);
  EXPECT_DOUBLE_EQ(ready->true_rate_dps, 0.5);
}

// The reference was an hour ahead of the gyros and returns to their time.
TEST(ReferenceCalibration, GoesOnWithAReferenceThatHadRunAhead) {
  ReferenceCalibration reference;
  reference.add_reference(at_ms(3'600'000), 7.0);
  reference.add_reference(at_ms(3'600'100), 7.0);
  reference.add_reference(at_ms(100), 1.0);
  reference.add_pair(pair_at(150));
  EXPECT_FALSE(reference.next()) << "nothing is interpolated over the step";
  reference.add_reference(at_ms(200), 2.0);
  const auto ready = reference.next();
  ASSERT_TRUE(ready);
  EXPECT_DOUBLE_EQ(ready->true_rate_dps, 1.5);
}

// Without any reference the queue stays bounded and keeps the newest pairs.
TEST(ReferenceCalibration, KeepsTheNewestPairsWhenTheReferenceIsLate) {
  ReferenceCalibration reference;
  constexpr std::int64_t kPairs = 3 * ReferenceCalibration::kPendingMax;
  for (std::int64_t t = 0; t < kPairs; ++t)
    reference.add_pair(pair_at(t));
  reference.add_reference(at_ms(kPairs - 100), 0.0);
  reference.add_reference(at_ms(kPairs), 0.0);
  std::int64_t covered = 0;
  while (reference.next())
    ++covered;
  EXPECT_EQ(covered, 100);
}

}  // namespace
}  // namespace vgyro::gateway
