#include "dbc/e2e.h"

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

constexpr std::uint64_t kSeed = 20'261'129;

using Bytes8 = std::array<std::uint8_t, 8>;

/// Expects `is_right` for this payload, and not for any that differs from it in one bit.
template <class Bytes, class Check>
void expect_every_wrong_bit_noticed(const Bytes& payload, Check is_right) {
  ASSERT_TRUE(is_right(payload));
  for (std::size_t bit = 0; bit < payload.size() * 8; ++bit) {
    Bytes wrong = payload;
    wrong[bit / 8] = static_cast<std::uint8_t>(wrong[bit / 8] ^ 1U << bit % 8);
    EXPECT_FALSE(is_right(wrong)) << bit;
  }
}

// The published test vectors of the nibble variant: data ID 0x123, eight zero bytes, two frames.
TEST(E2eProfile11C, AgreesWithThePublishedVectors) {
  E2eProfile11C profile(0x123);
  Bytes8 payload{};
  profile.protect(payload);
  EXPECT_EQ(payload, (Bytes8{0x2A, 0x10}));
  payload = {};
  profile.protect(payload);
  EXPECT_EQ(payload, (Bytes8{0x77, 0x11}));
}

// A receiver with the general check accepts what the sender writes.
TEST(E2eProfile11C, WritesWhatTheGeneralProtectionExpects) {
  std::mt19937_64 random(kSeed);
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  for (int round = 0; round < 2000; ++round) {
    const auto data_id = static_cast<std::uint16_t>(random());
    E2eProfile11C sender(data_id);
    const E2eProtection receiver({.kind = E2eKind::kProfile1C, .data_ids = {data_id}});
    Bytes8 payload{};
    for (std::uint8_t& byte : payload)
      byte = static_cast<std::uint8_t>(random());
    const Bytes8 before = payload;
    sender.protect(payload);
    ASSERT_TRUE(receiver.check(payload)) << "data ID " << data_id;
    ASSERT_TRUE(std::equal(before.begin() + 2, before.end(), payload.begin() + 2));
  }
}

// The counter runs from 0 to 14: 15 would mean an error and is never sent.
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
  expect_every_wrong_bit_noticed(payload, [&](const Bytes8& seen) { return profile.check(seen); });
  EXPECT_FALSE(E2eProfile11C(0x611).check(payload));
  EXPECT_FALSE(E2eProfile11C(0x710).check(payload));
}

// A frame with a right CRC but a counter that no sender has is refused.
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

// The counter uses all 256 values, and consecutive frames never share a CRC.
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
  expect_every_wrong_bit_noticed(
      payload, [&](const std::vector<std::uint8_t>& seen) { return profile.check(seen); });
  EXPECT_FALSE(E2eProfile5(0x710).check(payload));
}

// A payload without room for the header is refused, and not read beyond its end.
TEST(E2eProfile5, RefusesPayloadsShorterThanItsHeader) {
  const std::vector<std::uint8_t> payload(2);
  EXPECT_FALSE(E2eProfile5(0).check(payload));
  EXPECT_FALSE(E2eProfile5(0).check({}));
}

using Payload = std::vector<std::uint8_t>;

// 0, step, 2 · step, …
std::vector<std::uint16_t> sixteen_ids(unsigned step) {
  std::vector<std::uint16_t> ids;
  for (unsigned i = 0; i < kE2eDataIdsMost; ++i)
    ids.push_back(static_cast<std::uint16_t>(i * step));
  return ids;
}

E2eProtection protection(E2eKind kind, std::vector<std::uint16_t> data_ids,
                         std::size_t crc_byte = 0, std::size_t bytes = 8,
                         std::uint32_t can_id = 0) {
  E2eProtection::Layout layout{
      .kind = kind, .crc_byte = crc_byte, .bytes = bytes, .can_id = can_id};
  std::copy(data_ids.begin(), data_ids.end(), layout.data_ids.begin());
  return E2eProtection(layout);
}

Payload sealed(const E2eProtection& how, Payload payload) {
  how.seal(payload);
  return payload;
}

