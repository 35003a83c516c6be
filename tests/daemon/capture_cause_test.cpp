#include "daemon/capture_cause.h"

#include <gtest/gtest.h>

namespace vgyro::daemon {
namespace {

bool has(const CaptureTriggers::Causes& causes, CaptureCause cause) {
  return causes[static_cast<std::size_t>(cause)];
}

TEST(CaptureTriggers, EachNewContradictionAndDisagreementIsACauseOnce) {
  CaptureTriggers triggers;
  gateway::Status status;
  EXPECT_EQ(triggers.look(status), CaptureTriggers::Causes{});
  status.contradictions = 1;
  CaptureTriggers::Causes causes = triggers.look(status);
  EXPECT_TRUE(has(causes, CaptureCause::kContradicted));
  EXPECT_FALSE(has(causes, CaptureCause::kDisagree));
  EXPECT_EQ(triggers.look(status), CaptureTriggers::Causes{}) << "it still stands";
  status.disagreements = 4;
  causes = triggers.look(status);
  EXPECT_TRUE(has(causes, CaptureCause::kDisagree));
  EXPECT_FALSE(has(causes, CaptureCause::kContradicted));
}

// A restart or a reload takes up the verdict without counting it.
TEST(CaptureTriggers, AVerdictThatIsTakenUpAndCountersThatBeginAnewAreNoCause) {
  CaptureTriggers triggers;
  gateway::Status status;
  status.pair.contradiction = fusion::Contradiction::kSign;
  status.disagree = true;
  EXPECT_EQ(triggers.look(status), CaptureTriggers::Causes{});
  status.contradictions = 5;
  triggers.look(status);
  status.contradictions = 0;
  EXPECT_EQ(triggers.look(status), CaptureTriggers::Causes{});
  status.contradictions = 1;
  EXPECT_TRUE(has(triggers.look(status), CaptureCause::kContradicted));
}

TEST(CaptureTriggers, ARefusedStopIsACauseWhereMostStretchesTaughtLittle) {
  struct Step {
    std::uint64_t learned, refused, open;
    bool is_cause;
  };
  constexpr Step kSteps[] = {
      {0, 1, 0, false}, {0, 2, 0, false},  // too few to judge
      {0, 3, 0, true},                     // most taught little, and this one too
      {0, 3, 0, false},                    // nothing new
      {1, 3, 0, false},                    // a good one
      {1, 3, 1, true},                     // left open
      {9, 3, 1, false}, {9, 4, 1, false},  // refused, but most are good
  };
  CaptureTriggers triggers;
  gateway::Status status;
  for (const Step& step : kSteps) {
    status.stops = step.learned;
    status.stops_refused = step.refused;
    status.stops_open = step.open;
    EXPECT_EQ(has(triggers.look(status), CaptureCause::kStopsRefused), step.is_cause)
        << step.learned << ' ' << step.refused << ' ' << step.open;
  }
}

TEST(CaptureCause, NamesAreReadBack) {
  for (std::size_t i = 0; i < kCaptureCauses; ++i) {
    const auto cause = static_cast<CaptureCause>(i);
    EXPECT_EQ(capture_cause_from(to_string(cause)), cause);
  }
  EXPECT_FALSE(capture_cause_from("contradict"));
}

}  // namespace
}  // namespace vgyro::daemon
