// Whole logs: nothing is lost around damage, and the result is independent of how the bytes arrive.

#include <array>
#include <random>
#include <span>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "canlog/candump.h"
#include "tests/canlog/log_text.h"

namespace vgyro::canlog {
namespace {

constexpr std::uint64_t kSeed = 20'240'602;

std::vector<std::uint32_t> ids(const ReadLog& log) {
  std::vector<std::uint32_t> found;
  for (const ReadRecord& record : log.records)
    found.push_back(record.xl.empty() ? record.frame.id : record.xl[0].priority);
  return found;
}

std::string numbered_lines(unsigned from, unsigned to) {
  std::string text;
  for (unsigned i = from; i < to; ++i)
    text += fmt::format("(1700000000.{:06}) can0 {:08X}#{:016X}\n", i, i, i);
  return text;
}

void expect_same(const ReadLog& a, const ReadLog& b) {
  EXPECT_EQ(told(a.counts), told(b.counts));
  EXPECT_EQ(a.interfaces, b.interfaces);
  EXPECT_EQ(a.error, b.error);
  ASSERT_EQ(a.records.size(), b.records.size());
  for (std::size_t i = 0; i < a.records.size(); ++i)
    ASSERT_EQ(a.records[i], b.records[i]) << "record " << i;
}

/// Makes lines as various writers write them, sometimes with one or more bytes corrupted.
class LineMaker {
 public:
  explicit LineMaker(std::uint64_t seed) : random_(seed) {}

  std::string line() {
    std::string text = good_line();
    if (below(4) == 0) text = odd_line(text);
    if (below(3) == 0) mutate(text);
    return text + '\n';
  }

 private:
  std::size_t below(std::size_t n) { return random_() % n; }

