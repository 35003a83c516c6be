// What a line looks like in the journal, and without one.

#include "daemon/log.h"

#include <cerrno>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "daemon/line_budget.h"

namespace vgyro::daemon {
namespace {

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
  EXPECT_EQ(written(), (Fields{"MESSAGE=gyro left is stuck", "PRIORITY=4", "VGYRO_GYRO=left",
                               "VGYRO_CAUSE=stuck"}));
  log.tell(Severity::kNotice, {.cause = "link_up", .bus = "can0"}, "{}: up", "can0");
  EXPECT_EQ(written(),
            (Fields{"MESSAGE=can0: up", "PRIORITY=5", "VGYRO_CAUSE=link_up", "VGYRO_BUS=can0"}));
  log.error("broken");
  EXPECT_EQ(written(), (Fields{"MESSAGE=broken", "PRIORITY=3"}));
}

TEST(Log, FallsBackToTheStreamWhereTheJournalDoesNotAnswer) {
  Log log(&refuse);
  testing::internal::CaptureStderr();
  log.tell(Severity::kWarning, {.cause = "stuck"}, "gyro {} is stuck", 1);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "<4>gyro 1 is stuck\n");
}

TEST(Log, SpeaksPlainlyToATerminal) {
  Log log;
  testing::internal::CaptureStderr();
  log.tell(Severity::kWarning, {.cause = "stuck"}, "gyro {} is stuck", 1);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "vgyrod: gyro 1 is stuck\n");
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
