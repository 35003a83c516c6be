#include "daemon/reporter.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

namespace vgyro::daemon {
namespace {

using gateway::Reject;
using gateway::State;

std::uint64_t& rejected(gateway::Status& status, std::size_t gyro, Reject cause) {
  return status.gyros[gyro].rejected[static_cast<std::size_t>(cause)];
}

std::size_t count_of(const std::string& what, const std::string& text) {
  std::size_t count = 0;
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
    ++count;
  return count;
}

class ReporterTest : public testing::Test {
 protected:
  ReporterTest() {
    for (gateway::GyroStatus& gyro : status.gyros) {
      gyro.heard = true;
      gyro.bias_dps = std::nan("");
    }
    status.rate_dps = std::nan("");
  }

  template <class Action>
  std::string said_during(const Action& action) {
    testing::internal::CaptureStderr();
    action();
    EXPECT_TRUE(log.flush(std::chrono::minutes(1)));
    return testing::internal::GetCapturedStderr();
  }

  std::string second() {
    return said_during([&] { last_line = reporter.second_passed(status, traffic); });
  }

  BusStatus& bus() { return traffic.buses.front(); }
  std::uint64_t& errors(can::ErrorCause cause) {
    return bus().errors[static_cast<std::size_t>(cause)];
  }

  gateway::Status status;
  Traffic traffic{.buses = {{.name = "can0", .present = true, .link_up = true}}, .transmitted = {}};
  Log log;
  Reporter reporter{{"left", "right"}, 60.0, log};
  std::string last_line;
};

TEST_F(ReporterTest, TellsEachChangeOfStateOnceAndWhoIsSilent) {
  status.state = State::kDegraded;
  status.gyros[1].heard = false;
  const std::string said = said_during([&] {
    reporter.check_state(status);
    reporter.check_state(status);
  });
  EXPECT_EQ(count_of("degraded (was waiting), gyro right is silent", said), 1U) << said;
  EXPECT_EQ(count_of("left", said), 0U) << said;
}

TEST_F(ReporterTest, HoldsAFlickeringStateBackAndSaysSo) {
  const std::string said = said_during([&] {
    for (int i = 0; i < 100; ++i) {
      status.state = i % 2 == 0 ? State::kRunning : State::kDegraded;
      reporter.check_state(status);
    }
  });
  EXPECT_EQ(count_of("\n", said), 10U) << said;
  std::string later;
  for (int i = 0; i < 60; ++i)
    later += second();
  EXPECT_EQ(count_of("90 more changes of state", later), 1U) << later;
}

TEST_F(ReporterTest, TellsEachChangeOfHealthOnceWithItsCause) {
  status.gyros[1].fault = gateway::Fault::kStuck;
  status.gyros[1].heard = false;
  std::string said = said_during([&] {
    reporter.check_state(status);
    reporter.check_state(status);
  });
  EXPECT_EQ(count_of("\n", said), 1U) << said;
  EXPECT_EQ(count_of("gyro right is not used: its value stands still", said), 1U) << said;
  status.gyros[1].fault.reset();
  status.gyros[1].heard = true;
  status.disagree = true;
  said = said_during([&] {
    reporter.check_state(status);
    reporter.check_state(status);
  });
  EXPECT_EQ(count_of("\n", said), 2U) << said;
  EXPECT_EQ(count_of("gyro right is healthy again (was stuck)", said), 1U) << said;
  EXPECT_EQ(count_of("the gyros disagree", said), 1U) << said;
}

TEST_F(ReporterTest, TellsOnceHowThePairContradictsItself) {
  status.state = State::kRunning;
  said_during([&] { reporter.check_state(status); });
  status.state = State::kContradicted;
  status.disagree = true;
  status.pair.contradiction = fusion::Contradiction::kSign;
  status.pair.slope = -1.0;
  const auto look = [&] {
    reporter.check_state(status);
    reporter.check_state(status);
  };
  std::string said = said_during(look);
  EXPECT_EQ(count_of("right moves -1.00 times left: sign = -1?", said), 1U) << said;
  EXPECT_EQ(count_of("contradicted (was running)", said), 1U) << said;
  EXPECT_EQ(count_of("\n", said), 2U) << said;
  second();
  EXPECT_NE(last_line.find("contradicted: right moves -1.00 times left"), std::string::npos)
      << last_line;
  status.state = State::kRunning;
  status.disagree = false;
  status.pair = {};
  said = said_during(look);
  EXPECT_EQ(count_of("the gyros move together again", said), 1U) << said;
  EXPECT_EQ(count_of("\n", said), 2U) << said;
}

double& probability(gateway::Status& status, fusion::Hypothesis hypothesis) {
  return status.probability[static_cast<std::size_t>(hypothesis)];
}

TEST_F(ReporterTest, TellsOnceThatTheDataCanBeReadInTwoWaysAndOnceThatTheyNoLongerCan) {
  status.ambiguous = true;
  probability(status, fusion::Hypothesis::kStanding) = 0.6;
  probability(status, fusion::Hypothesis::kTurning) = 0.4;
  const auto look = [&] {
    reporter.check_state(status);
    reporter.check_state(status);
  };
  std::string said = said_during(look);
  EXPECT_EQ(count_of("\n", said), 1U) << said;
  EXPECT_EQ(
      count_of("can be read in two ways, and σ spans both: standing 60 %, turning steadily 40 %",
               said),
      1U)
      << said;
  status.state = State::kRunning;
  second();
  EXPECT_NE(last_line.find(", ambiguous: standing 60 %, turning steadily 40 %;"), std::string::npos)
      << last_line;
  status.ambiguous = false;
  probability(status, fusion::Hypothesis::kStanding) = 0.99;
  probability(status, fusion::Hypothesis::kTurning) = 0.01;
  status.state = State::kWaiting;
  said = said_during(look);
  EXPECT_EQ(count_of("\n", said), 1U) << said;
  EXPECT_EQ(count_of("one explanation of the rates remains: standing 99 %\n", said), 1U) << said;
  second();
  EXPECT_EQ(last_line.find("ambiguous"), std::string::npos) << last_line;
}

TEST_F(ReporterTest, HoldsAFlickeringAmbiguityBackAndSaysSo) {
  const std::string said = said_during([&] {
    for (int i = 0; i < 100; ++i) {
      status.ambiguous = i % 2 == 0;
      reporter.check_state(status);
    }
  });
  EXPECT_EQ(count_of("\n", said), 10U) << said;
  std::string later;
  for (int i = 0; i < 60; ++i)
    later += second();
  EXPECT_EQ(count_of("90 more changes of health", later), 1U) << later;
}

TEST_F(ReporterTest, SaysWhatToLookAtWhereAGyroIsBlind) {
  status.gyros[1].fault = gateway::Fault::kBlind;
  const std::string said = said_during([&] { reporter.check_state(status); });
  EXPECT_EQ(count_of("gyro right does not feel the rotation that the other one feels", said), 1U)
      << said;
  EXPECT_EQ(count_of("is its axis parallel", said), 1U) << said;
}

TEST_F(ReporterTest, TellsOnceThatMostStopsAreRefusedAndWhatToLookAt) {
  status.stops = 1;
  status.stops_refused = 2;
  EXPECT_EQ(second(), "") << "two are no habit";
  ++status.stops_refused;
  const std::string said = second();
  EXPECT_EQ(count_of("4 steady stretches: 1 stop learned, 3 refused: turning together", said), 1U)
      << said;
  EXPECT_EQ(count_of("latitude_deg", said), 1U) << said;
  for (int i = 0; i < 200; ++i) {
    ++status.stops_refused;
    EXPECT_EQ(second(), "");
  }
}

TEST_F(ReporterTest, TellsThatTheEstimateWasLostAndThatItIsOurOwnFault) {
  status.estimate_restarts = 1;
  const std::string said = second();
  EXPECT_EQ(count_of("was restarted once: a fault of vgyro itself, please report it", said), 1U)
      << said;
  EXPECT_EQ(second(), "");
}

TEST_F(ReporterTest, TellsOnceThatTheGyrosRatesAreTooFarApart) {
  status.rates_too_far_apart = true;
  EXPECT_EQ(count_of("so much more often than the other that no pairs", second()), 1U);
  EXPECT_EQ(second(), "");
}

TEST_F(ReporterTest, TellsOnceWhatCounterMaxShouldBe) {
  status.gyros[1].counter_turns_at = 14;
  const std::string said = second() + second();
  EXPECT_EQ(
      count_of("gyro right: its counter always goes from 14 back to 0: counter_max = 14?", said),
      1U)
      << said;
}

TEST_F(ReporterTest, SumsUpTheSteadyStretchesAtTheEnd) {
  std::string said = said_during([&] { reporter.summarize(status, traffic); });
  EXPECT_EQ(count_of("steady stretch", said), 0U) << said;
  status.stops = 7;
  status.stops_refused = 1;
  said = said_during([&] { reporter.summarize(status, traffic); });
  EXPECT_EQ(count_of("retries); 8 steady stretches: 7 stops learned, 1 refused: turning together; "
                     "bias left unknown",
                     said),
            1U)
      << said;
}

TEST_F(ReporterTest, HoldsAFlickeringHealthBackAndSaysSo) {
  const std::string said = said_during([&] {
    for (int i = 0; i < 100; ++i) {
      status.gyros[0].fault = i % 2 == 0 ? std::optional(gateway::Fault::kSaturated) : std::nullopt;
      reporter.check_state(status);
    }
  });
  EXPECT_EQ(count_of("\n", said), 10U) << said;
  std::string later;
  for (int i = 0; i < 60; ++i)
    later += second();
  EXPECT_EQ(count_of("90 more changes of health", later), 1U) << later;
}

TEST_F(ReporterTest, TellsTheFirstOfEachCauseAtOnceAndTheRestOnceAMinute) {
  rejected(status, 0, Reject::kOutOfRange) = 1;
  EXPECT_EQ(count_of("gyro left: 1 frames not used", second()), 1U);
  rejected(status, 1, Reject::kOutOfRange) = 1;
  EXPECT_EQ(count_of("gyro right: 1 frames not used", second()), 1U) << "another gyro is news";
  std::string said;
  for (int i = 0; i < 58; ++i) {
    ++rejected(status, 0, Reject::kOutOfRange);
    said += second();
  }
  EXPECT_EQ(said, "");
  EXPECT_EQ(count_of("gyro left: 58 frames not used", second()), 1U);
}

TEST_F(ReporterTest, SaysNothingWhenNothingIsWrong) {
  for (int i = 0; i < 200; ++i)
    EXPECT_EQ(second(), "");
}

TEST_F(ReporterTest, TellsFramesThatWereLostOrDropped) {
  bus().lost = 7;
  traffic.transmitted.dropped_stale = 8;
  const std::string said = second();
  EXPECT_EQ(count_of("can0: 7 received frames lost", said), 1U) << said;
  EXPECT_EQ(count_of("8 frames dropped: the bus did not take them in time", said), 1U) << said;
}

TEST_F(ReporterTest, TellsOfTheControllersTroubleOnceAMinuteAndInTheStatus) {
  errors(can::ErrorCause::kBusOff) = 1;
  bus().controller = can::ControllerState::kBusOff;
  std::string said = second();
  EXPECT_EQ(count_of("can0: bus-off", said), 1U) << said;
  EXPECT_EQ(count_of("restart-ms", said), 1U) << said;
  EXPECT_NE(last_line.find("; can0 is bus-off;"), std::string::npos) << last_line;
  errors(can::ErrorCause::kRestarted) = 1;
  bus().controller = can::ControllerState::kActive;
  EXPECT_EQ(count_of("can0: the controller is back on the bus, restarted once", second()), 1U);
  EXPECT_EQ(last_line.find("bus-off"), std::string::npos) << last_line;
  said.clear();
  for (int i = 0; i < 300; ++i) {
    errors(can::ErrorCause::kBusOff) += 3;
    errors(can::ErrorCause::kLostArbitration) += 1000;
    said += second();
  }
  EXPECT_LE(count_of("\n", said), 12U) << said;
  EXPECT_GE(count_of("can0: bus-off", said), 4U) << said;
}

TEST_F(ReporterTest, SaysInTheStatusWhichInterfaceIsMissingOrDown) {
  bus().present = false;
  second();
  EXPECT_NE(last_line.find("; can0 is not there;"), std::string::npos) << last_line;
  bus().present = true;
  bus().link_up = false;
  second();
  EXPECT_NE(last_line.find("; can0 is down;"), std::string::npos) << last_line;
}

// After a reload the queue's counters go on; earlier counts must not be reported again.
TEST_F(ReporterTest, DoesNotTellAgainWhatWasSentBeforeItBegan) {
  traffic.transmitted.sent = 1'000'000;
  traffic.transmitted.dropped_stale = 50;
  reporter.start_from(traffic.transmitted);
  EXPECT_EQ(second(), "");
  EXPECT_NE(last_line.find(" 0 out"), std::string::npos) << last_line;
}

TEST_F(ReporterTest, PutsStateRateBiasesAndTrafficInTheStatusLine) {
  bus().received = 1000;
  second();
  status.state = State::kRunning;
  status.rate_dps = 50.00321;
  status.gyros[0].bias_dps = 0.0330;
  status.gyros[1].bias_dps = -0.0074;
  bus().received = 2000;
  traffic.transmitted.sent = 520;
  second();
  EXPECT_EQ(last_line,
            "running, 50.00321 deg/s; bias left 118.80, right -26.64 deg/h; 1000 frames/s in, "
            "520 out");
}

TEST_F(ReporterTest, ShowsTheProgressOfCalibration) {
  status.state = State::kCalibrating;
  status.calibrated_s = 12.34;
  second();
  EXPECT_EQ(last_line.rfind("calibrating (12.3 of 60 s); bias left unknown", 0), 0U) << last_line;
}

TEST_F(ReporterTest, SaysWhoseBiasesItTookUpAndWhenTheyAreConfirmed) {
  status.restored = gateway::Restored::kOffered;
  EXPECT_EQ(second(), "");
  status.restored = gateway::Restored::kTakenUp;
  status.restored_age_s = 3.0 * 3600.0;
  status.restored_bias_sigma_dps = 0.0002;
  status.gyros[0].bias_dps = 0.0331;
  status.gyros[1].bias_dps = -0.0074;
  EXPECT_NE(
      second().find("restored the biases saved 3 h ago: left +0.03310, right -0.00740 deg/s; the "
                    "rate ± 0.00020"),
      std::string::npos);
  EXPECT_NE(last_line.find("with biases saved 3 h before the start"), std::string::npos);
  EXPECT_EQ(second(), "");
  status.restored = gateway::Restored::kConfirmed;
  EXPECT_NE(second().find("a stop has confirmed the biases"), std::string::npos);
  EXPECT_EQ(last_line.find("before the start"), std::string::npos);
  EXPECT_EQ(second(), "");
}

TEST_F(ReporterTest, TellsTheAgeInUnitsThatPeopleUse) {
  const std::pair<double, const char*> ages[] = {{7.2, "7 s ago"},
                                                 {300.0, "5 min ago"},
                                                 {86'400.0, "24 h ago"},
                                                 {864'000.0, "10 days ago"},
                                                 {std::nan(""), "an unknown time ago"}};
  for (const auto& [age_s, text] : ages) {
    status.restored = gateway::Restored::kNothing;
    second();
    status.restored = gateway::Restored::kTakenUp;
    status.restored_age_s = age_s;
    EXPECT_NE(second().find(text), std::string::npos) << text;
  }
}

TEST_F(ReporterTest, WarnsWhenTheSavedBiasesCannotBeRight) {
  status.restored = gateway::Restored::kOffered;
  second();
  status.restored = gateway::Restored::kRefused;
  EXPECT_NE(second().find("the saved biases cannot be right; calibrating"), std::string::npos);
  EXPECT_EQ(second(), "");
}

TEST_F(ReporterTest, TellsOnceAMinuteThatStampsAreNoTimesOfArrival) {
  bus().restamped = 500;
  const std::string said = second();
  EXPECT_NE(said.find("can0: 500 frames had a stamp that is not the time of their arrival"),
            std::string::npos)
      << said;
  EXPECT_NE(said.find("SO_TXTIME"), std::string::npos) << said;
  for (int i = 1; i < 60; ++i) {
    bus().restamped += 500;
    EXPECT_EQ(second(), "");
  }
  EXPECT_NE(second().find("can0: 29500 frames"), std::string::npos);
}

TEST_F(ReporterTest, TellsOnceAMinuteThatSomebodyElseSendsOurIdentifiers) {
  bus().foreign = 3;
  bus().contested = true;
  const std::string said = second();
  EXPECT_NE(said.find("can0: 3 frames with our identifiers came from another sender"),
            std::string::npos)
      << said;
  EXPECT_NE(said.find("rate_id"), std::string::npos) << said;
  EXPECT_NE(last_line.find("another sender uses our identifiers on can0"), std::string::npos);
  for (int i = 1; i < 60; ++i) {
    bus().foreign += 10;
    EXPECT_EQ(second(), "");
  }
  bus().contested = false;
  EXPECT_NE(second().find("can0: 590 frames"), std::string::npos);
  EXPECT_EQ(last_line.find("another sender"), std::string::npos);
}

}  // namespace
}  // namespace vgyro::daemon
