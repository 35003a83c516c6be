#include "can/transmit.h"

#include <deque>
#include <vector>

#include <gtest/gtest.h>

namespace vgyro::can {
namespace {

using namespace std::chrono_literals;

constexpr TimePoint at(Duration since_start) {
  return time_from_ns(1'700'000'000'000'000'000) + since_start;
}

Frame numbered(std::uint32_t id) {
  Frame frame;
  frame.id = id;
  return frame;
}

/// Returns the scripted results, then kSent; keeps the ids of the frames that it took.
class FakeTransmitter final : public Transmitter {
 public:
  std::deque<SendResult> answers;
  SendResult afterwards = SendResult::kSent;
  std::vector<std::uint32_t> taken;
  int attempts = 0;

  SendResult send(const Frame& frame) override {
    ++attempts;
    SendResult result = afterwards;
    if (!answers.empty()) {
      result = answers.front();
      answers.pop_front();
    }
    if (result == SendResult::kSent) taken.push_back(frame.id);
    return result;
  }
};

using Ids = std::vector<std::uint32_t>;

TEST(TransmitQueue, SendsInTheOrderOfPushing) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  for (std::uint32_t id : {3U, 1U, 2U})
    queue.push(numbered(id), at(10ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{3, 1, 2}));
  EXPECT_EQ(queue.counts().sent, 3U);
  EXPECT_EQ(queue.counts().retries, 0U);
  EXPECT_EQ(queue.next_deadline(), std::nullopt);
}

TEST(TransmitQueue, SendsAtOnceWhereNothingWaits) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  EXPECT_TRUE(queue.send_at_once(numbered(1), transmitter));
  EXPECT_EQ(transmitter.taken, (Ids{1}));
  EXPECT_EQ(queue.counts().sent, 1U);
  EXPECT_EQ(queue.size(), 0U);
}

TEST(TransmitQueue, SendsNothingPastWhatWaits) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  queue.push(numbered(1), at(10ms));
  EXPECT_FALSE(queue.send_at_once(numbered(2), transmitter));
  EXPECT_EQ(transmitter.attempts, 0);
}

// Refusals are handled in one place with their cause: the frame is kept and tried again when due.
TEST(TransmitQueue, WhatIsRefusedAtOnceIsPushed) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kNoBuffer, SendResult::kNoBuffer};
  EXPECT_FALSE(queue.send_at_once(numbered(1), transmitter));
  EXPECT_EQ(queue.counts().sent, 0U);
  queue.push(numbered(1), at(50ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_FALSE(queue.send_at_once(numbered(2), transmitter)) << "not past a back-off";
  EXPECT_EQ(transmitter.attempts, 2);
  queue.push(numbered(2), at(50ms));
  queue.drain(at(1ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{1, 2}));
  EXPECT_EQ(queue.counts().sent, 2U);
}

TEST(TransmitQueue, KeepsTheFrameAndBacksOffWhenTheDeviceQueueIsFull) {
  TransmitQueue queue({.capacity = 8, .first_retry = 1ms, .last_retry = 4ms});
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kNoBuffer};
  queue.push(numbered(1), at(50ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_TRUE(transmitter.taken.empty());
  EXPECT_FALSE(queue.wants_writable()) << "poll says writable although the queue is full";
  EXPECT_EQ(queue.next_deadline(), at(1ms));

  queue.drain(at(1ms) - 1ns, transmitter);
  EXPECT_EQ(transmitter.attempts, 1) << "tried again before the time";
  queue.drain(at(1ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{1}));
  EXPECT_EQ(queue.counts().retries, 1U);
}

TEST(TransmitQueue, DoublesTheWaitUpToTheLimit) {
  TransmitQueue queue({.capacity = 8, .first_retry = 1ms, .last_retry = 4ms});
  FakeTransmitter transmitter;
  transmitter.afterwards = SendResult::kNoBuffer;
  queue.push(numbered(1), at(1s));
  TimePoint now = at(0ms);
  std::vector<Duration> waits;
  for (int i = 0; i < 5; ++i) {
    queue.drain(now, transmitter);
    waits.push_back(*queue.next_deadline() - now);
    now = *queue.next_deadline();
  }
  EXPECT_EQ(waits, (std::vector<Duration>{1ms, 2ms, 4ms, 4ms, 4ms}));
}

TEST(TransmitQueue, StartsWithTheShortestWaitAgainAfterASuccess) {
  TransmitQueue queue({.capacity = 8, .first_retry = 1ms, .last_retry = 64ms});
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kNoBuffer, SendResult::kNoBuffer, SendResult::kSent,
                         SendResult::kNoBuffer};
  queue.push(numbered(1), at(1s));
  queue.push(numbered(2), at(1s));
  queue.drain(at(0ms), transmitter);
  queue.drain(at(1ms), transmitter);
  queue.drain(at(3ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{1}));
  EXPECT_EQ(queue.next_deadline(), at(4ms));
}

TEST(TransmitQueue, NeverSendsAStaleFrameWhenTheBusReturns) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.afterwards = SendResult::kNoBuffer;
  const auto push_and_drain = [&](std::uint32_t i) {
    queue.push(numbered(i), at(i * 2ms + 4ms));
    queue.drain(at(i * 2ms), transmitter);
  };
  for (std::uint32_t i = 0; i < 100; ++i)
    push_and_drain(i);
  transmitter.afterwards = SendResult::kSent;
  for (std::uint32_t i = 100; i < 150; ++i)
    push_and_drain(i);

  ASSERT_FALSE(transmitter.taken.empty());
  EXPECT_GE(transmitter.taken.front(), 98U) << "a frame from before the bus returned";
  EXPECT_LE(transmitter.taken.front(), 116U) << "waited longer than the longest back-off";
  EXPECT_EQ(transmitter.taken.back(), 149U);
  EXPECT_EQ(transmitter.taken.size() + queue.counts().dropped_stale, 150U);
}