// Data ID 0x123, eight zero bytes and the counter: test vectors published by other implementations
// of profile 1, for both bytes of the data ID, for alternating bytes, and for the nibble.
TEST(E2eProtection, AgreesWithPublishedVectorsOfProfile1) {
  const E2eProtection both = protection(E2eKind::kProfile1A, {0x123});
  EXPECT_EQ(sealed(both, {0, 0, 0, 0, 0, 0, 0, 0}), (Payload{0xCC, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sealed(both, {0, 1, 0, 0, 0, 0, 0, 0}), (Payload{0x91, 1, 0, 0, 0, 0, 0, 0}));
  const E2eProtection by_turns = protection(E2eKind::kProfile1B, {0x123});
  EXPECT_EQ(sealed(by_turns, {0, 0, 0, 0, 0, 0, 0, 0}), (Payload{0xCE, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sealed(by_turns, {0, 1, 0, 0, 0, 0, 0, 0}), (Payload{0x02, 1, 0, 0, 0, 0, 0, 0}));
  const E2eProtection nibble = protection(E2eKind::kProfile1C, {0x123});
  EXPECT_EQ(sealed(nibble, {0, 0, 0, 0, 0, 0, 0, 0}), (Payload{0x2A, 0x10, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sealed(nibble, {0, 1, 0, 0, 0, 0, 0, 0}), (Payload{0x77, 0x11, 0, 0, 0, 0, 0, 0}));
}

// Published test vectors of profile 2, whose data ID changes with the counter.
TEST(E2eProtection, AgreesWithPublishedVectorsOfProfile2) {
  const E2eProtection zeros = protection(E2eKind::kProfile2, sixteen_ids(0));
  EXPECT_EQ(sealed(zeros, {0, 1, 0, 0, 0, 0, 0, 0}), (Payload{0x45, 1, 0, 0, 0, 0, 0, 0}));
  const E2eProtection rising = protection(E2eKind::kProfile2, sixteen_ids(1));
  EXPECT_EQ(sealed(rising, {0, 2, 2, 3, 4, 5, 6, 7}), (Payload{0xBC, 2, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(sealed(rising, {0, 1, 2, 3, 4, 5, 6, 7}), (Payload{0x61, 1, 2, 3, 4, 5, 6, 7}));
}

// CRC-8/SAE-J1850 of "123456789" is 0x4B in the catalogue of CRCs.
TEST(E2eProtection, AgreesWithTheCatalogueOfCrcs) {
  const Payload digits = {0, '1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(protection(E2eKind::kCrc8J1850, {}, 0, 10).value(digits), 0x4B);
}

// Against a bit-by-bit SAE J1850, for every length and place of the check value.
TEST(E2eProtection, DividesPayloadsOfAnyLength) {
  std::mt19937_64 random(kSeed);
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  for (std::size_t length = 1; length <= 64; ++length) {
    for (std::size_t crc_byte = 0; crc_byte < length; ++crc_byte) {
      std::vector<std::uint8_t> payload(length);
      unsigned crc = 0xFF;
      for (std::size_t i = 0; i < length; ++i) {
        payload[i] = static_cast<std::uint8_t>(random());
        if (i == crc_byte) continue;
        for (unsigned bit = 8; bit-- > 0;) {
          const bool divides = (crc >> 7U & 1U) != (static_cast<unsigned>(payload[i]) >> bit & 1U);
          crc = (crc << 1U & 0xFFU) ^ (divides ? 0x1DU : 0U);
        }
      }
      const E2eProtection protection(
          {.kind = E2eKind::kCrc8J1850, .crc_byte = crc_byte, .bytes = length});
      ASSERT_EQ(protection.value(payload), crc ^ 0xFFU) << length << " bytes, byte " << crc_byte;
    }
  }
}

// By hand: 0x24 + 8 + 1 + 2 + … + 7 = 0x48; a carry out of the byte is dropped.
TEST(E2eProtection, AddsUpAsToyotaDoes) {
  const E2eProtection how = protection(E2eKind::kToyota, {}, 7, 8, 0x024);
  EXPECT_EQ(how.value(Payload{1, 2, 3, 4, 5, 6, 7, 0}), 0x48);
  EXPECT_EQ(how.value(Payload{0xFF, 0xFF, 0, 0, 0, 0, 0, 0}), 0x2A);
  EXPECT_EQ(protection(E2eKind::kToyota, {}, 7, 8, 0x2C1).value(Payload(8, 0)), 0xCB);
}

// With the check value at any place, every kind accepts what it has sealed, and no frame with a
// wrong bit in the protected data.
TEST(E2eProtection, NoticesEverySingleWrongBitWhereverTheCheckValueStands) {
  for (const E2eKind kind :
       {E2eKind::kProfile1A, E2eKind::kProfile1B, E2eKind::kProfile1C, E2eKind::kProfile2,
        E2eKind::kProfile5, E2eKind::kCrc8J1850, E2eKind::kToyota}) {
    for (std::size_t byte = 0; byte + E2eProtection::header_bytes(kind) <= 8; ++byte) {
      SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(kind) << ", byte " << byte);
      const E2eProtection how = protection(kind, sixteen_ids(7), byte, 8, 0x123);
      Payload payload = {0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xD6, 0xF1};
      how.seal(payload);
      expect_every_wrong_bit_noticed(payload, [&](const Payload& seen) { return how.check(seen); });
    }
  }
}

// Bytes after the protected ones are ignored: a frame padded by a gateway is the same frame.
TEST(E2eProtection, PassesOverBytesBehindTheMessage) {
  const E2eProtection how = protection(E2eKind::kProfile1A, {0x123}, 0, 5);
  Payload payload = {0, 1, 2, 3, 4, 0, 0, 0};
  how.seal(payload);
  payload[6] = 0xFF;
  EXPECT_TRUE(how.check(payload));
}

// Every name of a kind is accepted, and nothing else.
TEST(E2eProtection, KnowsTheNamesOfTheKinds) {
  for (const std::string_view name : e2e_kind_names())
    EXPECT_TRUE(e2e_kind_from(name)) << name;
  EXPECT_EQ(e2e_kind_from("profile_11c"), E2eKind::kProfile1C);
  EXPECT_EQ(e2e_kind_from("profile_22"), E2eKind::kProfile2);
  EXPECT_FALSE(e2e_kind_from("profile_7"));
}

}  // namespace
}  // namespace vgyro::dbc
