// The form of a line in the journal and without one; and that no call waits for a reader.

#include "daemon/log.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <fcntl.h>
#include <mutex>
#include <optional>
#include <poll.h>
#include <regex>
#include <string>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "daemon/line_budget.h"

namespace vgyro::daemon {
namespace {

// Long enough that only a hang exceeds it, not a slow machine.
constexpr std::chrono::minutes kPatience{1};
constexpr int kPatience_ms = std::chrono::milliseconds(kPatience).count();

std::vector<std::string>& written() {
  static std::vector<std::string> fields;
  return fields;
}

int keep(const iovec* fields, int count) {
  written().clear();
  for (int i = 0; i < count; ++i)
    written().emplace_back(static_cast<const char*>(fields[i].iov_base), fields[i].iov_len);
  return 0;
}

int refuse(const iovec*, int) {
  return -ENOENT;
}

using Fields = std::vector<std::string>;

TEST(Log, GivesTheJournalFieldsToFilterBy) {
  Log log(&keep);
  log.tell(Severity::kWarning, {.gyro = "left", .cause = "stuck"}, "gyro {} is stuck", "left");
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(written(), (Fields{"MESSAGE=gyro left is stuck", "PRIORITY=4", "VGYRO_GYRO=left",
                               "VGYRO_CAUSE=stuck"}));
  log.tell(Severity::kNotice, {.cause = "link_up", .bus = "can0"}, "{}: up", "can0");
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(written(),
            (Fields{"MESSAGE=can0: up", "PRIORITY=5", "VGYRO_CAUSE=link_up", "VGYRO_BUS=can0"}));
  log.error("broken");
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(written(), (Fields{"MESSAGE=broken", "PRIORITY=3"}));
}

TEST(Log, WritesNothingLessSevereThanItsLevel) {
  Log log(&keep);
  const auto is_written = [&](auto say) {
    written().clear();
    say();
    EXPECT_TRUE(log.flush(kPatience));
    return !written().empty();
  };
  EXPECT_FALSE(is_written([&] { log.debug("a"); })) << "info is the default";
  EXPECT_TRUE(is_written([&] { log.info("a"); }));
  log.set_level(Severity::kWarning);
  EXPECT_FALSE(is_written([&] { log.info("a"); }));
  EXPECT_FALSE(is_written([&] { log.notice("a"); }));
  EXPECT_TRUE(is_written([&] { log.warning("a"); }));
  EXPECT_TRUE(is_written([&] { log.error("a"); }));
}

// Both changes are logged at any level; a reload in between does not end debugging.
TEST(Log, DebuggingOverridesTheLevelUntilItIsToggledAgain) {
  Log log(&keep);
  log.set_level(Severity::kError);
  log.toggle_debug();
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(written(), (Fields{"MESSAGE=debug messages begin; SIGUSR1 ends them", "PRIORITY=5"}));
  log.set_level(Severity::kError);
  log.debug("{}", 7);
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(written(), (Fields{"MESSAGE=7", "PRIORITY=7"}));
  log.toggle_debug();
  log.info("not written");
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(written(),
            (Fields{"MESSAGE=debug messages end; the configured level applies", "PRIORITY=5"}));
}

TEST(Log, FallsBackToTheStreamWhereTheJournalDoesNotAnswer) {
  Log log(&refuse);
  testing::internal::CaptureStderr();
  log.tell(Severity::kWarning, {.cause = "stuck"}, "gyro {} is stuck", 1);
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "<4>gyro 1 is stuck\n");
}

TEST(Log, SpeaksPlainlyToATerminal) {
  Log log;
  testing::internal::CaptureStderr();
  log.tell(Severity::kWarning, {.cause = "stuck"}, "gyro {} is stuck", 1);
  ASSERT_TRUE(log.flush(kPatience));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "vgyrod: gyro 1 is stuck\n");
}

/// Makes stderr a small pipe that nothing reads until read_all().
class UnreadStderr {
 public:
  UnreadStderr() : before_(::dup(STDERR_FILENO)) {
    std::array<int, 2> ends{};
    EXPECT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
    ::fcntl(ends[1], F_SETPIPE_SZ, 4096);
    ::dup2(ends[1], STDERR_FILENO);
    ::close(ends[1]);
    reader_ = ends[0];
  }
  UnreadStderr(const UnreadStderr&) = delete;
  UnreadStderr& operator=(const UnreadStderr&) = delete;
  ~UnreadStderr() {
    ::dup2(before_, STDERR_FILENO);
    ::close(before_);
    ::close(reader_);
  }
  /// Reads until `end` has come, or nothing more comes.
  [[nodiscard]] std::string read_until(const std::string& end) const {
    std::string text;
    std::array<char, 4096> block{};
    pollfd more{.fd = reader_, .events = POLLIN, .revents = 0};
    while (text.find(end) == std::string::npos && ::poll(&more, 1, kPatience_ms) > 0) {
      const ssize_t count = ::read(reader_, block.data(), block.size());
      if (count <= 0) break;
      text.append(block.data(), static_cast<std::size_t>(count));
    }
    return text;
  }

