#include "canlog/merged_reader.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/canlog/opened_log.h"

namespace vgyro::canlog {
namespace {

using Lines = std::vector<std::string>;

Expected<std::unique_ptr<LogReader>> merge(const Lines& texts, std::size_t chunk = SIZE_MAX) {
  std::vector<MergedReader::Part> parts;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    auto reader = open_log(bytes_from_text(texts[i], chunk));
    EXPECT_TRUE(reader) << reader.error().message();
    parts.push_back({fmt::format("{}.log", i), std::move(*reader)});
  }
  return MergedReader::make(std::move(parts));
}

Lines merged(const Lines& texts) {
  auto reader = merge(texts);
  if (!reader) return {reader.error().message()};
  const ReadLog log = read_whole(**reader);
  Lines lines = as_candump(log);
  if (!log.error.empty()) lines.push_back(log.error);
  return lines;
}

std::string line(double t_s, const char* rest) {
  return fmt::format("({:017.6f}) {}\n", t_s, rest);
}

TEST(MergedReader, GoesByStampsAndThenByTheOrderOfTheArguments) {
  EXPECT_EQ(merged({line(1, "can0 001#") + line(3, "can0 002#") + line(3, "can0 003#"),
                    line(2, "can1 004#") + line(3, "can1 005#") + line(9, "can1 006#"), "",
                    line(0, "can0 007#")}),
            (Lines{"(0000000000.000000) can0 007#", "(0000000001.000000) can0 001#",
                   "(0000000002.000000) can1 004#", "(0000000003.000000) can0 002#",
                   "(0000000003.000000) can0 003#", "(0000000003.000000) can1 005#",
                   "(0000000009.000000) can1 006#"}));
}

// Logs may differ in their forms and in the names of their buses.
TEST(MergedReader, MergesLogsOfAnyForm) {
  EXPECT_EQ(merged({"(0000000001.000000) can1 001#\n(0000000003.000000) can0 002#\n",
                    "0.500000 1 003 Rx d 0\n2.500000 2 004 Rx d 0\n"}),
            (Lines{"(0000000000.500000) can0 003# R", "(0000000001.000000) can1 001#",
                   "(0000000002.500000) can1 004# R", "(0000000003.000000) can0 002#"}));
}

// A wrong stamp, or a clock that was set back, delays no log; the order within a log is kept.
TEST(MergedReader, ReordersNothingWithinALog) {
  EXPECT_EQ(merged({line(1, "can0 001#") + line(8e9, "can0 002#") + line(3, "can0 003#") +
                        line(2, "can0 004#"),
                    line(1.5, "can1 005#") + line(3.5, "can1 006#")}),
            (Lines{"(0000000001.000000) can0 001#", "(0000000001.500000) can1 005#",
                   "(8000000000.000000) can0 002#", "(0000000003.000000) can0 003#",
                   "(0000000002.000000) can0 004#", "(0000000003.500000) can1 006#"}));
}

// One of the logs counts from its own beginning.
TEST(MergedReader, RefusesStampsOfTwoClocks) {
  EXPECT_EQ(
      merged({line(1'700'000'000, "can0 001#"), line(0.5, "can1 002#")}),
      Lines{"1.log: its stamps count from its own beginning (0.500 s), those of 0.log from the "
            "epoch (1700000000.000 s): which frames were simultaneous is unknown; logs with "
            "stamps of one clock are needed"});
}

TEST(MergedReader, RefusesLogsThatAreYearsApart) {
  constexpr double kDay = 86'400;
  EXPECT_EQ(merged({line(1.6e9, "can0 001#"), line(1.6e9 + 400 * kDay, "can0 002#")}),
            (Lines{"(1600000000.000000) can0 001#",
                   "1.log: begins 400 days after all that came before it has ended: these are not "
                   "logs of one drive; give each drive a run of its own"}));
  EXPECT_EQ(merged({line(1.6e9, "can0 001#"), line(1.6e9 + 100 * kDay, "can0 002#")}).size(), 2U);
}

// The records before the damage of one log are returned, then its error.
TEST(MergedReader, EndsWhereOneLogIsDamaged) {
  class Damaged final : public ByteSource {
   public:
    Expected<std::size_t> read(char* to, std::size_t size) override {
      const std::string text = line(1, "can0 001#") + line(3, "can0 002#");
      if (std::exchange(read_, true)) return fail("1.log", "is damaged");
      EXPECT_GE(size, text.size());
      std::copy(text.begin(), text.end(), to);
      return text.size();
    }
    const std::string& name() const override { return name_; }
    std::uint64_t bytes_read() const override { return 0; }
    std::uint64_t bytes_total() const override { return 0; }
    void before_wait(std::function<void()> /*callback*/) override {}

   private:
    std::string name_ = "1.log";
    bool read_ = false;
  };
  std::vector<MergedReader::Part> parts;
  parts.push_back({"0.log", std::move(*open_log(
                                bytes_from_text(line(2, "can1 003#") + line(4, "can1 004#"))))});
  parts.push_back({"1.log", std::move(*open_log(std::make_unique<Damaged>()))});
  auto reader = MergedReader::make(std::move(parts));
  ASSERT_TRUE(reader);
  const ReadLog log = read_whole(**reader);
  EXPECT_EQ(as_candump(log),
            (Lines{"(0000000001.000000) can0 001#", "(0000000002.000000) can1 003#",
                   "(0000000003.000000) can0 002#"}));
  EXPECT_EQ(log.error, "1.log: is damaged");
}

TEST(MergedReader, CountsEachLogApart) {
  auto reader =
      merge({line(1, "can0 001#") + "(bad\n", "rem\n" + line(2, "can0 45123#81:00:12345678#AA")});
  ASSERT_TRUE(reader);
  const ReadLog log = read_whole(**reader);
  ASSERT_EQ(log.records.size(), 2U);
  EXPECT_EQ(log.records[1].xl.size(), 1U);
  const auto parts = (*reader)->parts();
  EXPECT_EQ(told(*parts[0]),
            "2 lines, 1 frames, 0 XL, 0 other, 1 malformed, 0 cut off, 0 skipped; 2: "
            "stamp: the seconds are not a number");
  EXPECT_EQ(told(*parts[1]),
            "2 lines, 0 frames, 1 XL, 1 other, 0 malformed, 0 cut off, 0 skipped; ");
  EXPECT_EQ(log.counts.frames + log.counts.xl_frames, 2U);
}

// 40 interfaces in each of two logs exceed the table: frames of the others are counted.
TEST(MergedReader, CountsTheFramesOfTooManyInterfaces) {
  Lines texts(2);
  for (unsigned i = 0; i < 40; ++i) {
    texts[0] += line(i, fmt::format("a{} 001#", i).c_str());
    texts[1] += line(i, fmt::format("b{} 001#", i).c_str());
  }
  auto reader = merge(texts);
  ASSERT_TRUE(reader);
  const ReadLog log = read_whole(**reader);
  EXPECT_EQ(log.records.size(), 64U);
  EXPECT_EQ(log.counts.malformed_lines, 16U);
}

TEST(MergedReader, ReadsTheSameInAnyPieces) {
  Lines texts(3);
  std::mt19937_64 random(29'11'2026);
  double t_s = 0;
  for (int i = 0; i < 3000; ++i) {
    t_s += static_cast<double>(random() % 1000) * 1e-6;
    texts[random() % 3] += line(t_s, fmt::format("can{} 123#{:04X}", random() % 2, i).c_str());
  }
  auto whole = merge(texts);
  ASSERT_TRUE(whole);
  const ReadLog log = read_whole(**whole);
  EXPECT_EQ(log.records.size(), 3000U);
  for (const std::size_t chunk : {1U, 100U}) {
    auto pieces = merge(texts, chunk);
    ASSERT_TRUE(pieces);
    EXPECT_EQ(read_whole(**pieces).records, log.records);
  }
}

}  // namespace
}  // namespace vgyro::canlog
