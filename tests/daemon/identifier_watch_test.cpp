// Other senders of our identifiers are noticed; our own echoes do not count.

#include "daemon/identifier_watch.h"

#include <gtest/gtest.h>

namespace vgyro::daemon {
namespace {

can::Frame frame(std::uint32_t id, std::uint8_t flags = 0) {
  can::Frame frame;
  frame.id = id;
  frame.flags = flags;
  return frame;
}

class IdentifierWatchTest : public testing::Test {
 protected:
  void pass(int seconds) {
    for (int i = 0; i < seconds; ++i)
      watch.second_passed();
  }

  IdentifierWatch watch{{{0x610, false}, {0x611, false}, {0x612, false}}};
};

TEST_F(IdentifierWatchTest, CountsEveryFrameWithOneOfOurIdentifiersAndLeavesTheRest) {
  for (const std::uint32_t id : {0x610U, 0x611U, 0x612U})
    EXPECT_TRUE(watch.takes(frame(id), false));
  EXPECT_FALSE(watch.takes(frame(0x101), false));
  EXPECT_EQ(watch.count(), 3U);
  EXPECT_TRUE(watch.is_contested());
}

TEST_F(IdentifierWatchTest, AnEqualNumberInAnotherFormatIsAnotherIdentifier) {
  EXPECT_FALSE(watch.takes(frame(0x610, can::kExtended), false));
  EXPECT_FALSE(watch.takes(frame(0x610, can::kRemote), false));
  EXPECT_TRUE(watch.takes(frame(0x610, can::kFd), false));
  EXPECT_EQ(watch.count(), 1U);
}

TEST_F(IdentifierWatchTest, EchoesOfASocketThatWasClosedAreNobodyElses) {
  watch.opened();
  EXPECT_TRUE(watch.takes(frame(0x610), true));
  EXPECT_EQ(watch.count(), 0U);
  EXPECT_TRUE(watch.takes(frame(0x610), false));
  EXPECT_EQ(watch.count(), 1U) << "that came over the wire";
  pass(IdentifierWatch::kEchoSeconds);
  EXPECT_TRUE(watch.takes(frame(0x610), true));
  EXPECT_EQ(watch.count(), 2U) << "a second gateway on this host";
}

TEST_F(IdentifierWatchTest, TheBusIsOursAgainWhenNobodyElseSendsAnyLonger) {
  watch.takes(frame(0x611), false);
  pass(IdentifierWatch::kContestedSeconds - 1);
  EXPECT_TRUE(watch.is_contested());
  pass(1);
  EXPECT_FALSE(watch.is_contested());
  EXPECT_EQ(watch.count(), 1U);
}

TEST(IdentifierWatch, WhereNothingIsSentNothingIsOurs) {
  IdentifierWatch watch;
  EXPECT_FALSE(watch.takes(frame(0), false));
  EXPECT_FALSE(watch.takes(frame(0x610), false));
}

}  // namespace
}  // namespace vgyro::daemon