 private:
  int before_;
  int reader_ = -1;
};

/// Number of missing lines, by the remarks in `text`.
std::uint64_t missing_lines(const std::string& text) {
  static const std::regex remark(R"((\d+) lines of this log are missing here)");
  std::uint64_t sum = 0;
  for (std::sregex_iterator at(text.begin(), text.end(), remark), end; at != end; ++at)
    sum += std::stoull((*at)[1]);
  return sum;
}

constexpr int kTooMany = 2 * static_cast<int>(LineQueue::kLinesMost) + 100;

TEST(Log, APipeThatNobodyReadsHoldsNobodyUpAndWhatWasLostIsCounted) {
  const UnreadStderr unread;
  Log log;
  for (int i = 0; i < kTooMany; ++i)
    log.notice("line {} of a daemon that has much to say and nobody who listens", i);
  const std::uint64_t lost = log.lost();
  EXPECT_GT(lost, 0U);
  EXPECT_LT(lost, static_cast<std::uint64_t>(kTooMany));
  std::string said = unread.read_until("missing here");
  EXPECT_NE(said.find("line 0 of"), std::string::npos);
  log.notice("heard again");
  said += unread.read_until("heard again");
  EXPECT_NE(said.find("vgyrod: heard again\n"), std::string::npos);
  EXPECT_EQ(missing_lines(said), lost) << said;
  EXPECT_EQ(log.lost(), lost);
}

TEST(Log, EndsAlthoughNobodyReads) {
  const UnreadStderr unread;
  std::optional<Log> log(std::in_place);
  for (int i = 0; i < kTooMany; ++i)
    log->notice("line {} of a daemon that has much to say and nobody who listens", i);
  EXPECT_FALSE(log->flush(std::chrono::milliseconds(1)));
  log.reset();
  // The thread that was left behind owns its data. It ends here, so that it does not disturb other
  // tests.
  EXPECT_NE(unread.read_until("are missing here").find("line 0 of"), std::string::npos);
}

std::mutex& journal_door() {
  static std::mutex mutex;
  return mutex;
}

int wait_at_the_door(const iovec*, int) {
  const std::scoped_lock lock(journal_door());
  return 0;
}

TEST(Log, AJournalThatHangsHoldsNobodyUp) {
  std::unique_lock door(journal_door());
  Log log(&wait_at_the_door);
  for (int i = 0; i < kTooMany; ++i)
    log.notice("line {}", i);
  EXPECT_GE(log.lost(), 100U);
  door.unlock();
  EXPECT_TRUE(log.flush(kPatience));
}

std::atomic<int>& failures_left() {
  static std::atomic<int> count = 0;
  return count;
}

std::vector<std::string>& messages() {
  static std::vector<std::string> texts;
  return texts;
}

TEST(LineQueue, SaysBeforeTheNextLineHowManyCouldNotBeWritten) {
  failures_left() = 3;
  messages().clear();
  LineQueue lines([](const Line& line) {
    if (failures_left().fetch_sub(1) > 0) return false;
    messages().push_back(line.message);
    return true;
  });
  for (const char* text : {"one", "two", "three", "four"}) {
    lines.put({.message = text});
    ASSERT_TRUE(lines.flush(kPatience));
  }
  EXPECT_EQ(lines.lost(), 3U);
  EXPECT_EQ(messages(),
            (Fields{"3 lines of this log are missing here: nothing read the log", "four"}));
}

TEST(LineQueue, SaysWhereLinesAreMissing) {
  messages().clear();
  std::unique_lock door(journal_door());
  LineQueue lines([](const Line& line) {
    const std::scoped_lock lock(journal_door());
    messages().push_back(line.message);
    return true;
  });
  const std::size_t put = LineQueue::kLinesMost + 10;
  for (std::size_t i = 0; i < put; ++i)
    lines.put({.message = std::to_string(i)});
  const std::uint64_t lost = lines.lost();
  door.unlock();
  ASSERT_TRUE(lines.flush(kPatience));
  ASSERT_EQ(messages().size(), put - lost + 1);
  EXPECT_EQ(messages().back(),
            std::to_string(lost) + " lines of this log are missing here: nothing read the log");
  EXPECT_EQ(messages()[messages().size() - 2], std::to_string(put - lost - 1));
}

TEST(LineBudget, HoldsBackWhatIsTooMuchAndTellsOfItWithTheMinute) {
  LineBudget lines;
  int said = 0;
  for (int i = 0; i < 25; ++i)
    said += lines.take() ? 1 : 0;
  EXPECT_EQ(said, LineBudget::kLinesMost);
  for (int second = 1; second < LineBudget::kPeriodSeconds; ++second)
    EXPECT_EQ(lines.second_passed(), 0U);
  EXPECT_EQ(lines.second_passed(), 15U);
  EXPECT_TRUE(lines.take());
  EXPECT_EQ(lines.second_passed(), 0U);
}

}  // namespace
}  // namespace vgyro::daemon
