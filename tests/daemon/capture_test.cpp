// Recordings of the inputs: which frames they hold, when they are written, and what happens if that
// fails.

#include "daemon/capture.h"

#include <chrono>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "scratch.h"
#include "tests/gateway/rig.h"
#include "unpacked.h"

namespace vgyro::daemon {
namespace {

using gateway::rig::kIdA;
using gateway::rig::kIdB;

constexpr TimePoint kTime = time_from_ns(1'796'071'715'000'000'000);  // 2026-11-30 20:48:35
constexpr int kInterval_s = 3600;

class CaptureTest : public testing::Test {
 protected:
  void begin() {
    capture.reset();
    capture.emplace(Capture::Options{.directory = directory,
                                     .instance = "front",
                                     .ring = {.seconds = 600, .bytes = 16'000'000},
                                     .disk = {.count = 20, .bytes = 256'000'000},
                                     .interval_s = kInterval_s},
                    log);
    ASSERT_TRUE(capture->open(now));
    capture->use(plan, "0123456789abcdef");
  }
  // Both gyros send once, at the present time of day.
  void second() {
    capture->put(0, gateway::rig::rate_frame(kIdA, 1.0), now);
    capture->put(1, gateway::rig::rate_frame(kIdB, 1.0), now + std::chrono::milliseconds(3));
    now += std::chrono::seconds(1);
    capture->second_passed(status, now);
  }
  void seconds(int count) {
    for (int i = 0; i < count; ++i)
      second();
  }
  // Seconds pass quickly, with time for the threads.
  template <class Condition>
  bool until(const Condition& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (std::chrono::steady_clock::now() < end) {
      capture->second_passed(status, now);
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
  bool until_written(std::uint64_t captures) {
    return until([&] { return capture->status().written_in_all() == captures; });
  }
  Expected<std::string> asked() {
    std::optional<Expected<std::string>> answer;
    const Expected<void> begun =
        capture->ask([&](const Expected<std::string>& folder) { answer = folder; }, now);
    if (!begun) return tl::unexpected(begun.error());
    EXPECT_TRUE(until([&] { return answer.has_value(); }));
    return *answer;
  }
  [[nodiscard]] static std::string text_of(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  static std::vector<std::string> recording(const std::string& folder) {
    return lines_of(unpacked(text_of(folder + "/recording.log.xz")));
  }
  static nlohmann::json description(const std::string& folder) {
    return nlohmann::json::parse(text_of(folder + "/capture.json"));
  }
  template <class Action>
  std::string said_during(const Action& action) {
    testing::internal::CaptureStderr();
    action();
    EXPECT_TRUE(log.flush(std::chrono::minutes(1)));
    return testing::internal::GetCapturedStderr();
  }
  /// Bus and identifier of each line: "can0 101".
  static std::set<std::string> senders(const std::vector<std::string>& lines) {
    std::set<std::string> found;
    for (const std::string& line : lines)
      found.insert(line.substr(line.find(' ') + 1, line.find('#') - line.find(' ') - 1));
    return found;
  }

  Scratch scratch;
  std::string directory = scratch.path("captures");
  Log log;
  gateway::Plan plan = gateway::rig::two_gyros();
  gateway::Status status;
  TimePoint now = kTime;
  std::optional<Capture> capture;
};

// --- privacy -------------------------------------------------------------------------------------

TEST_F(CaptureTest, NoFrameButThoseOfTheInputsIsEverWritten) {
  begin();
  for (std::uint32_t id = 0; id <= can::kStandardIdMax; ++id) {
    for (const auto bus : {can::BusIndex{0}, can::BusIndex{1}}) {
      capture->put(bus, gateway::rig::frame_of(id, {1, 2, 3}), now);
      capture->put(bus, gateway::rig::frame_of(id, {1, 2, 3}, can::kExtended), now);
      capture->put(bus, gateway::rig::frame_of(id, {1, 2, 3}, can::kRemote), now);
      capture->put(bus, gateway::rig::frame_of(id, {1, 2, 3}, can::kError), now);
    }
  }
  const std::vector<std::string> lines = recording(asked().value());
  EXPECT_EQ(senders(lines), (std::set<std::string>{"can0 101", "can1 102"}));
  EXPECT_EQ(lines.size(), 2U);
}

// The kernel's filter passes the whole parameter group; the input is one of two messages in it.
TEST_F(CaptureTest, OfAGroupOnlyTheMessageThatIsAnInputIsWritten) {
  constexpr std::uint32_t kOfAnySource = 0x03FFFF00;
  plan.gyros[0].match = {
      .bus = 0, .id = 0x0CF02A00, .mask = kOfAnySource, .extended = true, .others = {0x0CF02AE2}};
  begin();
  for (const std::uint32_t id : {0x0CF02A31U, 0x0CF02AE2U, 0x0CF02B31U})
    capture->put(0, gateway::rig::frame_of(id, {1}, can::kExtended), now);
  const std::string folder = asked().value();
  EXPECT_EQ(senders(recording(folder)), std::set<std::string>{"can0 0CF02A31"});
  EXPECT_EQ(description(folder)["inputs"],
            nlohmann::json::array({"can0 0CF02A00 mask 03FFFF00", "can1 102"}));
}

TEST_F(CaptureTest, AReloadKeepsWhatIsHeldWhereAllInputsStay) {
  begin();
  seconds(2);
  gateway::Plan more = gateway::rig::with_reference();
  std::swap(more.buses[0], more.buses[1]);  // another number for the same bus
  for (gateway::GyroPlan& gyro : more.gyros)
    gyro.match.bus = gyro.match.bus == 0 ? 1 : 0;
  more.reference->match.bus = 1;
  plan = more;
  capture->use(plan, "another");
  capture->put(1, gateway::rig::rate_frame(gateway::rig::kIdReference, 1.0), now);
  const std::string folder = asked().value();
  EXPECT_EQ(senders(recording(folder)),
            (std::set<std::string>{"can0 101", "can1 102", "can0 103"}));
  EXPECT_EQ(description(folder)["fingerprint"], "another");
  EXPECT_EQ(description(folder)["earlier_fingerprints"],
            nlohmann::json::array({"0123456789abcdef"}));
}

TEST_F(CaptureTest, AReloadForgetsWhatIsHeldWhereAnInputIsGone) {
  plan = gateway::rig::with_reference();
  begin();
  capture->put(0, gateway::rig::rate_frame(gateway::rig::kIdReference, 1.0), now);
  seconds(2);
  plan = gateway::rig::two_gyros();
  const std::string said = said_during([&] { capture->use(plan, "another"); });
  EXPECT_NE(said.find("begins anew"), std::string::npos) << said;
  second();
  const std::string folder = asked().value();
  EXPECT_EQ(recording(folder).size(), 2U);
  EXPECT_EQ(senders(recording(folder)), (std::set<std::string>{"can0 101", "can1 102"}));
}

// --- causes --------------------------------------------------------------------------------------

TEST_F(CaptureTest, AContradictionIsWrittenWithWhatCameBeforeAndAfter) {
  begin();
  constexpr int kBefore_s = 30;
  seconds(kBefore_s);
  status.contradictions = 1;
  status.pair.contradiction = fusion::Contradiction::kSign;
  status.pair.slope = -1.0;
  const TimePoint begun = now + std::chrono::seconds(1);
  seconds(Capture::kAftermathSeconds);
  EXPECT_EQ(capture->status().written_in_all(), 0U) << "before its aftermath";
  const std::string said = said_during([&] { ASSERT_TRUE(until_written(1)); });
  const std::string folder = capture->status().last;
  EXPECT_EQ(folder, directory + "/20261130T204906Z-contradicted");
  EXPECT_EQ(to_ns(begun) / 1'000'000'000, to_ns(kTime) / 1'000'000'000 + kBefore_s + 1);
  EXPECT_EQ(recording(folder).size(), 2U * (kBefore_s + Capture::kAftermathSeconds));
  EXPECT_EQ(description(folder)["text"], "b moves -1.00 times a: sign = -1?");
  EXPECT_EQ(description(folder)["instance"], "front");
  EXPECT_NE(said.find(folder + ": capture of 80 input frames; cause: b moves"), std::string::npos)
      << said;
}

TEST_F(CaptureTest, CausesThatComeTogetherAreOneCapture) {
  begin();
  seconds(5);
  status.disagreements = 1;
  second();
  status.contradictions = 1;
  status.pair.contradiction = fusion::Contradiction::kUnrelated;
  seconds(Capture::kAftermathSeconds);
  ASSERT_TRUE(until_written(1));
  const std::string folder = capture->status().last;
  EXPECT_TRUE(folder.ends_with("-disagree")) << folder;
  EXPECT_EQ(description(folder)["also"].size(), 1U);
  EXPECT_EQ(capture->status().written[static_cast<std::size_t>(CaptureCause::kDisagree)], 1U);
}

TEST_F(CaptureTest, AFaultThatComesAndGoesDoesNotWearTheDiskOut) {
  begin();
  ++status.contradictions;
  seconds(Capture::kAftermathSeconds + 1);
  ASSERT_TRUE(until_written(1));
  for (int i = 1; i < 50; ++i) {
    ++status.contradictions;
    seconds(3);
  }
  EXPECT_EQ(capture->status().written_in_all(), 1U);
  EXPECT_EQ(capture->status().held_back, 49U);
  status.disagreements = 1;
  seconds(Capture::kAftermathSeconds + 1);
  ASSERT_TRUE(until_written(2)) << "another cause waits for nothing";
  seconds(kInterval_s);
  ++status.contradictions;
  seconds(Capture::kAftermathSeconds + 1);
  ASSERT_TRUE(until_written(3));
}

TEST_F(CaptureTest, NorDoesAGatewayThatIsRestartedAgainAndAgain) {
  begin();
  status.contradictions = 1;
  seconds(Capture::kAftermathSeconds + 1);
  ASSERT_TRUE(until_written(1));
  now += std::chrono::seconds(kInterval_s / 2);
  begin();
  seconds(Capture::kAftermathSeconds + 1);
  EXPECT_EQ(capture->status().held_back, 1U);
  now += std::chrono::seconds(kInterval_s);
  begin();
  seconds(Capture::kAftermathSeconds + 1);
  ASSERT_TRUE(until_written(1));
  now -= std::chrono::hours(1000);  // captures in the future do not count
  begin();
  seconds(Capture::kAftermathSeconds + 1);
  ASSERT_TRUE(until_written(1));
}

TEST_F(CaptureTest, OfTwoThatShareFramesTheLaterSaysSo) {
  begin();
  seconds(3);
  const std::string first = asked().value();
  EXPECT_TRUE(description(first)["overlaps"].is_null());
  seconds(3);
  const std::string second = asked().value();
  EXPECT_EQ(directory + '/' + description(second)["overlaps"].get<std::string>(), first);
}

TEST_F(CaptureTest, WhatACauseHasBegunIsWrittenAtTheEnd) {
  begin();
  seconds(5);
  status.contradictions = 1;
  second();
  capture->finish();
  EXPECT_EQ(capture->status().written_in_all(), 1U);
  EXPECT_EQ(recording(capture->status().last).size(), 12U);
}

// --- asked ---------------------------------------------------------------------------------------

TEST_F(CaptureTest, WhoAsksGetsWhatCameSoFar) {
  begin();
  seconds(7);
  const std::string folder = asked().value();
  EXPECT_EQ(recording(folder).size(), 14U);
  EXPECT_EQ(description(folder)["cause"], "asked");
  EXPECT_EQ(capture->status().last, folder);
}

TEST_F(CaptureTest, OneRequestAtATime) {
  begin();
  seconds(3);
  int answers = 0;
  const auto count = [&](const Expected<std::string>& folder) {
    EXPECT_TRUE(folder);
    ++answers;
  };
  ASSERT_TRUE(capture->ask(count, now));
  const Expected<void> second_one = capture->ask(count, now);
  ASSERT_FALSE(second_one);
  EXPECT_NE(second_one.error().message().find("ask again"), std::string::npos);
  ASSERT_TRUE(until([&] { return answers == 1; }));
  EXPECT_TRUE(asked());
}

TEST_F(CaptureTest, WhereNothingCameThereIsNothingToWrite) {
  begin();
  const Expected<std::string> folder = asked();
  ASSERT_FALSE(folder);
  EXPECT_NE(folder.error().message().find("no frame of an input came,"), std::string::npos);
  EXPECT_EQ(capture->status().failed, 0U);
}

// --- trouble -------------------------------------------------------------------------------------

TEST_F(CaptureTest, ADirectoryThatCannotBeWrittenIsToldOnceCountedAndNeverFatal) {
  scratch.put("file", "in the way");
  directory = scratch.path("file/captures");
  const std::string said = said_during([&] {
    begin();
    seconds(3);
    EXPECT_FALSE(asked());
    EXPECT_FALSE(asked());
    status.contradictions = 1;
    seconds(Capture::kAftermathSeconds + 1);
    ASSERT_TRUE(until([&] { return capture->status().failed == 3; }));
  });
  EXPECT_EQ(lines_of(said).size(), 1U) << said;
  EXPECT_NE(said.find("free space on its disk, or give the gateway a directory"),
            std::string::npos);
  std::filesystem::remove(scratch.path("file"));
  std::filesystem::create_directory(scratch.path("file"));
  EXPECT_TRUE(asked()) << "the next one finds it";
}

TEST_F(CaptureTest, ACauseWithoutFramesIsToldAsAFailure) {
  begin();
  status.contradictions = 1;
  const std::string said =
      said_during([&] { ASSERT_TRUE(until([&] { return capture->status().failed == 1; })); });
  EXPECT_NE(said.find("there is nothing to write"), std::string::npos) << said;
}

TEST_F(CaptureTest, AnotherGatewaysDirectoryIsRefused) {
  begin();
  Capture second({.directory = directory,
                  .instance = {},
                  .ring = {.seconds = 600, .bytes = 1000},
                  .disk = {.count = 1, .bytes = 1000},
                  .interval_s = 1},
                 log);
  const Expected<void> opened = second.open(now);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message().find("directory of its own"), std::string::npos);
}

}  // namespace
}  // namespace vgyro::daemon
