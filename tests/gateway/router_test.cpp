#include "gateway/router.h"

#include <gtest/gtest.h>

#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::frame_of;

Plan j1939_plan() {
  Plan plan = rig::two_gyros();
  plan.gyros[0].match = {0, 0x0CF02A00, 0x03FFFF00, true};
  plan.gyros[1].match = {0, 0x0CF02AE3, 0x03FFFFFF, true};
  return plan;
}

// A frame belongs to a gyro only on that gyro's own bus.
TEST(Router, KnowsEachGyroOnItsOwnBusOnly) {
  const Router router(rig::two_gyros());
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdA, {})), kGyro1);
  EXPECT_EQ(router.roles(1, frame_of(rig::kIdB, {})), kGyro2);
  EXPECT_EQ(router.roles(1, frame_of(rig::kIdA, {})), 0);
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdB, {})), 0);
}

// An identifier that is not configured has no role, on any bus.
TEST(Router, LeavesAllOtherIdentifiersAlone) {
  const Router router(rig::two_gyros());
  for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
    const int expected = (id == rig::kIdA ? kGyro1 : 0) + (id == rig::kIdB ? kGyro2 : 0);
    const int found = router.roles(0, frame_of(id, {})) + router.roles(1, frame_of(id, {}));
    EXPECT_EQ(found, expected) << id;
  }
}

// A log may hold more interfaces than the plan; their index is beyond the table.
TEST(Router, IgnoresBusesThatThePlanDoesNotKnow) {
  const Router router(rig::two_gyros());
  EXPECT_EQ(router.roles(2, frame_of(rig::kIdA, {})), 0);
  EXPECT_EQ(router.roles(0xFF, frame_of(rig::kIdA, {})), 0);
  EXPECT_EQ(router.roles(0xFF, frame_of(rig::kIdA, {}, can::kExtended)), 0);
}

// 0x101 with 11 bits and with 29 bits are two different identifiers.
TEST(Router, TellsStandardFromExtendedIdentifiers) {
  Plan plan = rig::two_gyros();
  plan.gyros[1].match = {0, rig::kIdA, can::kExtendedIdMax, true};
  const Router router(plan);
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdA, {})), kGyro1);
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdA, {}, can::kExtended)), kGyro2);
}

// J1939: priority is ignored, and so is the source address unless it is configured.
TEST(Router, MatchesJ1939ByItsMask) {
  const Router router(j1939_plan());
  EXPECT_EQ(router.roles(0, frame_of(0x0CF02AE2, {}, can::kExtended)), kGyro1);
  EXPECT_EQ(router.roles(0, frame_of(0x18F02AE2, {}, can::kExtended)), kGyro1);
  EXPECT_EQ(router.roles(0, frame_of(0x0CF02BE2, {}, can::kExtended)), 0);
  EXPECT_EQ(router.roles(0, frame_of(0x0CF02AE3, {}, can::kExtended)), kGyro1 | kGyro2);
}

// One frame may carry a gyro and the reference: two signals of one message.
TEST(Router, GivesOneFrameSeveralRoles) {
  Plan plan = rig::with_reference();
  plan.reference->match = plan.gyros[0].match;
  const Router router(plan);
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdA, {})), kGyro1 | kReference);
}

// An error frame's identifier is a bit field of causes, not a message.
TEST(Router, GivesErrorFramesNoRole) {
  const Router router(rig::two_gyros());
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdA, {}, can::kError)), 0);
  EXPECT_EQ(router.roles(0, frame_of(rig::kIdA, {}, can::kError | can::kExtended)), 0);
}

// An identifier that the DBC file assigns to another message of the same PGN has no role.
TEST(Router, LeavesTheIdentifiersOfOtherMessagesToThem) {
  Plan plan = j1939_plan();
  plan.gyros[0].match.others = {0x0CF02A07};
  const Router router(plan);
  EXPECT_EQ(router.roles(0, frame_of(0x0CF02A06, {}, can::kExtended)), kGyro1);
  EXPECT_EQ(router.roles(0, frame_of(0x0CF02A07, {}, can::kExtended)), 0);
  EXPECT_EQ(router.roles(0, frame_of(0x18F02A07, {}, can::kExtended)), 0);
}

}  // namespace
}  // namespace vgyro::gateway
