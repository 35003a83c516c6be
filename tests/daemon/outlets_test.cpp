// A frame that waits for one bus is not sent to another, and every frame is counted.

#include "daemon/outlets.h"

#include <gtest/gtest.h>

namespace vgyro::daemon {
namespace {

constexpr TimePoint kSoon = time_from_ns(1'000'000);
constexpr TimePoint kLater = time_from_ns(2'000'000);

/// Takes every frame.
class Open final : public can::Transmitter {
 public:
  can::SendResult send(const can::Frame&) override {
    ++taken;
    return can::SendResult::kSent;
  }
  int taken = 0;
};

TEST(Outlets, QueuesGoOverByTheNameOfTheBus) {
  Outlets before({"can0", "can1", "can2"});
  Open bus;
  ASSERT_TRUE(before[0].queue.send_at_once({}, bus));
  before[1].queue.push({}, kSoon);
  before[2].queue.push({}, kLater);
  before[2].queue.push({}, kLater);
  before[1].polls_writable = true;
  Outlets after({"can3", "can1"});
  after.take_over(std::move(before));
  EXPECT_EQ(after[0].queue.size(), 0U);
  ASSERT_EQ(after[1].queue.size(), 1U);
  EXPECT_FALSE(after[1].polls_writable) << "poll knows nothing of the new socket";
  EXPECT_EQ(after.counts().sent, 1U);
  EXPECT_EQ(after.counts().dropped_stale, 2U) << "waited for a bus that is gone";
  after[1].queue.drain(time_from_ns(0), bus);
  EXPECT_EQ(bus.taken, 2);
  EXPECT_EQ(after.counts().sent, 2U);
  Outlets last({"can1"});
  last.take_over(std::move(after));
  EXPECT_EQ(last.counts().sent, 2U);
  EXPECT_EQ(last.counts().dropped_stale, 2U);
}

TEST(Outlets, InShadowModeNoTransmitterIsEverAsked) {
  Outlets shadow({"can0", "can1"}, false);
  Open bus;
  EXPECT_TRUE(shadow.send_at_once(0, {}, bus));
  shadow.push(1, {}, kLater);
  EXPECT_EQ(shadow[0].queue.size() + shadow[1].queue.size(), 0U);
  EXPECT_FALSE(shadow.next_deadline());
  for (std::size_t i = 0; i < shadow.size(); ++i)
    shadow[i].queue.drain(time_from_ns(0), bus);
  EXPECT_EQ(bus.taken, 0);
  EXPECT_EQ(shadow.counts().sent, 0U);
  EXPECT_EQ(shadow.shadowed(), 2U);
}

TEST(Outlets, WhatWaitsWhenShadowModeBeginsIsNotSent) {
  Outlets before({"can0"});
  Open bus;
  ASSERT_TRUE(before.send_at_once(0, {}, bus));
  before.push(0, {}, kLater);
  Outlets shadow({"can0"}, false);
  shadow.take_over(std::move(before));
  EXPECT_EQ(shadow[0].queue.size(), 0U);
  EXPECT_EQ(shadow.counts().sent, 1U);
  EXPECT_EQ(shadow.counts().dropped_stale, 1U) << "nothing falls out of the books";
  shadow.push(0, {}, kLater);
  Outlets after({"can0"});
  after.take_over(std::move(shadow));
  EXPECT_EQ(after.shadowed(), 1U);
  EXPECT_TRUE(after.send_at_once(0, {}, bus));
  EXPECT_EQ(bus.taken, 2);
  EXPECT_EQ(after.counts().sent, 2U);
}

TEST(Outlets, TheFirstDeadlineCounts) {
  Outlets outlets({"can0", "can1"});
  EXPECT_FALSE(outlets.next_deadline());
  outlets[1].queue.push({}, kLater);
  const auto alone = outlets.next_deadline();
  outlets[0].queue.push({}, kSoon);
  ASSERT_TRUE(alone && outlets.next_deadline());
  EXPECT_LE(*outlets.next_deadline(), *alone);
  EXPECT_EQ(*outlets.next_deadline(), *outlets[0].queue.next_deadline());
}

}  // namespace
}  // namespace vgyro::daemon
