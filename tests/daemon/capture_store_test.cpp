// Captures on the disk: whole or absent, however the writing ends, and within limits.

#include "daemon/capture_store.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <random>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "scratch.h"
#include "unpacked.h"
#include "watched_calls.h"

namespace vgyro::daemon {
namespace {

constexpr CaptureLimits kWide{.count = 1000, .bytes = 1'000'000'000};
// 2026-11-30 20:48:35
constexpr TimePoint kTime = time_from_ns(1'796'071'715'000'000'000);
constexpr const char* kName = "20261130T204835Z-contradicted";

/// `frames` numbered frames from `from` on.
std::shared_ptr<const PackedBlock> block_of(std::uint32_t from, std::uint32_t frames,
                                            const std::string& fingerprint = "now") {
  std::vector<CapturedFrame> captured;
  for (std::uint32_t i = from; i < from + frames; ++i)
    captured.push_back({numbered_stamp(i), 0, numbered_frame(i)});
  auto source = std::make_shared<CaptureSource>(CaptureSource{{"can0"}, fingerprint});
  return std::make_shared<PackedBlock>(*pack(captured, std::move(source)));
}

CaptureNote note_at(TimePoint time, CaptureCause cause = CaptureCause::kContradicted) {
  return {.cause = cause,
          .text = "b moves -1.00 times a",
          .also = {"the gyros disagree"},
          .at = time,
          .instance = "front",
          .fingerprint = "now",
          .inputs = {"can0 101", "can1 102"},
          .overlaps = {}};
}

class CaptureStoreTest : public testing::Test {
 protected:
  ~CaptureStoreTest() override { calls = {}; }
  static void open(CaptureStore& store) {
    bool other = false;
    ASSERT_TRUE(store.open(other));
  }
  static nlohmann::json description(const std::string& folder) {
    return nlohmann::json::parse(text_of(folder + "/capture.json"));
  }
  static std::string text_of(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  static std::string recording(const std::string& folder) {
    return unpacked(text_of(folder + "/recording.log.xz"));
  }
  [[nodiscard]] std::vector<std::string> everything() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(scratch.path("captures")))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }

  Scratch scratch;
  const CaptureRing::Blocks two_blocks{block_of(0, 100, "before"), block_of(100, 50)};
};

TEST_F(CaptureStoreTest, WritesTheRecordingAndWhatThereIsToSayOfIt) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  const Expected<std::string> written = store.write(note_at(kTime), two_blocks);
  ASSERT_TRUE(written) << written.error().message();
  EXPECT_EQ(*written, scratch.path("captures") + '/' + kName);
  std::string expected;
  for (std::uint32_t i = 0; i < 150; ++i)
    expected += numbered_line(i, "can0") + '\n';
  EXPECT_EQ(recording(*written), expected);
  const nlohmann::json said = description(*written);
  EXPECT_EQ(said["format"], 1);
  EXPECT_EQ(said["cause"], "contradicted");
  EXPECT_EQ(said["text"], "b moves -1.00 times a");
  EXPECT_EQ(said["also"], nlohmann::json::array({"the gyros disagree"}));
  EXPECT_EQ(said["time"], "20261130T204835Z");
  EXPECT_EQ(said["instance"], "front");
  EXPECT_EQ(said["fingerprint"], "now");
  EXPECT_EQ(said["earlier_fingerprints"], nlohmann::json::array({"before"}));
  EXPECT_EQ(said["inputs"].size(), 2U);
  EXPECT_EQ(said["frames"], 150);
  EXPECT_EQ(said["frames_dropped"], 0);
  EXPECT_EQ(said["first_stamp_s"], 1'700'000'000.0);
  EXPECT_EQ(said["last_stamp_s"], 1'700'000'000.149);
  EXPECT_TRUE(said["overlaps"].is_null());
  EXPECT_FALSE(said["host"].get<std::string>().empty());
}

TEST_F(CaptureStoreTest, OthersCannotReadIt) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  const std::string written = store.write(note_at(kTime), two_blocks).value();
  for (const std::string& path :
       {scratch.path("captures"), written, written + "/recording.log.xz"}) {
    struct stat about {};
    ASSERT_EQ(::stat(path.c_str(), &about), 0);
    EXPECT_EQ(about.st_mode & 0027U, 0U) << path;
  }
}

TEST_F(CaptureStoreTest, FramesMissingAreThoseWithinTheRecording) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  CaptureRing::Blocks blocks = two_blocks;
  for (auto& block : blocks) {
    auto copy = std::make_shared<PackedBlock>(*block);
    copy->dropped_before = 7;
    block = copy;
  }
  EXPECT_EQ(description(store.write(note_at(kTime), blocks).value())["frames_dropped"], 7);
}

TEST_F(CaptureStoreTest, OddTextMakesNoOddDescription) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  CaptureNote note = note_at(kTime);
  note.text = "\"\x1b[2J\xff\n";
  const nlohmann::json said = description(store.write(note, two_blocks).value());
  EXPECT_EQ(said["text"], "\"\x1b[2J\xEF\xBF\xBD\n");
}

