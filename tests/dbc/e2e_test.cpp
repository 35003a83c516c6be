#include "dbc/e2e.h"

#include <array>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

using Bytes8 = std::array<std::uint8_t, 8>;

// The published vectors of the nibble variant: data ID 0x123, eight zero bytes, two frames.
TEST(E2eProfile11C, AgreesWithThePublishedVectors) {
  E2eProfile11C profile(0x123);
  Bytes8 payload{};
  profile.protect(payload);
  EXPECT_EQ(payload, (Bytes8{0x2A, 0x10}));
  payload = {};
  profile.protect(payload);
  EXPECT_EQ(payload, (Bytes8{0x77, 0x11}));
}

// The counter runs from 0 to 14: 15 would mean an error and never appears.
TEST(E2eProfile11C, CountsTo14AndStartsAgain) {
  E2eProfile11C profile(0x610);
  for (unsigned frame = 0; frame < 40; ++frame) {
    Bytes8 payload{};
    profile.protect(payload);
    EXPECT_EQ(payload[1], 0x60U | frame % 15) << frame;
    EXPECT_TRUE(profile.check(payload));
  }
}

// Any single wrong bit is noticed, and so is a frame of another data ID.
TEST(E2eProfile11C, NoticesEverySingleWrongBit) {
  E2eProfile11C profile(0x610);
  Bytes8 payload = {0, 0, 0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC};
  profile.protect(payload);
  ASSERT_TRUE(profile.check(payload));
  for (std::size_t bit = 0; bit < 64; ++bit) {
    Bytes8 wrong = payload;
    wrong[bit / 8] = static_cast<std::uint8_t>(wrong[bit / 8] ^ 1U << bit % 8);
    EXPECT_FALSE(profile.check(wrong)) << bit;
  }
  EXPECT_FALSE(E2eProfile11C(0x611).check(payload));
  EXPECT_FALSE(E2eProfile11C(0x710).check(payload));
}

// A right CRC over a counter that no sender has is still not a right frame.
TEST(E2eProfile11C, RefusesCounter15) {
  const E2eProfile11C profile(0x610);
  Bytes8 payload = {0, 0x6F};
  payload[0] = profile.crc(payload);
  EXPECT_FALSE(profile.check(payload));
}

// The published vector: data ID 0x1234, eight zero bytes.
TEST(E2eProfile5, AgreesWithThePublishedVector) {
  E2eProfile5 profile(0x1234);
  Bytes8 payload{};
  profile.protect(payload);
  EXPECT_EQ(payload, (Bytes8{0x1C, 0xCA, 0x00}));
}

// The counter uses all 256 values, and neighbours never share a CRC.
TEST(E2eProfile5, CountsTo255AndStartsAgain) {
  E2eProfile5 profile(0x610);
  std::set<std::uint16_t> crcs;
  for (unsigned frame = 0; frame < 300; ++frame) {
    std::array<std::uint8_t, 32> payload{};
    profile.protect(payload);
    EXPECT_EQ(payload[2], frame % 256);
    EXPECT_TRUE(profile.check(payload));
    crcs.insert(profile.crc(payload));
  }
  EXPECT_EQ(crcs.size(), 256U);
}

// Any single wrong bit of an FD frame is noticed, and so is a frame of another data ID.
TEST(E2eProfile5, NoticesEverySingleWrongBit) {
  E2eProfile5 profile(0x610);
  std::vector<std::uint8_t> payload(32, 0xA5);
  profile.protect(payload);
  for (std::size_t bit = 0; bit < payload.size() * 8; ++bit) {
    std::vector<std::uint8_t> wrong = payload;
    wrong[bit / 8] = static_cast<std::uint8_t>(wrong[bit / 8] ^ 1U << bit % 8);
    EXPECT_FALSE(profile.check(wrong)) << bit;
  }
  EXPECT_FALSE(E2eProfile5(0x710).check(payload));
}

// A payload without room for the header is wrong, not read beyond its end.
TEST(E2eProfile5, RefusesPayloadsShorterThanItsHeader) {
  const std::vector<std::uint8_t> payload(2);
  EXPECT_FALSE(E2eProfile5(0).check(payload));
  EXPECT_FALSE(E2eProfile5(0).check({}));
}

}  // namespace
}  // namespace vgyro::dbc
