// Written lines read back exactly, whatever the frame's form.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "canlog/candump.h"
#include "tests/canlog/log_text.h"

namespace vgyro::canlog {
namespace {

constexpr std::uint64_t kSeed = 20'240'603;

std::string line_of(TimePoint stamp, std::string_view interface, const can::Frame& frame,
                    unsigned digits = 6, Direction direction = Direction::kUnknown) {
  char buffer[kLineBytesMax];
  return {buffer, format_line(buffer, stamp, interface, frame, digits, direction)};
}

constexpr TimePoint kStamp = time_from_ns(1'700'000'000'123'456'789);

// The text is that of can-utils, down to capitals and leading zeros, since other tools read it.
TEST(CandumpWriter, WritesWhatCandumpWrites) {
  EXPECT_EQ(line_of(kStamp, "can0", frame_with(0x12, 0, {0xDE, 0xAD, 0x0F})),
            "(1700000000.123456) can0 012#DEAD0F\n");
  EXPECT_EQ(line_of(kStamp, "vcan0", frame_with(0x12, can::kExtended, {1, 2, 3, 4, 5, 6, 7, 0xA8})),
            "(1700000000.123456) vcan0 00000012#01020304050607A8\n");
  EXPECT_EQ(line_of(kStamp, "can0", frame_with(0x80, can::kError, std::vector<std::uint8_t>(8)), 9),
            "(1700000000.123456789) can0 20000080#0000000000000000\n");
  EXPECT_EQ(line_of(kStamp, "can0", frame_with(0x123, can::kFd | can::kBitRateSwitch, {0xAA}), 6,
                    Direction::kReceived),
            "(1700000000.123456) can0 123##1AA R\n");
  can::Frame remote = frame_with(0x123, can::kRemote);
  EXPECT_EQ(line_of(kStamp, "can0", remote, 6, Direction::kTransmitted),
            "(1700000000.123456) can0 123#R T\n");
  remote.length = 8;
  remote.raw_dlc = 9;
  EXPECT_EQ(line_of(kStamp, "can0", remote), "(1700000000.123456) can0 123#R8_9\n");
}

// Stamps at the boundaries of seconds: no digit is lost or carried wrongly.
TEST(CandumpWriter, WritesStampsAtTheBoundariesOfSeconds) {
  const can::Frame frame = frame_with(0x123, 0);
  EXPECT_EQ(line_of(time_from_ns(0), "c", frame), "(0000000000.000000) c 123#\n");
  EXPECT_EQ(line_of(time_from_ns(999), "c", frame), "(0000000000.000000) c 123#\n");
  EXPECT_EQ(line_of(time_from_ns(999'999'999), "c", frame), "(0000000000.999999) c 123#\n");
  EXPECT_EQ(line_of(time_from_ns(1'000'000'000), "c", frame), "(0000000001.000000) c 123#\n");
  EXPECT_EQ(line_of(time_from_ns(999'999'999), "c", frame, 9), "(0000000000.999999999) c 123#\n");
  EXPECT_EQ(line_of(time_from_ns(9'000'000'000'000'000'001), "c", frame, 9),
            "(9000000000.000000001) c 123#\n");
  EXPECT_EQ(line_of(time_from_ns(-5), "c", frame), "(0000000000.000000) c 123#\n");
}

// Every form reads back as it was written.
TEST(CandumpWriter, WritesRandomFramesSoThatTheyReadBackTheSame) {
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  std::mt19937_64 random(kSeed);
  std::string text;
  std::vector<ReadRecord> written;
  for (int i = 0; i < 50'000; ++i) {
    ReadRecord record;
    record.fraction_digits = random() % 2 == 0 ? 6 : 9;
    record.stamp_ns = static_cast<std::int64_t>(random() % 9'000'000'000'000'000'000U);
    if (record.fraction_digits == 6) record.stamp_ns -= record.stamp_ns % 1000;
    record.interface = fmt::format("can{}", random() % 12);
    record.direction = static_cast<Direction>(random() % 3);
    const auto digits = static_cast<unsigned>(record.fraction_digits);
    if (random() % 500 == 0) {
      record.xl = {random_xl_frame(random)};
      text += format_xl_line(time_from_ns(record.stamp_ns), record.interface, record.xl[0], digits,
                             record.direction);
    } else {
      record.frame = random_frame(random);
      text += line_of(time_from_ns(record.stamp_ns), record.interface, record.frame, digits,
                      record.direction);
    }
    written.push_back(record);
  }
  const ReadLog log = read_text(text);
  EXPECT_EQ(log.counts.malformed_lines, 0U) << told(log.counts);
  ASSERT_EQ(log.records.size(), written.size());
  for (std::size_t i = 0; i < written.size(); ++i)
    ASSERT_EQ(log.records[i], written[i]) << i;
}

// LineFormatter keeps the text of the second; its lines must be the same as single ones, forwards
// and back.
TEST(CandumpWriter, WritesManyLinesAsItWritesEachAlone) {
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  std::mt19937_64 random(kSeed);
  LineFormatter formatter("can0");
  std::int64_t ns = 1'700'000'000'999'990'000;
  const std::int64_t steps_ns[] = {0,
                                   1,
                                   999,
                                   1'000,
                                   10'000,
                                   1'000'000'000,
                                   -1'000,
                                   -1'000'000'000,
                                   -999'999'999,
                                   3'600'000'000'000};
  std::vector<std::int64_t> stamps_ns = {999'999'999, 1'000'000'000, 999'999'999, 0, -5};
  for (int i = 0; i < 20'000; ++i)
    stamps_ns.push_back(ns += steps_ns[random() % std::size(steps_ns)]);
  for (const std::int64_t stamp_ns : stamps_ns) {
    const can::Frame frame = random_frame(random);
    const unsigned digits = random() % 2 == 0 ? 6 : 9;
    char buffer[kLineBytesMax];
    const std::size_t length = formatter.format(buffer, time_from_ns(stamp_ns), frame, digits);
    ASSERT_EQ(std::string(buffer, length), line_of(time_from_ns(stamp_ns), "can0", frame, digits));
  }
}

// The longest possible line fits into the documented buffer.
TEST(CandumpWriter, FitsTheLongestLineIntoItsBuffer) {
  const std::string name(40, 'n');
  const can::Frame frame =
      frame_with(can::kExtendedIdMax, can::kExtended | can::kFd | can::kBitRateSwitch,
                 std::vector<std::uint8_t>(64, 0xFF));
  std::vector<char> buffer(kLineBytesMax);
  const std::size_t length = format_line(buffer.data(), time_from_ns(8'999'999'999'999'999'999),
                                         name, frame, 9, Direction::kTransmitted);
  EXPECT_LE(length, kLineBytesMax);
  const ReadLog log = read_text(std::string(buffer.data(), std::min(length, kLineBytesMax)));
  ASSERT_EQ(log.records.size(), 1U) << told(log.counts);
  EXPECT_EQ(log.records[0].interface, std::string(31, 'n')) << "a name is cut where reading ends";
  EXPECT_EQ(log.records[0].frame, frame);
}

// A frame with a wrong length, as from a bug elsewhere, must write no bytes beyond its data.
TEST(CandumpWriter, WritesNoMoreThanAFrameHolds) {
  can::Frame frame = frame_with(0x123, 0);
  frame.length = 200;
  EXPECT_EQ(line_of(kStamp, "can0", frame), "(1700000000.123456) can0 123#0000000000000000\n");
  frame.flags = can::kFd;
  EXPECT_EQ(line_of(kStamp, "can0", frame),
            "(1700000000.123456) can0 123##0" + std::string(128, '0') + "\n");
}

}  // namespace
}  // namespace vgyro::canlog
