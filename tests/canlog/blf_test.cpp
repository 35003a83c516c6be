// BLF files made byte by byte, odd and damaged ones; tests/canlog/blf_oracle_test.py uses
// python-can's.

#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <zlib.h>

#include "canlog/byte_order.h"
#include "tests/canlog/opened_log.h"

namespace vgyro::canlog {
namespace {

using namespace std::string_literals;
using Lines = std::vector<std::string>;

template <class T>
std::string little(T value) {
  std::string bytes(sizeof(T), '\0');
  store_little(bytes.data(), value);
  return bytes;
}
std::string byte(unsigned value) {
  return std::string(1, static_cast<char>(value));
}

std::string object_head(unsigned head_bytes, unsigned version, std::size_t bytes, unsigned type) {
  return "LOBJ" + little(static_cast<std::uint16_t>(head_bytes)) +
         little(static_cast<std::uint16_t>(version)) + little(static_cast<std::uint32_t>(bytes)) +
         little(static_cast<std::uint32_t>(type));
}

/// An event without padding; `unit` 1: 10 µs, 2: ns.
std::string event(unsigned type, std::uint64_t ticks, const std::string& fields,
                  std::uint32_t unit = 2) {
  return object_head(32, 1, 32 + fields.size(), type) + little(unit) + little(std::uint32_t{0}) +
         little(ticks) + fields;
}

std::string message(unsigned channel, unsigned flags, unsigned dlc, std::uint32_t id,
                    const std::string& data) {
  std::string bytes = data;
  bytes.resize(8, '\0');
  return little(static_cast<std::uint16_t>(channel)) + byte(flags) + byte(dlc) + little(id) + bytes;
}

std::string fd_message(unsigned flags, unsigned dlc, unsigned fd_flags, unsigned valid,
                       const std::string& data) {
  std::string bytes = data;
  bytes.resize(64, '\0');
  return little(std::uint16_t{1}) + byte(flags) + byte(dlc) + little(std::uint32_t{0x123}) +
         std::string(5, '\0') + byte(fd_flags) + byte(valid) + std::string(5, '\0') + bytes;
}

std::string fd64_message(unsigned dlc, std::uint32_t flags, unsigned valid, unsigned direction,
                         unsigned more_at, const std::string& data) {
  return byte(2) + byte(dlc) + byte(valid) + byte(0) + little(std::uint32_t{0x80000123U}) +
         std::string(4, '\0') + little(flags) + std::string(18, '\0') + byte(direction) +
         byte(more_at) + std::string(4, '\0') + data;
}

std::string frame(std::uint64_t micros, char data) {
  return event(1, micros * 1000, message(1, 0, 1, 0x123, std::string(1, data)));
}

std::string deflated(const std::string& plain) {
  std::string packed(::compressBound(plain.size()), '\0');
  uLongf size = packed.size();
  ::compress(reinterpret_cast<Bytef*>(packed.data()), &size,
             reinterpret_cast<const Bytef*>(plain.data()), plain.size());
  packed.resize(size);
  return packed;
}

std::string container(const std::string& held, unsigned packing, std::size_t plain_bytes) {
  const std::size_t bytes = 32 + held.size();
  return object_head(16, 1, bytes, 10) + little(static_cast<std::uint16_t>(packing)) +
         std::string(6, '\0') + little(static_cast<std::uint32_t>(plain_bytes)) +
         std::string(4, '\0') + held + std::string(bytes % 4, '\0');
}
std::string packed(const std::string& plain) {
  return container(deflated(plain), 2, plain.size());
}
std::string stored(const std::string& plain) {
  return container(plain, 0, plain.size());
}

/// A head dated 14 November 2023, 22:13:20 UTC, or without a date.
std::string file_head(bool dated = true, std::uint32_t objects = 1) {
  std::string head = "LOGG" + little(std::uint32_t{144}) + std::string(24, '\0') + little(objects) +
                     std::string(4, '\0');
  for (const int word : {2023, 11, 2, 14, 22, 13, 20, 0})
    head += little(static_cast<std::uint16_t>(dated ? word : 0));
  head.resize(144, '\0');
  return head;
}

class Blf : public ::testing::Test {
 protected:
  void SetUp() override {
    ::setenv("TZ", "UTC", 1);
    ::tzset();
  }
};

ReadLog read(const std::string& bytes) {
  ReadLog whole = open_and_read(bytes);
  for (const std::size_t chunk : {1U, 7U, 100U}) {
    const ReadLog pieces = open_and_read(bytes, chunk);
    EXPECT_EQ(as_candump(whole), as_candump(pieces)) << chunk;
    EXPECT_EQ(told(whole.counts), told(pieces.counts)) << chunk;
    EXPECT_EQ(whole.error, pieces.error) << chunk;
  }
  return whole;
}

Lines stamps(std::initializer_list<const char*> rest) {
  Lines lines;
  for (const char* text : rest)
    lines.push_back("(17000000" + std::string(text));
  return lines;
}

TEST_F(Blf, OneObjectByHand) {
  const auto log = read(
      file_head() + packed(event(1, 250'000'000, message(2, 1, 3, 0x80000123U, "\x11\x22\x33"))));
  EXPECT_EQ(as_candump(log), stamps({"00.250000) can1 00000123#112233 T"}));
  EXPECT_EQ(log.counts.item, "object");
  EXPECT_EQ(log.counts.lines, 1U);
}

TEST_F(Blf, UnitsOfTime) {
  const auto log = read(file_head() + packed(event(1, 123'456, message(1, 0, 0, 1, ""), 1) +
                                             event(1, 123'456'789, message(1, 0, 0, 1, ""), 2) +
                                             event(1, 5, message(1, 0, 0, 1, ""), 3)));
  EXPECT_EQ(as_candump(log), stamps({"01.234560) can0 001# R", "00.123456789) can0 001# R"}));
  ASSERT_EQ(log.counts.malformed_lines, 1U);
  EXPECT_EQ(log.counts.first_malformed[0].line, 3U);
}

TEST_F(Blf, StampsWithoutADateCountFromZero) {
  const auto log = read(file_head(false) + packed(frame(1, 'a')));
  EXPECT_EQ(as_candump(log), (Lines{"(0000000000.000001) can0 123#61 R"}));
  EXPECT_EQ(log.counts.malformed_lines, 0U);
}

TEST_F(Blf, AHeadThatWasNeverCompletedIsSaid) {
  const auto log = read(file_head(false, 0) + packed(frame(1, 'a')));
  EXPECT_EQ(log.counts.frames, 1U);
  ASSERT_EQ(log.counts.malformed_lines, 1U);
  EXPECT_NE(log.counts.first_malformed[0].why.find("never completed"), std::string::npos);
}

TEST_F(Blf, ChannelsBeyondTheUsual) {
  const auto log = read(file_head() + packed(event(1, 0, message(0, 0, 0, 1, "")) +
                                             event(1, 0, message(300, 0, 0, 1, ""))));
  EXPECT_EQ(log.interfaces, (Lines{"can", "can299"}));
}

TEST_F(Blf, WhatIsNoFrameYetIsPassedOver) {
  const auto log = read(file_head() + packed(event(1, 0, message(1, 2, 0, 1, "")) +
                                             event(100, 0, fd_message(2, 0, 1, 0, "")) +
                                             event(101, 0, fd64_message(0, 0, 0, 2, 0, ""))));
  EXPECT_EQ(log.counts.frames, 0U);
  EXPECT_EQ(log.counts.other_lines, 3U);
}

TEST_F(Blf, RemoteFramesAndCodesAboveEight) {
  const auto log = read(
      file_head() + packed(event(1, 0, message(1, 0x80, 5, 1, "")) +
                           event(86, 0, message(1, 0, 15, 1, "12345678") + std::string(8, '\0'))));
  EXPECT_EQ(as_candump(log),
            stamps({"00.000000) can0 001#R5 R", "00.000000) can0 001#3132333435363738_F R"}));
}

TEST_F(Blf, FdInBothObjects) {
  const auto log =
      read(file_head() + packed(event(100, 0, fd_message(1, 9, 7, 12, "abcdefghijkl")) +
                                event(101, 0, fd64_message(9, 0x7000, 12, 1, 0, "abcdefghijkl")) +
                                event(100, 0, fd_message(0, 0, 1, 0, "")) +
                                event(101, 0, fd64_message(0, 0x1000, 0, 0, 0, ""))));
  EXPECT_EQ(as_candump(log), stamps({"00.000000) can0 123##36162636465666768696A6B6C T",
                                     "00.000000) can1 00000123##36162636465666768696A6B6C T",
                                     "00.000000) can0 123##0 R", "00.000000) can1 00000123##0 R"}));
}

TEST_F(Blf, ClassicFramesInFdObjects) {
  const auto log = read(file_head() + packed(event(100, 0, fd_message(0, 9, 0, 8, "abcdefgh")) +
                                             event(101, 0, fd64_message(2, 0, 2, 0, 0, "ab")) +
                                             event(101, 0, fd64_message(4, 0x10, 0, 0, 0, ""))));
  EXPECT_EQ(as_candump(log),
            stamps({"00.000000) can0 123#6162636465666768_9 R", "00.000000) can1 00000123#6162 R",
                    "00.000000) can1 00000123#R4 R"}));
}

TEST_F(Blf, BytesThatAnFdObjectHasNoRoomForAreZero) {
  const auto log = read(
      file_head() + packed(event(101, 0, fd64_message(9, 0x1000, 12, 0, 0, "abcd")) +
                           event(101, 0, fd64_message(9, 0x1000, 12, 0, 32 + 40 + 2, "abEXTRA"))));
  EXPECT_EQ(as_candump(log), stamps({"00.000000) can1 00000123##0616263640000000000000000 R",
                                     "00.000000) can1 00000123##0616200000000000000000000 R"}));
}

TEST_F(Blf, ErrorFramesOfEveryKind) {
  const auto log =
      read(file_head() + packed(event(2, 0, little(std::uint32_t{3}) + "1234"s) +
                                event(73, 0, little(std::uint16_t{4}) + std::string(30, 'x')) +
                                event(104, 0, byte(5) + std::string(47, 'x'))));
  EXPECT_EQ(as_candump(log), stamps({"00.000000) can2 20000080#0000000000000000",
                                     "00.000000) can3 20000080#0000000000000000",
                                     "00.000000) can4 20000080#0000000000000000"}));
}

TEST_F(Blf, OddObjectsAreCountedAndThoseBehindThemRead) {
  const std::vector<std::string> odd{
      event(1, 0, message(1, 0, 16, 1, "")),                   // wrong length code
      event(1, 0, message(1, 0, 1, 0x800, "")),                // wrong identifier
      event(1, 0, "short"),                                    // too short for its fields
      event(1, UINT64_MAX, message(1, 0, 1, 1, "")),           // wrong stamp
      event(100, 0, fd_message(0x80, 5, 1, 5, "")),            // FD has no remote frames
      event(100, 0, fd_message(0, 15, 1, 65, "")),             // more than 64 bytes
      object_head(16, 1, 40, 1) + std::string(24, 'x'),        // no room for a stamp
      object_head(15, 1, 40, 1) + std::string(24, 'x'),        // wrong size of the head
      object_head(32, 1, 5'000, 1) + std::string(4'984, 'x'),  // wrong size
  };
  for (const std::string& object : odd) {
    const auto log = read(file_head() + packed(frame(1, 'a') + object + frame(2, 'b')));
    EXPECT_EQ(as_candump(log), stamps({"00.000001) can0 123#61 R", "00.000002) can0 123#62 R"}));
    ASSERT_EQ(log.counts.malformed_lines, 1U);
    EXPECT_EQ(log.counts.first_malformed[0].line, 2U);
    EXPECT_EQ(log.error, "");
  }
}

TEST_F(Blf, ObjectsOfOtherKindsMayBeLargerThanAnyBuffer) {
  const std::string large = event(96, 0, std::string(1'000'000, 'x'));
  const auto log = read(file_head() + packed(frame(1, 'a') + large + frame(2, 'b')) +
                        stored(event(115, 0, "index") + "x"s));
  EXPECT_EQ(log.counts.frames, 2U);
  EXPECT_EQ(log.counts.other_lines, 1U) << "an index is no content";
}

TEST_F(Blf, PaddingOfEveryWriter) {
  const std::string odd = event(96, 0, "123");
  for (const std::size_t padding : {0U, 1U, 3U, 4U}) {
    const std::string zeros(padding, '\0');
    const std::string one = stored(odd + zeros + frame(1, 'a'));
    const std::string unpadded = one.substr(0, one.rfind('a') + 8);
    const auto log = read(file_head() + unpadded + zeros + unpadded + zeros + unpadded);
    EXPECT_EQ(log.counts.frames, 3U) << padding;
    EXPECT_EQ(log.counts.malformed_lines + log.counts.skipped_bytes, 0U) << padding;
  }
}

TEST_F(Blf, ObjectsMayGoOnInTheNextContainer) {
  const std::string plain = frame(1, 'a') + frame(2, 'b') + frame(3, 'c');
  for (std::size_t cut = 1; cut < plain.size(); ++cut) {
    const auto log =
        open_and_read(file_head() + packed(plain.substr(0, cut)) + stored(plain.substr(cut)));
    EXPECT_EQ(log.counts.frames, 3U) << cut;
    EXPECT_EQ(log.counts.skipped_bytes, 0U) << cut;
  }
}

TEST_F(Blf, ObjectsOutsideOfContainers) {
  const auto log = read(file_head() + frame(1, 'a') + packed(frame(2, 'b')) + frame(3, 'c'));
  EXPECT_EQ(log.counts.frames, 3U);
  EXPECT_EQ(log.counts.cut_off_lines, 0U);
}

TEST_F(Blf, NoFrameIsMadeOfTheTwoSidesOfADamage) {
  // The second container holds the middle of a frame, the third its end.
  const std::string plain = frame(1, 'a') + frame(2, 'b') + frame(3, 'c') + frame(4, 'd');
  std::string broken = packed(plain.substr(60, 60));
  broken[40] = static_cast<char>(broken[40] ^ 0x55);
  const auto log =
      read(file_head() + packed(plain.substr(0, 60)) + broken + packed(plain.substr(120)));
  EXPECT_EQ(as_candump(log), stamps({"00.000001) can0 123#61 R", "00.000004) can0 123#64 R"}));
  ASSERT_EQ(log.counts.malformed_lines, 1U);
  EXPECT_NE(log.counts.first_malformed[0].why.find("damaged"), std::string::npos);
  EXPECT_GT(log.counts.skipped_bytes, 0U);
}

TEST_F(Blf, BytesThatBelongToNothing) {
  const auto log = read(file_head() + stored(frame(1, 'a')) + std::string(50, 'x') +
                        stored(frame(2, 'b') + std::string(20, 'y') + frame(3, 'c')));
  EXPECT_EQ(log.counts.frames, 3U);
  EXPECT_EQ(log.counts.skipped_bytes, 70U);
  EXPECT_EQ(log.counts.malformed_lines, 2U);
}

TEST_F(Blf, ContainersThatCannotBe) {
  const std::vector<std::string> odd{
      container(deflated(frame(1, 'x')), 2, 0xFFFFFFFFU),
      container(deflated(frame(1, 'x')), 7, 48),
      container(deflated(frame(1, 'x')).substr(0, 20), 2, 48),
      object_head(16, 1, 20, 10) + "abcd",
      object_head(16, 1, 12, 10),
  };
  for (const std::string& one : odd) {
    const auto log = read(file_head() + packed(frame(1, 'a')) + one + packed(frame(2, 'b')));
    EXPECT_EQ(as_candump(log), stamps({"00.000001) can0 123#61 R", "00.000002) can0 123#62 R"}));
    EXPECT_EQ(log.counts.malformed_lines, 1U);
  }
}

TEST_F(Blf, AFewKilobytesDoNotUnpackToGigabytes) {
  z_stream_s stream{};
  ::deflateInit(&stream, Z_BEST_SPEED);
  std::string zeros(1U << 20U, '\0');
  std::string bomb(4U << 20U, '\0');
  stream.next_out = reinterpret_cast<Bytef*>(bomb.data());
  stream.avail_out = static_cast<uInt>(bomb.size());
  constexpr int kMegabytes = 300;
  for (int i = 0; i < kMegabytes; ++i) {
    stream.next_in = reinterpret_cast<Bytef*>(zeros.data());
    stream.avail_in = static_cast<uInt>(zeros.size());
    ::deflate(&stream, i + 1 == kMegabytes ? Z_FINISH : Z_NO_FLUSH);
  }
  bomb.resize(stream.total_out);
  ::deflateEnd(&stream);
  const auto log = open_and_read(file_head() + container(bomb, 2, 1000) + packed(frame(1, 'a')));
  EXPECT_EQ(log.counts.frames, 1U);
  EXPECT_LE(log.counts.skipped_bytes, 257U << 20U);
}

TEST_F(Blf, ALogIsReadUpToWhereItEnds) {
  const std::string plain = frame(1, 'a') + frame(2, 'b') + frame(3, 'c');
  const std::string whole = file_head() + stored(plain);
  for (std::size_t cut = file_head().size() + 33; cut < whole.size(); ++cut) {
    const auto log = open_and_read(whole.substr(0, cut));
    EXPECT_EQ(log.counts.frames, (cut - file_head().size() - 32) / 48) << cut;
    EXPECT_EQ(log.counts.cut_off_lines, 1U) << cut;
    EXPECT_EQ(log.counts.malformed_lines, 0U) << cut;
  }
  const auto log = read(whole + std::string(1000, '\0'));
  EXPECT_EQ(log.counts.frames, 3U);
  EXPECT_EQ(log.counts.skipped_bytes, 1000U) << "as a power cut leaves it";
}

TEST_F(Blf, WhatBeginsLikeOneAndIsNone) {
  EXPECT_NE(read("LOGG is what this text begins with").error.find("BLF"), std::string::npos);
  EXPECT_NE(read(file_head().substr(0, 50)).error.find("BLF"), std::string::npos);
  EXPECT_EQ(read(file_head()).error, "");
}

}  // namespace
}  // namespace vgyro::canlog