  std::string good_line() {
    stamp_ns_ += static_cast<std::int64_t>(below(2'000'000));
    if (below(50) == 0) stamp_ns_ = static_cast<std::int64_t>(below(9'000'000'000)) * 1'000'000'000;
    static const char* const kNames[] = {"can0", "can1",    "vcan0",    "slcan12", "can0x",
                                         "c",    "sevench", "eightchr", "can"};
    const char* name = kNames[below(4) == 0 ? below(std::size(kNames)) : 0];
    if (below(200) == 0) {
      std::string xl = format_xl_line(time_from_ns(stamp_ns_), name, random_xl_frame(random_), 6);
      xl.pop_back();
      return xl;
    }
    char buffer[kLineBytesMax];
    const auto direction = below(4) == 0 ? static_cast<Direction>(below(3)) : Direction::kUnknown;
    const std::size_t length = format_line(buffer, time_from_ns(stamp_ns_), name,
                                           random_frame(random_), below(8) == 0 ? 9 : 6, direction);
    return {buffer, length - 1};
  }

  std::string odd_line(const std::string& text) {
    switch (below(5)) {
      case 0:
        return "";
      case 1:
        return "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 1)";
      case 2:
        return text + "\r";
      case 3:
        return std::string(text).insert(text.find(' '), " ");
      default:
        return text.substr(0, below(text.size()));
    }
  }

  void mutate(std::string& text) {
    static constexpr std::string_view kBytes("0123456789ABCDEFabcdef#().:_ RTr\t\r-/@G`g\0\xFF\xB0",
                                             44);
    for (std::size_t edits = 1 + below(2); edits > 0 && !text.empty(); --edits) {
      const std::size_t at = below(text.size());
      const char byte = kBytes[below(kBytes.size())];
      switch (below(4)) {
        case 0:
          text.erase(at, 1);
          break;
        case 1:
          text.insert(at, 1, byte);
          break;
        case 2:
          text[at] = static_cast<char>(text[at] ^ 1 << below(8));
          if (text[at] == '\n') text[at] = ' ';
          break;
        default:
          text[at] = byte;
      }
    }
  }

  std::mt19937_64 random_;
  std::int64_t stamp_ns_ = 1'700'000'000'000'000'000;
};

// An empty log is no error here; the caller reports that it was empty.
TEST(CandumpReader, ReadsAnEmptyLog) {
  const ReadLog log = read_text("");
  EXPECT_TRUE(log.records.empty());
  EXPECT_EQ(told(log.counts),
            "0 lines, 0 frames, 0 XL, 0 other, 0 malformed, 0 cut off, 0 skipped; ");
  EXPECT_EQ(log.error, "");
}

// A damaged line affects only itself: its neighbours are read, and the error holds its number.
TEST(CandumpReader, LosesNothingAroundAMalformedLine) {
  const ReadLog log = read_text(
      "(1.000000) can0 101#11\n"
      "(1.000001) can0 102#1\n"
      "(1.000002) can0 103#11\n"
      "DROPCOUNT: dropped 7 CAN frames on 'can0' socket (total drops 7)\n"
      "\n"
      "(1.00000\n"
      "(1.000004) can0 104#11\r\n"
      "# a remark\n"
      "(1.000005) can0 45105#81:00:12345678#11\n"
      "(1.000006) can0 106#11\n");
  EXPECT_EQ(ids(log), (std::vector<std::uint32_t>{0x101, 0x103, 0x104, 0x105, 0x106}));
  EXPECT_EQ(told(log.counts),
            "10 lines, 4 frames, 1 XL, 3 other, 2 malformed, 0 cut off, 0 skipped; "
            "2: payload: an odd number of hex digits; 6: stamp: no closing parenthesis");
}

// A damaged line among thousands of usual ones, which take the fast path.
TEST(CandumpReader, LosesNothingAroundAMalformedLineInTheMiddleOfALongLog) {
  const ReadLog log = read_text(numbered_lines(0, 5000) + "(1700000000.00500 can0 123#11\n" +
                                numbered_lines(5000, 9000));
  ASSERT_EQ(log.records.size(), 9000U);
  for (std::uint32_t i = 0; i < 9000; ++i)
    ASSERT_EQ(log.records[i].frame.id, i);
  EXPECT_EQ(malformed(log.counts), std::vector<std::string>{"5001: stamp: no closing parenthesis"});
}

// A garbage file must not fill the memory with errors.
TEST(CandumpReader, KeepsTheFirstFiveMalformedLinesAndCountsAll) {
  std::string text;
  for (int i = 0; i < 100; ++i)
    text += i % 2 == 0 ? "(\n" : "(1.000000) can0 123#\n";
  const ReadLog log = read_text(text);
  EXPECT_EQ(log.counts.malformed_lines, 50U);
  EXPECT_EQ(log.counts.frames, 50U);
  const std::string why = ": stamp: the seconds are not a number";
  EXPECT_EQ(malformed(log.counts),
            (std::vector<std::string>{"1" + why, "3" + why, "5" + why, "7" + why, "9" + why}));
}

// The last line of a log that is still being written, or was cut, may lack half of its payload and
// still look like a frame.
TEST(CandumpReader, DoesNotUseACutOffLastLine) {
  const ReadLog log = read_text(numbered_lines(0, 3) + "(1700000000.000003) can0 123#1122");
  EXPECT_EQ(ids(log), (std::vector<std::uint32_t>{0, 1, 2}));
  EXPECT_EQ(told(log.counts),
            "3 lines, 3 frames, 0 XL, 0 other, 0 malformed, 1 cut off, 0 skipped; ");
  EXPECT_EQ(read_text("(1700000000.000003) can0 123#1122").counts.cut_off_lines, 1U);
}

// A line that does not fit into the buffer can be no frame; the next ones are read.
TEST(CandumpReader, CountsALineLongerThanTheBufferAndGoesOn) {
  for (const std::size_t length : {LogSource::kBufferBytes - 1, LogSource::kBufferBytes,
                                   LogSource::kBufferBytes + 1, 3 * LogSource::kBufferBytes}) {
    const std::string before = numbered_lines(0, 2);
    const ReadLog log = read_text(
        fmt::format("{}({}\n{}", before, std::string(length - 1, '1'), numbered_lines(2, 5)));
    EXPECT_EQ(ids(log), (std::vector<std::uint32_t>{0, 1, 2, 3, 4})) << length;
    EXPECT_EQ(log.counts.malformed_lines, 1U) << length;
    EXPECT_EQ(log.counts.lines, 6U) << length;
    ASSERT_EQ(log.counts.first_malformed.size(), 1U);
    EXPECT_EQ(log.counts.first_malformed[0].line, 3U) << length;
  }
}

// The same at the end of the log, where no newline follows.
TEST(CandumpReader, CountsAnOverlongLastLineOnce) {
  const ReadLog log = read_text(
      fmt::format("{}({}", numbered_lines(0, 2), std::string(2 * LogSource::kBufferBytes, '1')));
  EXPECT_EQ(ids(log), (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(log.counts.malformed_lines + log.counts.cut_off_lines, 1U);
}

// Interfaces are numbered in order of appearance, however long and similar their names.
TEST(CandumpReader, TellsInterfacesApart) {
  std::vector<std::string> names = {"a_long_interface", "can0",    "can", "can00", "CAN0", "vcan0",
                                    "sevenxx",          "eightxxx"};
  std::string text;
  for (int round = 0; round < 50; ++round) {
    for (const std::string& name : names)
      text += fmt::format("(1700000000.000000) {} 123#11\n", name);
  }
  const ReadLog log = read_text(text);
  EXPECT_EQ(log.interfaces, names);
  ASSERT_EQ(log.records.size(), 50 * names.size());
  for (std::size_t i = 0; i < log.records.size(); ++i)
    ASSERT_EQ(log.records[i].interface, names[i % names.size()]);
}

// The table is bounded: frames of a 65th interface are counted, those of the first 64 are still
// read.
TEST(CandumpReader, RefusesMoreThan64Interfaces) {
  std::string text;
  for (int round = 0; round < 2; ++round) {
    for (int i = 0; i < 66; ++i)
      text += fmt::format("(1700000000.000000) can{} 123#11\n", i);
  }
  const ReadLog log = read_text(text);
  EXPECT_EQ(log.interfaces.size(), 64U);
  EXPECT_EQ(log.counts.frames, 128U);
  EXPECT_EQ(log.counts.malformed_lines, 4U);
  EXPECT_EQ(malformed(log.counts)[0], "65: more than 64 different interfaces");
}

// The log's order is kept: the pipeline decides whether time may go back.
TEST(CandumpReader, PassesOnStampsThatGoBack) {
  const ReadLog log = read_text(
      "(1700000000.999999) can0 101#\n(1700000001.000000) can0 102#\n(1700000000.999998) can0 "
      "103#\n(0.000000) can0 104#\n(1700000001.000001) can0 105#\n" +
      std::string(200, '\n'));
  std::vector<std::int64_t> stamps_ns;
  for (const ReadRecord& record : log.records)
    stamps_ns.push_back(record.stamp_ns);
  EXPECT_EQ(stamps_ns,
            (std::vector<std::int64_t>{1'700'000'000'999'999'000, 1'700'000'001'000'000'000,
                                       1'700'000'000'999'998'000, 0, 1'700'000'001'000'001'000}));
}

// The result must not depend on where read() stopped.
TEST(CandumpReader, ReadsTheSameInChunksOfAnySize) {
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  LineMaker lines(kSeed);
  std::string text;
  for (int i = 0; i < 2000; ++i)
    text += lines.line();
  text += "(1700000000.000000) can0 123#11";
  const ReadLog whole = read_text(text);
  EXPECT_GT(whole.counts.frames, 1000U);
  EXPECT_GT(whole.counts.malformed_lines, 100U);
  EXPECT_GT(whole.counts.xl_frames, 1U);
  EXPECT_EQ(whole.counts.cut_off_lines, 1U);
  for (const std::size_t chunk : {1U, 2U, 3U, 7U, 64U, 95U, 97U, 1000U, 4096U, 65'537U}) {
    SCOPED_TRACE(::testing::Message() << "chunk " << chunk);
    expect_same(read_text(text, chunk), whole);
  }
}

// However many records are requested at once, and wherever a block ends among them.
TEST(CandumpReader, HandsOutTheSameRecordsInBatches) {
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  LineMaker lines(kSeed);
  std::string text;
  for (int i = 0; i < 2000; ++i)
    text += lines.line();
  const ReadLog one_by_one = read_text(text);
  for (const std::size_t at_once : {1U, 2U, 3U, 64U, 5000U}) {
    for (const std::size_t chunk : {1U, 97U, 4096U, 1'000'000U}) {
      SCOPED_TRACE(::testing::Message() << at_once << " at once, chunk " << chunk);
      CandumpReader reader(log_from_text(text, chunk));
      std::vector<LogRecord> room(at_once);
      std::size_t read = 0;
      while (const std::size_t count = reader.next_batch(room)) {
        ASSERT_LE(count, at_once);
        for (const LogRecord& record : std::span(room).first(count)) {
          ASSERT_LT(read, one_by_one.records.size());
          const ReadRecord& expected = one_by_one.records[read++];
          ASSERT_EQ(record.is_xl, !expected.xl.empty()) << "record " << read;
          ASSERT_EQ(to_ns(record.stamp), expected.stamp_ns);
          ASSERT_EQ(reader.interfaces().name(record.bus), expected.interface);
          if (record.is_xl) continue;
          ASSERT_EQ(record.frame, expected.frame) << "record " << read;
        }
      }
      EXPECT_EQ(read, one_by_one.records.size());
      EXPECT_EQ(told(reader.counts()), told(one_by_one.counts));
    }
  }
}

// A program that follows a live log prints each line before it waits for the next: a batch holds no
// more than has arrived.
TEST(CandumpReader, NeverWaitsForTheRestOfABatch) {
  const std::string line = "(1700000000.000000) can0 123#11\n";
  CandumpReader reader(log_from_text(line + line + line, line.size()));
  std::vector<LogRecord> room(64);
  std::size_t waits = 0;
  reader.before_wait([&] { ++waits; });
  for (std::size_t arrived = 1; arrived <= 3; ++arrived) {
    EXPECT_EQ(reader.next_batch(room), 1U);
    EXPECT_EQ(waits, arrived);
  }
  EXPECT_EQ(reader.next_batch(room), 0U);
}

// The fast path judges usual lines differently from parse_line(); the two must always agree.
TEST(CandumpReader, AgreesWithParseLineOnRandomAndDamagedLines) {
  for (std::uint64_t seed = kSeed; seed < kSeed + 10; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    LineMaker lines(seed);
    std::string text;
    for (int i = 0; i < 40'000; ++i)
      text += lines.line();
    const ReadLog log = read_text(text);
    EXPECT_GT(log.counts.frames, 20'000U);
    EXPECT_GT(log.counts.malformed_lines, 1000U);
    expect_same(log, read_by_parse_line(text));
    if (HasFatalFailure()) return;
  }
}

// Every change of a single byte in a usual line, between lines from which the reader has learned
// second and interface.
TEST(CandumpReader, AgreesWithParseLineOnEveryChangeOfOneByte) {
  for (const std::string line : {"(1700000000.123456) can0 1A3#0123456789ABCDEF\n",
                                 "(1700000000.123456) can0 1ABCDEF3#0123456789abcdef\n",
                                 "(1700000000.123456) can0 123#\n"}) {
    std::string text = line;
    for (std::size_t at = 0; at + 1 < line.size(); ++at) {
      for (int byte = 0; byte < 256; ++byte) {
        if (byte == '\n') continue;
        text += line;
        text[text.size() - line.size() + at] = static_cast<char>(byte);
      }
    }
    expect_same(read_text(text), read_by_parse_line(text));
  }
}

// The fast path compares few names, and one may be the beginning of another.
TEST(CandumpReader, TellsManyInterfacesApart) {
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  constexpr std::array kNames{"c",       "can",      "can0",  "can01", "can1",
                              "vcan123", "vcan1234", "canal", "x",     "can0x"};
  std::mt19937_64 random(kSeed);
  for (int round = 0; round < 20; ++round) {
    std::string text;
    std::vector<std::string> expected;
    for (int i = 0; i < 200; ++i) {
      expected.emplace_back(kNames[random() % kNames.size()]);
      text += fmt::format("(1700000000.{:06}) {} {:03X}#11\n", i, expected.back(), i);
    }
    const ReadLog log = read_text(text);
    ASSERT_EQ(log.records.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i)
      ASSERT_EQ(log.records[i].interface, expected[i]) << "line " << i + 1;
  }
}

// Before any second was read, ten NUL bytes must not match a known second.
TEST(CandumpReader, TakesNulBytesForNoSecond) {
  // Blank lines follow, because the fast path needs bytes to look ahead.
  const ReadLog log = read_text(fmt::format("(1.5) can0 123#\n({}.123456) can0 123#11\n{}",
                                            std::string(10, '\0'), std::string(200, '\n')));
  EXPECT_EQ(log.counts.frames, 1U);
  EXPECT_EQ(log.counts.skipped_bytes, 11U);
  EXPECT_EQ(log.counts.other_lines, 1U + 200U);
  const ReadLog bare = read_text(fmt::format("(1.5) can0 123#\n{}123456) can0 123#11\n{}",
                                             std::string(12, '\0'), std::string(200, '\n')));
  EXPECT_EQ(bare.counts.frames, 1U);
}

// After a power cut, NUL bytes fill the part of the file that was not written: the frame after them
// is whole, and the skipped bytes are counted.
TEST(CandumpReader, FindsTheFrameBehindNulBytes) {
  const std::string good = "(1700000000.000001) can0 123#11\n";
  const ReadLog log = read_text(good + "(17000000" + std::string(4096, '\0') + good + good);
  EXPECT_EQ(log.records.size(), 3U);
  EXPECT_EQ(log.counts.skipped_bytes, 9U + 4096U);
  EXPECT_EQ(log.counts.malformed_lines, 0U);
}

// Some editors put a byte-order mark before a text, and joined files also have it inside.
TEST(CandumpReader, ReadsOverByteOrderMarks) {
  const std::string text = "\xEF\xBB\xBF(1.5) can0 123#11\n(2.5) can0 123#22\n";
  const ReadLog log = read_text(text + text);
  EXPECT_EQ(log.records.size(), 4U);
  EXPECT_EQ(told(log.counts),
            "4 lines, 4 frames, 0 XL, 0 other, 0 malformed, 0 cut off, 0 skipped; ");
}

}  // namespace
}  // namespace vgyro::canlog
