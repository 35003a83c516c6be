#include "can/error_frame.h"

#include <initializer_list>

#include <gtest/gtest.h>

namespace vgyro::can {
namespace {

Frame error_frame(std::uint32_t classes, std::uint8_t controller_bits = 0) {
  Frame frame;
  frame.id = classes;
  frame.flags = kError;
  frame.length = 8;
  frame.data[1] = controller_bits;
  return frame;
}

TEST(ControllerWatch, FollowsTheControllerFromActiveToBusOffAndBack) {
  ControllerWatch watch;
  EXPECT_EQ(watch.state(), ControllerState::kActive);
  watch.note(error_frame(kControllerProblem, kSendWarning));
  EXPECT_EQ(watch.state(), ControllerState::kWarning);
  watch.note(error_frame(kControllerProblem, kReceivePassive | kReceiveWarning));
  EXPECT_EQ(watch.state(), ControllerState::kPassive);
  watch.note(error_frame(kBusOff));
  EXPECT_EQ(watch.state(), ControllerState::kBusOff);
  watch.note(error_frame(kRestarted));
  EXPECT_EQ(watch.state(), ControllerState::kActive);
  for (const ErrorCause cause : {ErrorCause::kErrorWarning, ErrorCause::kErrorPassive,
                                 ErrorCause::kBusOff, ErrorCause::kRestarted})
    EXPECT_EQ(watch.count(cause), 1U) << to_string(cause);
}

TEST(ControllerWatch, RecoversFromPassiveWithoutARestart) {
  ControllerWatch watch;
  watch.note(error_frame(kControllerProblem, kSendPassive));
  watch.note(error_frame(kControllerProblem, kActiveAgain));
  EXPECT_EQ(watch.state(), ControllerState::kActive);
}

TEST(ControllerWatch, CountsEveryCauseThatAFrameNames) {
  ControllerWatch watch;
  for (int i = 0; i < 3; ++i)
    watch.note(error_frame(kLostArbitration | kNotAcknowledged | kSendTimeout | kTransceiver));
  watch.note(error_frame(kControllerProblem, kReceiveOverflow));
  for (const ErrorCause cause : {ErrorCause::kLostArbitration, ErrorCause::kNotAcknowledged,
                                 ErrorCause::kSendTimeout, ErrorCause::kTransceiver})
    EXPECT_EQ(watch.count(cause), 3U) << to_string(cause);
  EXPECT_EQ(watch.count(ErrorCause::kOverflow), 1U);
  EXPECT_EQ(watch.state(), ControllerState::kActive) << "none of them says how it stands";
}

// Any program that may open a socket can write such frames.
TEST(ControllerWatch, IsNotMovedByFramesOfAnotherKindOrCutShort) {
  ControllerWatch watch;
  Frame data = error_frame(kBusOff);
  data.flags = 0;
  watch.note(data);
  Frame cut = error_frame(kControllerProblem, kSendPassive);
  cut.length = 1;
  watch.note(cut);
  watch.note(error_frame(0x1FFFFE00));
  EXPECT_EQ(watch.state(), ControllerState::kActive);
  for (const std::uint64_t count : watch.counts())
    EXPECT_EQ(count, 0U);
}

TEST(ControllerWatch, ForgetsTheStateButNoCountWithANewLink) {
  ControllerWatch watch;
  watch.note(error_frame(kBusOff));
  watch.forget_state();
  EXPECT_EQ(watch.state(), ControllerState::kActive);
  EXPECT_EQ(watch.count(ErrorCause::kBusOff), 1U);
}

}  // namespace
}  // namespace vgyro::can
