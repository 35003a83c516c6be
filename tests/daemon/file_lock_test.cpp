// One owner at a time, however the owner ends.

#include "daemon/file_lock.h"

#include <atomic>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "scratch.h"

namespace vgyro::daemon {
namespace {

using Outcome = FileLock::Outcome;

class FileLockTest : public testing::Test {
 protected:
  Scratch scratch;
  std::string path = scratch.path("state.toml");
};

TEST_F(FileLockTest, HasOneOwnerAndSaysWho) {
  FileLock first(path);
  ASSERT_EQ(first.take(), Outcome::kTaken);
  FileLock second(path);
  EXPECT_EQ(second.take(), Outcome::kHeld);
  EXPECT_EQ(second.holder(), "process " + std::to_string(::getpid()));
}

TEST_F(FileLockTest, LeavesNothingBehindAndIsFreeAgain) {
  std::optional<FileLock> first(std::in_place, path);
  ASSERT_EQ(first->take(), Outcome::kTaken);
  first.reset();
  EXPECT_EQ(scratch.count(), 0U);
  FileLock second(path);
  EXPECT_EQ(second.take(), Outcome::kTaken);
}

TEST_F(FileLockTest, StaysAlthoughTheFileItselfIsReplaced) {
  FileLock first(path);
  ASSERT_EQ(first.take(), Outcome::kTaken);
  scratch.put("state.toml", "old");
  scratch.put("state.toml.new", "new");
  std::filesystem::rename(path + ".new", path);
  FileLock second(path);
  EXPECT_EQ(second.take(), Outcome::kHeld);
}

TEST_F(FileLockTest, AKilledOwnerHoldsItNoLonger) {
  const pid_t owner = ::fork();
  if (owner == 0) {
    FileLock lock(path);
    if (lock.take() == Outcome::kTaken) ::kill(::getpid(), SIGKILL);
    ::_exit(1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(owner, &status, 0), owner);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_TRUE(scratch.has("state.toml.lock"));
  FileLock second(path);
  EXPECT_EQ(second.take(), Outcome::kTaken);
}

// A process that opens the lock file while its owner ends must not lock the unlinked file.
TEST_F(FileLockTest, NeverHasTwoOwnersHoweverManyComeAndGo) {
  constexpr int kThreads = 4;
  constexpr int kRounds = 2000;
  std::atomic<int> owners = 0;
  std::atomic<int> most = 0;
  std::atomic<int> taken = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&] {
      for (int round = 0; round < kRounds; ++round) {
        FileLock lock(path);
        if (lock.take() != Outcome::kTaken) continue;
        ++taken;
        if (++owners > 1) most = 2;
        std::this_thread::yield();
        --owners;
      }
    });
  }
  for (std::thread& thread : threads)
    thread.join();
  EXPECT_EQ(most, 0) << "two owners at once";
  EXPECT_GT(taken, 0);
}

TEST_F(FileLockTest, SaysWhereNoLockCanBeMade) {
  FileLock nowhere(scratch.path("nowhere/state.toml"));
  EXPECT_EQ(nowhere.take(), Outcome::kImpossible);
}

}  // namespace
}  // namespace vgyro::daemon