TEST(TransmitQueue, SendsAFrameThatIsExactlyAtItsLimit) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  queue.push(numbered(1), at(4ms));
  queue.push(numbered(2), at(4ms) - 1ns);
  queue.push(numbered(3), at(4ms));
  queue.drain(at(4ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{1, 3}));
  EXPECT_EQ(queue.counts().dropped_stale, 1U);
}

TEST(TransmitQueue, WaitsForPollWhenTheSocketBufferIsFull) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kWouldBlock};
  queue.push(numbered(1), at(50ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_TRUE(queue.wants_writable());
  queue.drain(at(40ms), transmitter);
  EXPECT_EQ(transmitter.attempts, 1) << "tried although poll did not say writable";
  queue.on_writable();
  EXPECT_FALSE(queue.wants_writable());
  queue.drain(at(41ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{1}));
}

TEST(TransmitQueue, DropsStaleFramesEvenWhileTheSocketBufferIsFull) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kWouldBlock};
  queue.push(numbered(1), at(5ms));
  queue.drain(at(0ms), transmitter);
  ASSERT_TRUE(queue.next_deadline());
  queue.drain(*queue.next_deadline(), transmitter);
  EXPECT_EQ(queue.size(), 0U);
  EXPECT_EQ(queue.counts().dropped_stale, 1U);
  EXPECT_FALSE(queue.wants_writable());
}

TEST(TransmitQueue, DropsTheOldestWhenFull) {
  TransmitQueue queue({.capacity = 3});
  FakeTransmitter transmitter;
  for (std::uint32_t id = 0; id < 5; ++id)
    queue.push(numbered(id), at(50ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{2, 3, 4}));
  EXPECT_EQ(queue.counts().dropped_overflow, 2U);
}

TEST(TransmitQueue, SkipsAFrameThatTheLinkCannotCarry) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kUnsupported, SendResult::kFailed};
  for (std::uint32_t id = 0; id < 3; ++id)
    queue.push(numbered(id), at(50ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{2}));
  EXPECT_EQ(queue.counts().dropped_failed, 2U);
}

TEST(TransmitQueue, SaysThatTheLinkIsDownUntilAFrameGoesOut) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kLinkDown};
  queue.push(numbered(1), at(50ms));
  queue.drain(at(0ms), transmitter);
  EXPECT_TRUE(queue.link_down());
  queue.drain(at(1ms), transmitter);
  EXPECT_FALSE(queue.link_down());
  EXPECT_EQ(transmitter.taken, (Ids{1}));
}

TEST(TransmitQueue, TriesAgainWhenTheClockWasSetBack) {
  TransmitQueue queue;
  FakeTransmitter transmitter;
  transmitter.answers = {SendResult::kNoBuffer};
  queue.push(numbered(1), at(1h));
  queue.drain(at(1h), transmitter);
  queue.drain(at(0ms), transmitter);
  EXPECT_EQ(transmitter.taken, (Ids{1}));
}

}  // namespace
}  // namespace vgyro::can
