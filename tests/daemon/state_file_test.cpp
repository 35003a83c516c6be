// A file that is whole at every moment. The tests watch the system calls that achieve this, and
// make them fail (watched_calls.h).

#include "daemon/state_file.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <random>
#include <string>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "gateway/saved_state.h"
#include "scratch.h"
#include "watched_calls.h"

namespace vgyro::daemon {
namespace {

constexpr std::size_t kBytesMax = gateway::kSavedStateBytesMax;

class StateFileTest : public testing::Test {
 protected:
  ~StateFileTest() override { calls = {}; }
  static Expected<void> watched(const StateFile& file, const std::string& text) {
    calls.watching = true;
    Expected<void> done = file.write(text);
    calls.watching = false;
    return done;
  }
  [[nodiscard]] std::string read() const { return file.read().value().value(); }

  Scratch scratch;
  StateFile file{scratch.path("state.toml"), kBytesMax};
};

TEST_F(StateFileTest, ReadsWhatWasWritten) {
  EXPECT_FALSE(file.read().value());
  ASSERT_TRUE(file.write("one"));
  EXPECT_EQ(read(), "one");
  ASSERT_TRUE(file.write("two, which is longer"));
  EXPECT_EQ(read(), "two, which is longer");
  ASSERT_TRUE(file.write(""));
  EXPECT_EQ(read(), "");
  EXPECT_EQ(scratch.count(), 1U);
}

TEST_F(StateFileTest, OthersCannotReadIt) {
  ASSERT_TRUE(file.write("one"));
  struct stat about {};
  ASSERT_EQ(::stat(file.path().c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 0777U, 0600U);
}

// Against a loss of power: bytes are synced before the name, and the name before success is
// reported.
TEST_F(StateFileTest, BytesAreOnTheDiskBeforeTheName) {
  ASSERT_TRUE(watched(file, "one"));
  const std::vector<std::string> right{"write", "fsync file", "rename", "fsync directory"};
  EXPECT_EQ(calls.names, right);
}

TEST_F(StateFileTest, WritesOnWhereTheSystemTakesABit) {
  calls.write_most = 3;
  ASSERT_TRUE(watched(file, "ten bytes."));
  EXPECT_EQ(read(), "ten bytes.");
}

TEST_F(StateFileTest, AnyFailureLeavesTheOldFileAndNothingElse) {
  ASSERT_TRUE(file.write("old"));
  for (const char* failing : {"write", "fsync file", "rename"}) {
    SCOPED_TRACE(failing);
    calls.failing = failing;
    calls.failure = ENOSPC;
    const Expected<void> done = watched(file, "new");
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().where, file.path());
    EXPECT_NE(done.error().what.find("No space left"), std::string::npos) << done.error().what;
    EXPECT_FALSE(done.error().remedy.empty());
    EXPECT_EQ(read(), "old");
    EXPECT_EQ(scratch.count(), 1U);
  }
}

TEST_F(StateFileTest, TellsWhenTheNameMayNotBeOnTheDisk) {
  calls.failing = "fsync directory";
  EXPECT_FALSE(watched(file, "new"));
  EXPECT_EQ(read(), "new");
}

TEST_F(StateFileTest, LeftoversOfAKilledWriterGo) {
  scratch.put("state.toml.new", "half");
  file.clean_up();
  EXPECT_EQ(scratch.count(), 0U);
  scratch.put("state.toml.new", "half, and much longer than the next one");
  ASSERT_TRUE(file.write("whole"));
  EXPECT_EQ(read(), "whole");
  EXPECT_EQ(scratch.count(), 1U);
}

// Another user with write access to the directory could make the new name a link.
TEST_F(StateFileTest, WritesThroughNoLink) {
  scratch.put("victim", "untouched");
  ASSERT_EQ(::symlink(scratch.path("victim").c_str(), scratch.path("state.toml.new").c_str()), 0);
  ASSERT_TRUE(file.write("one"));
  EXPECT_EQ(scratch.text("victim"), "untouched");
  EXPECT_EQ(read(), "one");
}

TEST_F(StateFileTest, WhatIsNoFileIsNeitherReadNorReplaced) {
  ASSERT_EQ(::mkfifo(scratch.path("pipe").c_str(), 0600), 0);
  for (const std::string& path :
       {std::string("/dev/null"), scratch.path("pipe"), scratch.path("")}) {
    SCOPED_TRACE(path);
    const StateFile odd(path, kBytesMax);
    EXPECT_FALSE(odd.read());
    EXPECT_FALSE(odd.check_writable());
    EXPECT_FALSE(odd.write("one"));
  }
  struct stat about {};
  ASSERT_EQ(::stat("/dev/null", &about), 0);
  EXPECT_TRUE(S_ISCHR(about.st_mode));
}

TEST_F(StateFileTest, MissingDirectoryIsSaidWithARemedy) {
  const StateFile lost(scratch.path("nowhere/state.toml"), kBytesMax);
  EXPECT_FALSE(lost.read().value());
  const Expected<void> done = lost.check_writable();
  ASSERT_FALSE(done);
  EXPECT_NE(done.error().message().find("--state"), std::string::npos);
  EXPECT_FALSE(lost.write("one"));
}

TEST_F(StateFileTest, ReadsNoMoreThanItMust) {
  scratch.put("state.toml", std::string(kBytesMax + 100'000, 'x'));
  EXPECT_EQ(read().size(), kBytesMax + 1);
}

TEST_F(StateFileTest, SetsAsideOverAnEarlierOne) {
  for (const char* text : {"first", "second"}) {
    ASSERT_TRUE(file.write(text));
    ASSERT_TRUE(file.set_aside());
    EXPECT_FALSE(file.read().value());
    EXPECT_EQ(scratch.text("state.toml.refused"), text);
  }
}

// --- killed at any moment ------------------------------------------------------------------------

gateway::SavedState numbered(std::int64_t number) {
  gateway::SavedState state;
  const auto value = static_cast<double>(number);
  state.drift.bias_dps = {value / 7.0, -value / 3.0};
  state.drift.bias_covariance = {1e-8, 0.0, 1e-8};
  state.drift.white_density = {1e-8, 0.0, 1e-8};
  state.drift.walk_weight.fill(1.0 / static_cast<double>(fusion::kWalkPairs));
  state.rate_stamp = time_from_ns(number);
  state.devices = {"a", "b"};
  return state;
}

[[noreturn]] void write_for_ever(const StateFile& file, std::int64_t number, int ready_fd) {
  for (;; ++number) {
    if (!file.write(gateway::to_text(numbered(number)))) ::_exit(1);
    const char byte = 'w';
    static_cast<void>(!::write(ready_fd, &byte, 1));
  }
}

int kills() {
  const char* wish = std::getenv("VGYRO_KILLS");
  return wish != nullptr ? std::atoi(wish) : 200;
}

// The child writes as fast as it can and is killed at a random moment. The file must be whole, and
// hold the last state that was finished or begun.
TEST_F(StateFileTest, KilledAtAnyMomentTheFileIsWholeAndTheLastOneFinishedOrBegun) {
  constexpr std::uint32_t kSeed = 7;
  SCOPED_TRACE(kSeed);
  std::mt19937 rng(kSeed);
  // The moments are spread over two writes, however long this disk takes.
  constexpr int kTimed = 5;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kTimed; ++i)
    ASSERT_TRUE(file.write(gateway::to_text(numbered(0))));
  const auto write_takes = (std::chrono::steady_clock::now() - begin) / kTimed;
  std::uniform_int_distribution<std::int64_t> moment_ns(
      0, 2 * std::chrono::nanoseconds(write_takes).count());
  std::int64_t newest = 0;
  std::size_t leftovers = 0;
  for (int round = 0; round < kills(); ++round) {
    int pipe_fds[2];
    ASSERT_EQ(::pipe2(pipe_fds, O_CLOEXEC), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) write_for_ever(file, newest + 1, pipe_fds[1]);
    ::close(pipe_fds[1]);
    char byte = 0;
    ASSERT_EQ(::read(pipe_fds[0], &byte, 1), 1);
    std::this_thread::sleep_for(std::chrono::nanoseconds(moment_ns(rng)));
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    std::int64_t finished = newest + 1;
    while (::read(pipe_fds[0], &byte, 1) == 1)
      ++finished;
    ::close(pipe_fds[0]);

    const auto state = gateway::saved_state_from(read(), file.path());
    ASSERT_TRUE(state) << state.error().message();
    const std::int64_t number = to_ns(state->rate_stamp);
    ASSERT_EQ(gateway::to_text(*state), gateway::to_text(numbered(number)));
    ASSERT_GE(number, finished);
    ASSERT_LE(number, finished + 1);
    newest = number;
    leftovers += static_cast<std::size_t>(scratch.has("state.toml.new"));
    ASSERT_LE(scratch.count(), 2U);
  }
  std::printf("%d kills, %zu amid a write; a write takes %.2f ms here\n", kills(), leftovers,
              std::chrono::duration<double, std::milli>(write_takes).count());
  EXPECT_GT(leftovers, 0U) << "no kill came amid a write: this proved nothing";
  file.clean_up();
  EXPECT_EQ(scratch.count(), 1U);
}

}  // namespace
}  // namespace vgyro::daemon
