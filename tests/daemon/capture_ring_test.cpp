// The last minutes in memory: in order, complete except for counted losses, and within limits.

#include "daemon/capture_ring.h"

#include <chrono>
#include <string>

#include <gtest/gtest.h>

#include "tests/gateway/counting_new.h"
#include "unpacked.h"

namespace vgyro::daemon {
namespace {

constexpr std::chrono::milliseconds kPatience = std::chrono::minutes(1);
constexpr CaptureRing::Limits kWide{.seconds = 100'000, .bytes = 100'000'000};

class CaptureRingTest : public testing::Test {
 protected:
  void begin(CaptureRing::Limits limits) {
    ring.emplace(limits);
    ring->use(std::make_shared<CaptureSource>(CaptureSource{{"can0", "vcan12"}, "fingerprint"}));
  }
  void put(std::uint32_t from, std::uint32_t to, can::BusIndex bus = 0) {
    for (std::uint32_t i = from; i < to; ++i)
      ring->put(bus, numbered_frame(i), numbered_stamp(i));
  }
  // Puts at most a block at a time, and gives the thread time to pack it.
  void put_in_peace(std::uint32_t from, std::uint32_t to, can::BusIndex bus = 0) {
    for (std::uint32_t i = from; i < to; i += CaptureRing::kBlockFrames) {
      put(i, std::min(to, i + static_cast<std::uint32_t>(CaptureRing::kBlockFrames)), bus);
      pack();
    }
  }
  void pack() { ASSERT_TRUE(ring->wait_until_packed(ring->seal(), kPatience)); }
  [[nodiscard]] std::vector<std::string> lines() const {
    return lines_of(unpacked(ring->blocks()));
  }
  static std::uint32_t number_of(const std::string& line) {
    return static_cast<std::uint32_t>(std::stoul(line.substr(line.find('#') + 1, 8), nullptr, 16));
  }

  std::optional<CaptureRing> ring;
};

TEST_F(CaptureRingTest, KeepsEveryFrameAsALineOfCandump) {
  begin(kWide);
  constexpr std::uint32_t kFrames = 3 * CaptureRing::kBlockFrames + 17;
  put_in_peace(0, kFrames);
  put_in_peace(kFrames, kFrames + 1, 1);
  const std::vector<std::string> seen = lines();
  ASSERT_EQ(seen.size(), kFrames + 1);
  for (std::uint32_t i = 0; i < kFrames; ++i)
    ASSERT_EQ(seen[i], numbered_line(i, "can0"));
  EXPECT_EQ(seen.back(), numbered_line(kFrames, "vcan12"));
  const CaptureRing::Counts counts = ring->counts();
  EXPECT_EQ(counts.frames, kFrames + 1);
  EXPECT_EQ(counts.dropped, 0U);
  EXPECT_NEAR(counts.seconds, kFrames * 1e-3, 1e-9);
  EXPECT_LT(counts.bytes, seen.size() * 10) << "it is not packed";
}

TEST_F(CaptureRingTest, ABlockKnowsItsStampsAlsoWhereTheyAreOutOfOrder) {
  begin(kWide);
  for (const std::uint32_t i : {5U, 3U, 9U, 4U})
    ring->put(0, numbered_frame(i), numbered_stamp(i));
  pack();
  const CaptureRing::Blocks blocks = ring->blocks();
  ASSERT_EQ(blocks.size(), 1U);
  EXPECT_EQ(blocks[0]->first, numbered_stamp(3));
  EXPECT_EQ(blocks[0]->last, numbered_stamp(9));
  EXPECT_EQ(blocks[0]->frames, 4U);
  EXPECT_EQ(number_of(lines()[0]), 5U) << "the order in which they were handed on";
}

TEST_F(CaptureRingTest, PuttingAFrameAllocatesNothing) {
  begin(kWide);
  put(0, 1);
  const can::Frame frame = numbered_frame(1);
  const std::size_t before = allocations_so_far();
  for (std::uint32_t i = 1; i < CaptureRing::kBlockFrames; ++i)
    ring->put(0, frame, numbered_stamp(i));
  EXPECT_EQ(allocations_so_far(), before) << "not even where a block is full";
}

// Puts frames faster than the thread packs: missing ones are counted in the block that follows
// them.
TEST_F(CaptureRingTest, WhatTheThreadIsTooSlowForIsDroppedAndCounted) {
  begin(kWide);
  constexpr std::uint32_t kFrames = 100 * CaptureRing::kBlockFrames;
  put(0, kFrames);
  pack();
  put(kFrames, kFrames + 1);
  pack();
  const CaptureRing::Counts counts = ring->counts();
  EXPECT_GT(counts.dropped, 0U);
  EXPECT_EQ(counts.frames + counts.dropped, kFrames + 1);
  std::uint32_t next = 0;
  for (const auto& block : ring->blocks()) {
    next += static_cast<std::uint32_t>(block->dropped_before);
    for (const std::string& line : lines_of(unpacked(block->xz)))
      ASSERT_EQ(number_of(line), next++);
  }
  EXPECT_EQ(next, kFrames + 1);
}

TEST_F(CaptureRingTest, BytesAreLimitedAndTheOldestGo) {
  constexpr std::size_t kBytesMost = 60'000;
  begin({.seconds = 100'000, .bytes = kBytesMost});
  constexpr std::uint32_t kFrames = 12 * CaptureRing::kBlockFrames;
  for (std::uint32_t i = 0; i < kFrames; i += CaptureRing::kBlockFrames) {
    put_in_peace(i, i + CaptureRing::kBlockFrames);
    EXPECT_LE(ring->counts().bytes, kBytesMost);
  }
  const std::vector<std::string> seen = lines();
  EXPECT_EQ(ring->counts().frames, seen.size());
  ASSERT_GT(seen.size(), CaptureRing::kBlockFrames);
  ASSERT_LT(seen.size(), kFrames);
  EXPECT_EQ(number_of(seen.back()), kFrames - 1);
  EXPECT_EQ(number_of(seen.front()), kFrames - seen.size());
}

TEST_F(CaptureRingTest, FramesThatAreOldByTheNewestOneGo) {
  constexpr int kSecondsMost = 60;
  begin({.seconds = kSecondsMost, .bytes = 100'000'000});
  constexpr std::uint32_t kSeconds = 200;
  for (std::uint32_t second = 0; second < kSeconds; ++second) {
    put(1000 * second, 1000 * second + 1);
    ring->second_passed();
    ASSERT_TRUE(ring->wait_until_packed(ring->seal(), kPatience));
  }
  const std::vector<std::string> seen = lines();
  EXPECT_EQ(number_of(seen.back()), 1000 * (kSeconds - 1));
  EXPECT_GE(seen.size(), kSecondsMost - 1U);
  EXPECT_LE(seen.size(), kSecondsMost + 1U);
  for (int second = 0; second < 1000; ++second)
    ring->second_passed();
  EXPECT_EQ(ring->counts().frames, seen.size()) << "a bus that is silent takes nothing away";
  put(1'000'000, 1'000'001);
  pack();
  EXPECT_EQ(ring->counts().frames, 1U) << "and all goes with the first frame after it";
}

TEST_F(CaptureRingTest, ABlockThatDoesNotFillIsPackedAfterSomeSeconds) {
  begin(kWide);
  put(0, 3);
  for (int second = 1; second < CaptureRing::kBlockSeconds; ++second)
    ring->second_passed();
  EXPECT_EQ(ring->seal(), ring->seal());
  EXPECT_EQ(ring->counts().dropped, 0U);
  begin(kWide);
  put(0, 3);
  for (int second = 0; second < CaptureRing::kBlockSeconds; ++second)
    ring->second_passed();
  const std::uint32_t sealed = ring->seal();
  EXPECT_EQ(sealed, 1U) << "it was sealed before";
  ASSERT_TRUE(ring->wait_until_packed(sealed, kPatience));
  EXPECT_EQ(ring->counts().frames, 3U);
}

TEST_F(CaptureRingTest, NothingIsLeftOfWhatIsForgotten) {
  begin(kWide);
  put_in_peace(0, 2 * CaptureRing::kBlockFrames);
  // Some packed, some on the way to the thread, some in the open block.
  put(10'000, 10'000 + 2 * CaptureRing::kBlockFrames + 100);
  ring->forget();
  EXPECT_EQ(ring->counts().frames, 0U);
  EXPECT_EQ(ring->counts().bytes, 0U);
  put(50'000, 50'010);
  pack();
  const std::vector<std::string> seen = lines();
  ASSERT_EQ(seen.size(), 10U);
  EXPECT_EQ(number_of(seen.front()), 50'000U);
}

TEST_F(CaptureRingTest, FramesKeepTheNamesOfTheBusesThatTheyCameFrom) {
  begin(kWide);
  put(0, 1);
  ring->use(std::make_shared<CaptureSource>(CaptureSource{{"can7"}, "another"}));
  put(1, 2);
  pack();
  EXPECT_EQ(lines(), (std::vector{numbered_line(0, "can0"), numbered_line(1, "can7")}));
  const CaptureRing::Blocks blocks = ring->blocks();
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_EQ(blocks[0]->source->fingerprint, "fingerprint");
  EXPECT_EQ(blocks[1]->source->fingerprint, "another");
}

// Blocks that a writer holds do not change.
TEST_F(CaptureRingTest, BlocksThatAreHeldOutsideOutliveTheRing) {
  begin(kWide);
  put(0, 5);
  pack();
  const CaptureRing::Blocks blocks = ring->blocks();
  ring.reset();
  EXPECT_EQ(lines_of(unpacked(blocks)).size(), 5U);
}

}  // namespace
}  // namespace vgyro::daemon
