// The loop's side of a reload: it never waits, and every load ends with a result.

#include "daemon/plan_loader.h"

#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <new>
#include <poll.h>
#include <stdexcept>
#include <string>
#include <sys/stat.h>

#include <gtest/gtest.h>

#include "scratch.h"

namespace vgyro::daemon {
namespace {

/// A disk that answers no read before give().
class SlowDisk {
 public:
  void give() {
    const std::scoped_lock lock(mutex_);
    ++given_;
    changed_.notify_all();
  }
  LoadResult read() {
    std::unique_lock lock(mutex_);
    ++begun_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return begun_ <= given_; });
    LoadedConfig loaded;
    loaded.plan.calibration.rest_s = begun_;
    return loaded;
  }
  void wait_until_begun(int loads) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return begun_ >= loads; });
  }
  int begun() {
    const std::scoped_lock lock(mutex_);
    return begun_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int given_ = 0;
  int begun_ = 0;
};

bool is_ready(const PlanLoader& loader, int wait_ms) {
  pollfd event{.fd = loader.fd(), .events = POLLIN, .revents = 0};
  return ::poll(&event, 1, wait_ms) == 1;
}

// Long enough that only a hang exceeds it, not a slow machine.
constexpr int kPatience_ms = 60'000;

LoadResult result_of(PlanLoader& loader) {
  EXPECT_TRUE(is_ready(loader, kPatience_ms));
  std::optional<LoadResult> result = loader.take();
  if (result) return std::move(*result);
  return tl::unexpected(std::vector<Error>{{{}, "there was no result", {}}});
}

TEST(PlanLoader, TheLoopTurnsWhileADiskGivesNothing) {
  auto disk = std::make_shared<SlowDisk>();
  PlanLoader loader([disk] { return disk->read(); });
  ASSERT_TRUE(loader.open());
  loader.ask();
  disk->wait_until_begun(1);
  for (int turn = 0; turn < 1000; ++turn) {
    ASSERT_FALSE(is_ready(loader, 0));
    ASSERT_FALSE(loader.take());
    ASSERT_TRUE(loader.is_busy());
  }
  disk->give();
  const LoadResult result = result_of(loader);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->plan.calibration.rest_s, 1.0);
  EXPECT_FALSE(loader.is_busy());
  EXPECT_FALSE(is_ready(loader, 0));
}

TEST(PlanLoader, WishesDuringALoadMakeOneFurtherLoad) {
  auto disk = std::make_shared<SlowDisk>();
  PlanLoader loader([disk] { return disk->read(); });
  ASSERT_TRUE(loader.open());
  for (int i = 0; i < 10; ++i)
    loader.ask();
  disk->wait_until_begun(1);
  disk->give();
  disk->give();
  EXPECT_EQ(result_of(loader)->plan.calibration.rest_s, 1.0);
  EXPECT_TRUE(loader.is_busy());
  EXPECT_EQ(result_of(loader)->plan.calibration.rest_s, 2.0);
  EXPECT_FALSE(loader.is_busy());
  EXPECT_EQ(disk->begun(), 2);
}

TEST(PlanLoader, MemoryThatRunsShortIsARefusal) {
  PlanLoader loader([]() -> LoadResult { throw std::bad_alloc(); });
  ASSERT_TRUE(loader.open());
  loader.ask();
  const LoadResult result = result_of(loader);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().front().message().find("not enough memory"), std::string::npos);
}

TEST(PlanLoader, WhateverIsThrownIsARefusal) {
  PlanLoader loader([]() -> LoadResult { throw std::runtime_error("the parser gave up"); });
  ASSERT_TRUE(loader.open());
  loader.ask();
  EXPECT_EQ(result_of(loader).error().front().message(), "the parser gave up");
}

// The thread owns its data: the disk outlives the loader, and the sanitizers check that.
TEST(PlanLoader, EndsAlthoughADiskNeverAnswers) {
  auto disk = std::make_shared<SlowDisk>();
  {
    PlanLoader loader([disk] { return disk->read(); });
    ASSERT_TRUE(loader.open());
    loader.ask();
    disk->wait_until_begun(1);
  }
  disk->give();
}

