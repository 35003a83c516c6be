#include "can/frame.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgyro::can {
namespace {

Frame frame_of(std::uint32_t id, std::uint8_t length) {
  Frame frame;
  frame.id = id;
  frame.length = length;
  for (std::size_t i = 0; i < length; ++i)
    frame.data[i] = static_cast<std::uint8_t>(i + 1);
  return frame;
}

// Two frames are equal if they are indistinguishable on the bus: every field of theirs counts.
TEST(Frame, DiffersInEverythingThatTheBusCarries) {
  const Frame frame = frame_of(0x123, 8);
  EXPECT_EQ(frame, frame_of(0x123, 8));
  Frame other = frame;
  other.id = 0x124;
  EXPECT_NE(frame, other);
  other = frame;
  other.flags = kExtended;
  EXPECT_NE(frame, other);
  other = frame;
  other.length = 7;
  EXPECT_NE(frame, other);
  other = frame;
  other.raw_dlc = 9;
  EXPECT_NE(frame, other);
  for (std::size_t i = 0; i < 8; ++i) {
    other = frame;
    other.data[i] ^= 0x80;
    EXPECT_NE(frame, other) << i;
  }
}

// Buffers are reused: bytes of an earlier, longer frame after the payload have no meaning.
TEST(Frame, IgnoresBytesBehindThePayload) {
  const Frame frame = frame_of(0x123, 3);
  Frame other = frame;
  other.data[3] = 0xFF;
  other.data[63] = 0xFF;
  EXPECT_EQ(frame, other);
  EXPECT_EQ(frame.payload().size(), 3U);
}

// A remote frame requests bytes and carries none, so only the requested number counts.
TEST(Frame, OfRemoteFramesComparesOnlyTheLengthAskedFor) {
  Frame frame = frame_of(0x123, 5);
  frame.flags = kRemote;
  Frame other = frame;
  other.data = {};
  EXPECT_EQ(frame, other);
  other.length = 4;
  EXPECT_NE(frame, other);
}

// Signals are read only from frames with a payload.
TEST(Frame, CarriesDataUnlessRemoteOrError) {
  Frame frame = frame_of(0x123, 8);
  EXPECT_TRUE(frame.is_data());
  frame.flags = kFd | kBitRateSwitch | kErrorStateIndicator | kExtended;
  EXPECT_TRUE(frame.is_data());
  frame.flags = kRemote;
  EXPECT_FALSE(frame.is_data());
  frame.flags = kError;
  EXPECT_FALSE(frame.is_data());
}

// FD has sizes of 0 to 8 bytes and seven larger ones; a payload gets the smallest that holds it.
TEST(FdPaddedLength, IsTheSmallestSizeThatHoldsThePayload) {
  const std::vector<std::size_t> sizes = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (std::size_t bytes = 0; bytes <= kFdBytesMax; ++bytes) {
    const auto smallest = std::lower_bound(sizes.begin(), sizes.end(), bytes);
    EXPECT_EQ(fd_padded_length(bytes), *smallest) << bytes;
  }
}

// The result never exceeds an FD frame, whatever the argument.
TEST(FdPaddedLength, EndsAt64) {
  EXPECT_EQ(fd_padded_length(65), kFdBytesMax);
  EXPECT_EQ(fd_padded_length(SIZE_MAX), kFdBytesMax);
}

}  // namespace
}  // namespace vgyro::can
