// Loading, refusing, renaming and writing the state, and the log lines about it.

#include "daemon/state_keeper.h"

#include <filesystem>
#include <string>
#include <unistd.h>

#include <gtest/gtest.h>

#include "scratch.h"
#include "tests/gateway/rig.h"

namespace vgyro::daemon {
namespace {

class StateKeeperTest : public testing::Test {
 protected:
  template <class Action>
  std::string said_during(const Action& action) {
    testing::internal::CaptureStderr();
    action();
    EXPECT_TRUE(log.flush(std::chrono::minutes(1)));
    return testing::internal::GetCapturedStderr();
  }

  [[nodiscard]] gateway::SavedState state(double bias_dps) const {
    gateway::SavedState state;
    state.drift.bias_dps = {bias_dps, 0.0};
    state.drift.bias_covariance = {1e-8, 0.0, 1e-8};
    state.drift.walk_weight.fill(1.0 / static_cast<double>(fusion::kWalkPairs));
    state.devices = {device_of(plan.gyros[0]), device_of(plan.gyros[1])};
    return state;
  }
  [[nodiscard]] double loaded_bias() {
    StateKeeper reader(path, log);
    const auto loaded = reader.load(plan);
    return loaded ? loaded->drift.bias_dps[0] : -1.0;
  }

  gateway::Plan plan = gateway::rig::two_gyros();
  Scratch scratch;
  std::string path = scratch.path("state.toml");
  Log log;
};

TEST_F(StateKeeperTest, LoadsWhatWasKept) {
  {
    StateKeeper keeper(path, log);
    EXPECT_FALSE(keeper.load(plan));
    keeper.finish(state(0.25));
  }
  EXPECT_EQ(loaded_bias(), 0.25);
  EXPECT_EQ(scratch.count(), 1U);
}

TEST_F(StateKeeperTest, WritesFirstAtOnceThenEveryMinute) {
  StateKeeper keeper(path, log);
  int due = 0;
  for (int second = 0; second < 5; ++second) {
    ASSERT_TRUE(keeper.second_passed()) << "nothing was kept yet";
    keeper.keep(std::nullopt);
  }
  EXPECT_EQ(scratch.count(), 0U);
  for (int second = 0; second < 180; ++second) {
    if (!keeper.second_passed()) continue;
    ++due;
    keeper.keep(state(second));
  }
  EXPECT_EQ(due, 3);
}

TEST_F(StateKeeperTest, WritesNothingWhereNothingWasLearned) {
  StateKeeper keeper(path, log);
  keeper.keep(state(1.0));
  keeper.finish(state(1.0));
  const auto written = std::filesystem::last_write_time(path);
  StateKeeper again(path, log);
  again.finish(std::nullopt);
  EXPECT_EQ(std::filesystem::last_write_time(path), written);
  EXPECT_EQ(loaded_bias(), 1.0);
}

TEST_F(StateKeeperTest, TheLastWordIsOnTheDiskWhenFinishReturns) {
  for (int round = 0; round < 50; ++round) {
    StateKeeper keeper(path, log);
    keeper.keep(state(round));
    keeper.finish(state(round + 0.5));
    ASSERT_EQ(loaded_bias(), round + 0.5);
  }
}

// A corrector with a wrong state must not overwrite the last good one.
TEST_F(StateKeeperTest, AStateThatWouldBeRefusedIsNotWritten) {
  StateKeeper keeper(path, log);
  const std::string said = said_during([&] {
    keeper.keep(state(1.0));
    keeper.finish(state(std::numeric_limits<double>::quiet_NaN()));
  });
  EXPECT_NE(said.find("not written: bias_dps is nan"), std::string::npos) << said;
  EXPECT_EQ(loaded_bias(), 1.0);
}

TEST_F(StateKeeperTest, ADamagedFileIsToldAndSetAside) {
  std::string text = gateway::to_text(state(1.0));
  text[text.size() / 2] ^= 1;
  scratch.put("state.toml", text);
  StateKeeper keeper(path, log);
  const std::string said = said_during([&] { EXPECT_FALSE(keeper.load(plan)); });
  for (const std::string& part : {path + ": is damaged", std::string("calibrates again"),
                                  "renamed to " + path + ".refused"}) {
    EXPECT_NE(said.find(part), std::string::npos) << said;
  }
  EXPECT_EQ(scratch.text("state.toml.refused"), text);
  EXPECT_FALSE(scratch.has("state.toml"));
  keeper.finish(state(2.0));
  EXPECT_EQ(loaded_bias(), 2.0);
}

TEST_F(StateKeeperTest, AFileOfOtherGyrosIsToldAndSetAside) {
  gateway::SavedState other = state(1.0);
  other.devices[0] = "other: can7";
  scratch.put("state.toml", gateway::to_text(other));
  StateKeeper keeper(path, log);
  const std::string said = said_during([&] { EXPECT_FALSE(keeper.load(plan)); });
  EXPECT_NE(said.find(path + ": is of other gyros: of `other: can7`"), std::string::npos) << said;
  EXPECT_TRUE(scratch.has("state.toml.refused"));
}

TEST_F(StateKeeperTest, ForgetRemovesIt) {
  scratch.put("state.toml", gateway::to_text(state(1.0)));
  StateKeeper keeper(path, log);
  said_during([&] { keeper.forget(); });
  EXPECT_EQ(scratch.count(), 0U);
  const std::string said = said_during([&] { keeper.forget(); });
  EXPECT_EQ(said.find("cannot"), std::string::npos) << said;
}

TEST_F(StateKeeperTest, ADirectoryThatIsNotThereIsToldOnceAndNeverFatal) {
  StateKeeper keeper(scratch.path("nowhere/state.toml"), log);
  const std::string said = said_during([&] {
    EXPECT_FALSE(keeper.load(plan));
    for (int i = 0; i < 3; ++i) {
      keeper.keep(state(i));
      keeper.second_passed();
    }
    keeper.finish(state(9.0));
  });
  const std::size_t first = said.find("cannot be written: No such file or directory");
  ASSERT_NE(first, std::string::npos) << said;
  EXPECT_EQ(said.find("cannot be written", first + 1), std::string::npos) << said;
}

TEST_F(StateKeeperTest, ASecondGatewayOnTheSameFileIsToldWhoHasItAndWhatToDo) {
  StateKeeper keeper(path, log);
  ASSERT_TRUE(keeper.lock());
  keeper.keep(state(1.0));
  StateKeeper second(path, log);
  const Expected<void> locked = second.lock();
  ASSERT_FALSE(locked);
  const std::string message = locked.error().message();
  for (const std::string& part :
       {path, "process " + std::to_string(::getpid()), std::string("--state FILE")}) {
    EXPECT_NE(message.find(part), std::string::npos) << message;
  }
}

TEST_F(StateKeeperTest, AFolderThatIsNotThereKeepsNobodyFromStarting) {
  StateKeeper keeper(scratch.path("nowhere/state.toml"), log);
  EXPECT_TRUE(keeper.lock());
}

TEST_F(StateKeeperTest, SaysWhenItCanWriteAgain) {
  StateKeeper keeper(scratch.path("later/state.toml"), log);
  said_during([&] { keeper.load(plan); });
  std::filesystem::create_directory(scratch.path("later"));
  const std::string said = said_during([&] { keeper.finish(state(1.0)); });
  EXPECT_NE(said.find("written again"), std::string::npos) << said;
}

}  // namespace
}  // namespace vgyro::daemon