// Against a loss of power: bytes are synced before the name, and the name before success is
// reported.
TEST_F(CaptureStoreTest, BytesAreOnTheDiskBeforeTheName) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  calls.watching = true;
  ASSERT_TRUE(store.write(note_at(kTime), two_blocks));
  calls.watching = false;
  EXPECT_EQ(calls.names,
            (std::vector<std::string>{"write", "write", "fsync file", "write", "fsync file",
                                      "fsync directory", "rename", "fsync directory"}));
}

TEST_F(CaptureStoreTest, AnyFailureLeavesNothingAndSaysWhatToDo) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  ASSERT_TRUE(store.write(note_at(kTime), two_blocks));
  const std::vector<std::string> before = everything();
  for (const char* failing : {"write", "fsync file", "fsync directory", "rename"}) {
    SCOPED_TRACE(failing);
    calls = {.watching = true, .names = {}, .failing = failing, .failure = ENOSPC};
    const Expected<std::string> written =
        store.write(note_at(kTime + std::chrono::hours(1)), two_blocks);
    calls = {};
    ASSERT_FALSE(written);
    EXPECT_NE(written.error().message().find("No space left"), std::string::npos);
    EXPECT_NE(written.error().remedy.find("--capture"), std::string::npos);
    EXPECT_EQ(everything(), before);
  }
}

// A file size limit stands for a full disk; the watched calls do not interfere.
TEST_F(CaptureStoreTest, AFullDiskLeavesNothing) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  const CaptureRing::Blocks large{block_of(0, 4096)};
  ASSERT_GT(large[0]->xz.size(), 1000U);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit little{1000, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &little), 0);
  const Expected<std::string> written = store.write(note_at(kTime), large);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().what.find("File too large"), std::string::npos);
  EXPECT_EQ(everything(), std::vector<std::string>{"vgyrod.lock"});
}

TEST_F(CaptureStoreTest, WhereThereIsNoDirectoryItIsToldAndTriedAgain) {
  scratch.put("file", "in the way");
  CaptureStore store(scratch.path("file/captures"), kWide);
  bool other = false;
  const Expected<void> opened = store.open(other);
  ASSERT_FALSE(opened);
  EXPECT_FALSE(other);
  EXPECT_NE(opened.error().remedy.find("--capture"), std::string::npos);
  EXPECT_FALSE(store.write(note_at(kTime), two_blocks));
  std::filesystem::remove(scratch.path("file"));
  std::filesystem::create_directory(scratch.path("file"));
  EXPECT_TRUE(store.write(note_at(kTime), two_blocks));
}

TEST_F(CaptureStoreTest, ASecondGatewayDoesNotShareTheDirectory) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  CaptureStore second(scratch.path("captures"), kWide);
  bool other = false;
  const Expected<void> opened = second.open(other);
  ASSERT_FALSE(opened);
  EXPECT_TRUE(other);
  EXPECT_NE(opened.error().message().find("process " + std::to_string(::getpid())),
            std::string::npos);
}

TEST_F(CaptureStoreTest, TheOldestGoWhenThereAreTooMany) {
  CaptureStore store(scratch.path("captures"), {.count = 3, .bytes = kWide.bytes});
  open(store);
  scratch.put("captures/notes.txt", "ours");
  std::filesystem::create_directory(scratch.path("captures/20200101T000000Z-picnic"));
  for (int hour = 0; hour < 6; ++hour)
    ASSERT_TRUE(store.write(note_at(kTime + std::chrono::hours(hour)), two_blocks));
  EXPECT_EQ(everything(), (std::vector<std::string>{
                              "20200101T000000Z-picnic", "20261130T234835Z-contradicted",
                              "20261201T004835Z-contradicted", "20261201T014835Z-contradicted",
                              "notes.txt", "vgyrod.lock"}));
}

TEST_F(CaptureStoreTest, TheOldestGoWhenTheyAreTooLarge) {
  CaptureStore probe(scratch.path("probe"), kWide);
  open(probe);
  const std::string one = probe.write(note_at(kTime), two_blocks).value();
  const std::uint64_t bytes = std::filesystem::file_size(one + "/recording.log.xz") +
                              std::filesystem::file_size(one + "/capture.json");
  CaptureStore store(scratch.path("captures"), {.count = 1000, .bytes = 4 * bytes});
  open(store);
  for (int hour = 0; hour < 8; ++hour) {
    ASSERT_TRUE(store.write(note_at(kTime + std::chrono::hours(hour)), two_blocks));
    std::uint64_t sum = 0;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(scratch.path("captures"))) {
      if (entry.path().extension() != ".lock" && entry.is_regular_file()) sum += entry.file_size();
    }
    EXPECT_LE(sum, 4 * bytes + bytes / 2) << "the description's share is not known before";
  }
  EXPECT_GE(store.names().size(), 3U);
  EXPECT_EQ(store.names().back(), "20261201T034835Z-contradicted");
  CaptureStore tiny(scratch.path("tiny"), {.count = 10, .bytes = 10});
  open(tiny);
  const Expected<std::string> written = tiny.write(note_at(kTime), two_blocks);
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().remedy.find("--capture-disk"), std::string::npos);
}