TEST(PlanLoader, APipeInsteadOfADbcFileIsRefused) {
  Scratch scratch;
  ASSERT_EQ(::mkfifo(scratch.path("a.dbc").c_str(), 0600), 0);
  std::string text;
  for (const char* name : {"left", "right"}) {
    text += std::string("[[gyro]]\nname = \"") + name +
            "\"\nbus = \"can0\"\ndbc = \"a.dbc\"\nmessage = \"GYRO\"\nrate = \"Rate\"\n";
  }
  scratch.put("vgyro.toml", text + "[output]\nbus = \"can0\"\n");
  PlanLoader loader([path = scratch.path("vgyro.toml")] { return load_with_fingerprint(path); });
  ASSERT_TRUE(loader.open());
  loader.ask();
  const LoadResult result = result_of(loader);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().front().message().find("a.dbc: is a pipe"), std::string::npos)
      << result.error().front().message();
}

/// Two gyros, each with 16 bits from bit 0 on.
void put_configuration(const Scratch& scratch) {
  std::string dbc = "VERSION \"\"\nBU_: A\n";
  std::string text = "[output]\nbus = \"can0\"\n[calibration]\nrest_s = 5\n";
  for (const std::string name : {"LEFT", "RIGHT"}) {
    dbc += std::string("BO_ ") + (name == "LEFT" ? "257" : "258") + " " + name +
           ": 8 A\n SG_ Rate : 0|16@1- (0.01,0) [-300|300] \"deg/s\" A\n";
    text += "[[gyro]]\nname = \"" + name + "\"\nbus = \"can0\"\ndbc = \"a.dbc\"\nmessage = \"" +
            name + "\"\nrate = \"Rate\"\n";
  }
  scratch.put("a.dbc", dbc);
  scratch.put("vgyro.toml", text);
}

TEST(PlanLoader, TheConfigurationSetsTheLevelOfTheLog) {
  Scratch scratch;
  put_configuration(scratch);
  const auto loaded = [&](const std::string& log) {
    std::filesystem::create_directory(scratch.path("vgyro.d"));
    scratch.put("vgyro.d/log.toml", log);
    return gateway::load_config(scratch.path("vgyro.toml"));
  };
  EXPECT_EQ(loaded("")->log_level, gateway::LogLevel::kInfo);
  EXPECT_EQ(loaded("[log]\nlevel = \"warning\"\n")->log_level, gateway::LogLevel::kWarning);
  EXPECT_EQ(loaded("[log]\nlevel = \"debug\"\n")->log_level, gateway::LogLevel::kDebug);
  const gateway::ConfigResult wrong = loaded("[log]\nlevel = \"warn\"\n");
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().front().where, at_line(scratch.path("vgyro.d/log.toml"), 2));
  EXPECT_EQ(wrong.error().front().what, "there is no level \"warn\"");
}

// Each load reads the folder of overlays again: one is added, broken and removed.
TEST(PlanLoader, AReloadTakesWhatLiesOverTheConfiguration) {
  Scratch scratch;
  put_configuration(scratch);
  PlanLoader loader([path = scratch.path("vgyro.toml")] { return load_with_fingerprint(path); });
  ASSERT_TRUE(loader.open());
  const auto reloaded = [&] {
    loader.ask();
    return result_of(loader);
  };
  const LoadResult alone = reloaded();
  ASSERT_TRUE(alone) << alone.error().front().message();
  EXPECT_EQ(alone->plan.calibration.rest_s, 5.0);

  std::filesystem::create_directory(scratch.path("vgyro.d"));
  scratch.put("vgyro.d/10-fleet.toml", "[calibration]\nrest_s = 6\n");
  scratch.put("vgyro.d/20-car.toml", "[calibration]\nrest_s = 7\n[output]\ntransmit = false\n");
  const LoadResult overlaid = reloaded();
  ASSERT_TRUE(overlaid) << overlaid.error().front().message();
  EXPECT_EQ(overlaid->plan.calibration.rest_s, 7.0);
  EXPECT_FALSE(overlaid->plan.output.transmit);
  EXPECT_NE(overlaid->fingerprint, alone->fingerprint);

  scratch.put("vgyro.d/20-car.toml", "[calibration]\nresst_s = 7\n");
  const LoadResult broken = reloaded();
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().front().where, at_line(scratch.path("vgyro.d/20-car.toml"), 2));

  std::filesystem::remove_all(scratch.path("vgyro.d"));
  const LoadResult again = reloaded();
  ASSERT_TRUE(again) << again.error().front().message();
  EXPECT_EQ(again->plan.calibration.rest_s, 5.0);
  EXPECT_TRUE(again->plan.output.transmit);
  EXPECT_EQ(again->fingerprint, alone->fingerprint);
}

}  // namespace
}  // namespace vgyro::daemon