TEST_F(CaptureStoreTest, TwoInTheSameSecondHaveNamesOfTheirOwn) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(store.write(note_at(kTime), two_blocks));
  EXPECT_EQ(store.names(), (std::vector<std::string>{kName, std::string(kName) + "-2",
                                                     std::string(kName) + "-3"}));
}

TEST_F(CaptureStoreTest, TheNewestOfEachCauseIsKnownByItsName) {
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  EXPECT_FALSE(store.newest(CaptureCause::kContradicted));
  for (const int hour : {3, 1}) {
    ASSERT_TRUE(store.write(note_at(kTime + std::chrono::hours(hour)), two_blocks));
    ASSERT_TRUE(store.write(
        note_at(kTime + std::chrono::hours(2 * hour), CaptureCause::kStopsRefused), two_blocks));
  }
  EXPECT_EQ(store.newest(CaptureCause::kContradicted), kTime + std::chrono::hours(3));
  EXPECT_EQ(store.newest(CaptureCause::kStopsRefused), kTime + std::chrono::hours(6));
  EXPECT_FALSE(store.newest(CaptureCause::kDisagree));
}

TEST_F(CaptureStoreTest, LeftoversOfAKilledWriterGoAtTheStart) {
  for (const char* name : {"captures/.new", "captures/.old"}) {
    std::filesystem::create_directories(scratch.path(name));
    scratch.put(std::string(name) + "/recording.log.xz", "half");
  }
  CaptureStore store(scratch.path("captures"), kWide);
  open(store);
  EXPECT_EQ(everything(), std::vector<std::string>{"vgyrod.lock"});
}

// --- killed at any moment ------------------------------------------------------------------------

int kills() {
  const char* wish = std::getenv("VGYRO_KILLS");
  return wish != nullptr ? std::atoi(wish) : 200;
}

[[noreturn]] void write_for_ever(const std::string& directory, const CaptureRing::Blocks& blocks,
                                 int hour, int ready_fd) {
  CaptureStore store(directory, {.count = 3, .bytes = kWide.bytes});
  bool other = false;
  if (!store.open(other)) ::_exit(1);
  for (;; ++hour) {
    if (!store.write(note_at(kTime + std::chrono::hours(hour)), blocks)) ::_exit(1);
    const char byte = 'w';
    static_cast<void>(!::write(ready_fd, &byte, 1));
  }
}

// The child writes as fast as it can, removing the oldest, and is killed at a random moment. Every
// folder with a capture's name must be whole afterwards.
TEST_F(CaptureStoreTest, KilledAtAnyMomentEachCaptureIsWhole) {
  constexpr std::uint32_t kSeed = 11;
  SCOPED_TRACE(kSeed);
  std::mt19937 rng(kSeed);
  const std::string directory = scratch.path("captures");
  const auto begin = std::chrono::steady_clock::now();
  constexpr int kTimed = 5;
  {
    CaptureStore store(directory, kWide);
    open(store);
    for (int i = 0; i < kTimed; ++i)
      ASSERT_TRUE(store.write(note_at(kTime - std::chrono::hours(1 + i)), two_blocks));
  }
  const auto write_takes = (std::chrono::steady_clock::now() - begin) / kTimed;
  std::uniform_int_distribution<std::int64_t> moment_ns(
      0, 2 * std::chrono::nanoseconds(write_takes).count());
  std::size_t leftovers = 0;
  for (int round = 0; round < kills(); ++round) {
    int pipe_fds[2];
    ASSERT_EQ(::pipe2(pipe_fds, O_CLOEXEC), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) write_for_ever(directory, two_blocks, 1000 * round, pipe_fds[1]);
    ::close(pipe_fds[1]);
    char byte = 0;
    ASSERT_EQ(::read(pipe_fds[0], &byte, 1), 1);
    std::this_thread::sleep_for(std::chrono::nanoseconds(moment_ns(rng)));
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
    ::close(pipe_fds[0]);
    const CaptureStore judge(directory, kWide);
    const std::vector<std::string> names = judge.names();
    ASSERT_GE(names.size(), 2U);
    ASSERT_LE(names.size(), 3U);
    for (const std::string& name : names) {
      const std::string folder = directory + '/' + name;
      ASSERT_EQ(lines_of(recording(folder)).size(), 150U) << name;
      ASSERT_EQ(description(folder)["frames"], 150) << name;
    }
    leftovers +=
        static_cast<std::size_t>(scratch.has("captures/.new") || scratch.has("captures/.old"));
  }
  std::printf("%d kills, %zu amid a write; a write takes %.2f ms here\n", kills(), leftovers,
              std::chrono::duration<double, std::milli>(write_takes).count());
  EXPECT_GT(leftovers, 0U) << "no kill came amid a write: this proved nothing";
  CaptureStore store(directory, kWide);
  open(store);
  for (const std::string& name : everything())
    EXPECT_TRUE(name == "vgyrod.lock" || name.starts_with("20")) << name;
}

}  // namespace
}  // namespace vgyro::daemon
