// The meaning of one line of a log, form by form.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "canlog/candump.h"
#include "tests/canlog/log_text.h"

namespace vgyro::canlog {
namespace {

struct ParsedLine {
  LineKind kind = LineKind::kOther;
  std::string why;
  LogRecord record;
  XlFrame xl;
  std::string interface;
};

ParsedLine parse(std::string_view line) {
  ParsedLine parsed;
  InterfaceTable interfaces;
  const LineResult result = parse_line(line, interfaces, parsed.record, parsed.xl);
  parsed.kind = result.kind;
  parsed.why = result.why;
  if (!interfaces.names().empty()) parsed.interface = interfaces.name(parsed.record.bus);
  return parsed;
}

/// The frame in "ID#..." alone; the line must be valid.
can::Frame frame_in(const std::string& text) {
  const ParsedLine parsed = parse("(1700000000.123456) can0 " + text);
  EXPECT_EQ(parsed.kind, LineKind::kFrame) << text << ": " << parsed.why;
  return parsed.record.frame;
}

can::Frame remote_frame(std::uint32_t id, unsigned flags, std::uint8_t length,
                        std::uint8_t raw_dlc) {
  can::Frame frame = frame_with(id, flags | can::kRemote);
  frame.length = length;
  frame.raw_dlc = raw_dlc;
  return frame;
}

std::string why_malformed(const std::string& line) {
  const ParsedLine parsed = parse(line);
  EXPECT_EQ(parsed.kind, LineKind::kMalformed) << line;
  EXPECT_EQ(parsed.interface, "") << line << " must not use up a place among the interfaces";
  return parsed.why;
}

std::string why_malformed_frame(const std::string& text) {
  return why_malformed("(1700000000.123456) can0 " + text);
}

// The number of digits decides between standard and extended, not the number's size.
TEST(CandumpForm, ReadsStandardAndExtendedFrames) {
  EXPECT_EQ(frame_in("123#DEADBEEF"), frame_with(0x123, 0, {0xDE, 0xAD, 0xBE, 0xEF}));
  EXPECT_EQ(frame_in("000#"), frame_with(0, 0));
  EXPECT_EQ(frame_in("7FF#0102030405060708"), frame_with(0x7FF, 0, {1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(frame_in("00000123#11"), frame_with(0x123, can::kExtended, {0x11}));
  EXPECT_EQ(frame_in("1FFFFFFF#"), frame_with(0x1FFFFFFF, can::kExtended));
}

// can-utils' players accept lower case and dots between bytes, so logs contain them.
TEST(CandumpForm, ReadsSmallLettersAndDotsBetweenBytes) {
  EXPECT_EQ(frame_in("12a#deadbeef"), frame_with(0x12A, 0, {0xDE, 0xAD, 0xBE, 0xEF}));
  EXPECT_EQ(frame_in("12A#DE.AD.BEEF"), frame_with(0x12A, 0, {0xDE, 0xAD, 0xBE, 0xEF}));
  EXPECT_EQ(frame_in("12A##1de.ad"),
            frame_with(0x12A, can::kFd | can::kBitRateSwitch, {0xDE, 0xAD}));
}

// Error frames have the error bit in eight digits; their identifier holds the error class.
TEST(CandumpForm, ReadsErrorFrames) {
  EXPECT_EQ(frame_in("20000080#0000000000000000"),
            frame_with(0x80, can::kError, {0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(frame_in("20000004#0004000000000000"),
            frame_with(0x4, can::kError, {0, 4, 0, 0, 0, 0, 0, 0}));
}

// Remote frames state the requested length, if the log's writer knew it.
TEST(CandumpForm, ReadsRemoteFrames) {
  EXPECT_EQ(frame_in("123#R"), remote_frame(0x123, 0, 0, 0));
  EXPECT_EQ(frame_in("123#r"), remote_frame(0x123, 0, 0, 0));
  EXPECT_EQ(frame_in("123#R0"), remote_frame(0x123, 0, 0, 0));
  EXPECT_EQ(frame_in("123#R5"), remote_frame(0x123, 0, 5, 0));
  EXPECT_EQ(frame_in("00000123#R8"), remote_frame(0x123, can::kExtended, 8, 0));
  EXPECT_EQ(frame_in("123#R8_9"), remote_frame(0x123, 0, 8, 9));
  EXPECT_EQ(frame_in("123#R8_F"), remote_frame(0x123, 0, 8, 15));
}

// A classic frame may have 9 to 15 in its DLC but still carries 8 bytes.
TEST(CandumpForm, ReadsRawDlcAboveEight) {
  for (unsigned dlc = 9; dlc <= 15; ++dlc) {
    can::Frame frame = frame_with(0x123, 0, {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88});
    frame.raw_dlc = static_cast<std::uint8_t>(dlc);
    EXPECT_EQ(frame_in(fmt::format("123#1122334455667788_{:X}", dlc)), frame);
    EXPECT_EQ(frame_in(fmt::format("123#1122334455667788_{:x}", dlc)), frame);
  }
}

// Bit 0 is the bit-rate switch and bit 1 the error state; bit 2 repeats that the frame is FD,
// except in old logs.
TEST(CandumpForm, ReadsFdFlagsWithAndWithoutTheFdfBit) {
  for (unsigned nibble = 0; nibble < 16; ++nibble) {
    unsigned flags = can::kFd;
    if ((nibble & 1U) != 0) flags |= can::kBitRateSwitch;
    if ((nibble & 2U) != 0) flags |= can::kErrorStateIndicator;
    EXPECT_EQ(frame_in(fmt::format("123##{:X}AABB", nibble)),
              frame_with(0x123, flags, {0xAA, 0xBB}));
  }
  EXPECT_EQ(frame_in("12345678##5"),
            frame_with(0x12345678, can::kExtended | can::kFd | can::kBitRateSwitch));
}

// An FD frame holds up to 64 bytes; every length up to that is accepted, none is padded.
TEST(CandumpForm, ReadsFdPayloadsOfEveryLength) {
  std::string text = "123##0";
  std::vector<std::uint8_t> bytes;
  for (unsigned i = 0; i <= can::kFdBytesMax; ++i) {
    EXPECT_EQ(frame_in(text), frame_with(0x123, can::kFd, bytes)) << i;
    bytes.push_back(static_cast<std::uint8_t>(0xC0 + i));
    text += fmt::format("{:02X}", bytes.back());
  }
  EXPECT_EQ(why_malformed_frame(text), "payload: more bytes than the frame can hold");
}

// The product does not use XL frames, but a log with them loses no line.
TEST(CandumpForm, ReadsXlFrames) {
  const ParsedLine parsed = parse("(1700000000.123456) can0 45123#81:00:12345678#11223344AA");
  EXPECT_EQ(parsed.kind, LineKind::kXl) << parsed.why;
  EXPECT_TRUE(parsed.record.is_xl);
  XlFrame xl;
  xl.vcid = 0x45;
  xl.priority = 0x123;
  xl.flags = 0x81;
  xl.acceptance = 0x12345678;
  xl.length = 5;
  xl.data = {0x11, 0x22, 0x33, 0x44, 0xAA};
  EXPECT_EQ(parsed.xl, xl);
  EXPECT_EQ(parsed.record.frame, can::Frame{});
  EXPECT_EQ(parse("(1.0) can0 007FF#FF:EE:FFFFFFFF#").xl.sdt, 0xEE);
}

// 2048 bytes are an XL frame, 2049 are not.
TEST(CandumpForm, ReadsTheLongestXlFrameAndNothingLonger) {
  std::string text = "00123#80:00:00000000#";
  for (std::size_t i = 0; i < kXlBytesMax; ++i)
    text += "5A";
  const ParsedLine parsed = parse("(1.0) can0 " + text);
  EXPECT_EQ(parsed.kind, LineKind::kXl) << parsed.why;
  EXPECT_EQ(parsed.xl.length, kXlBytesMax);
  EXPECT_EQ(parsed.xl.data.back(), 0x5A);
  EXPECT_EQ(why_malformed_frame(text + "5A"), "payload: more bytes than the frame can hold");
}

// Microseconds and nanoseconds are both exact, so the writer can reproduce them.
TEST(CandumpForm, ReadsStampsOfSixAndNineDigits) {
  const ParsedLine micro = parse("(1700000000.123456) can0 123#");
  EXPECT_EQ(to_ns(micro.record.stamp), 1'700'000'000'123'456'000);
  EXPECT_EQ(micro.record.fraction_digits, 6);
  const ParsedLine nano = parse("(1700000000.123456789) can0 123#");
  EXPECT_EQ(to_ns(nano.record.stamp), 1'700'000'000'123'456'789);
  EXPECT_EQ(nano.record.fraction_digits, 9);
}

// Logs may begin at zero, and hand-made ones may have fewer digits.
TEST(CandumpForm, ReadsStampsFromZeroAndOfAnyWidth) {
  EXPECT_EQ(to_ns(parse("(0.000000) can0 123#").record.stamp), 0);
  EXPECT_EQ(to_ns(parse("(0000000000.000001) can0 123#").record.stamp), 1'000);
  EXPECT_EQ(to_ns(parse("(12.5) can0 123#").record.stamp), 12'500'000'000);
  EXPECT_EQ(to_ns(parse("(9.0000001) can0 123#").record.stamp), 9'000'000'100);
  EXPECT_EQ(to_ns(parse("(9000000000.999999999) can0 123#").record.stamp),
            9'000'000'000'999'999'999);
}

// candump -L of newer can-utils ends lines with R or T, and pads interface names of several buses.
TEST(CandumpForm, ReadsDirectionsAndPadding) {
  EXPECT_EQ(parse("(1.000000) can0 123#11").record.direction, Direction::kUnknown);
  EXPECT_EQ(parse("(1.000000) can0 123#11 R").record.direction, Direction::kReceived);
  EXPECT_EQ(parse("(1.000000) can0 123#11 T").record.direction, Direction::kTransmitted);
  EXPECT_EQ(parse("(1.000000) can0 123#R T").record.direction, Direction::kTransmitted);
  EXPECT_EQ(parse("(1.000000) can0 123#R R").record.direction, Direction::kReceived);
  EXPECT_EQ(parse("(1.000000) can0 123##1 R").record.direction, Direction::kReceived);
  const ParsedLine padded = parse("(1.000000)  \t vcan0    123#11   T  ");
  EXPECT_EQ(padded.kind, LineKind::kFrame) << padded.why;
  EXPECT_EQ(padded.interface, "vcan0");
  EXPECT_EQ(padded.record.direction, Direction::kTransmitted);
}

// Files that went through Windows end in CRLF.
TEST(CandumpForm, ReadsLinesThatEndInCarriageReturn) {
  const ParsedLine parsed = parse("(1.000000) can0 123#11\r");
  EXPECT_EQ(parsed.kind, LineKind::kFrame) << parsed.why;
  EXPECT_EQ(parsed.record.frame, frame_with(0x123, 0, {0x11}));
  EXPECT_EQ(parse("(1.000000) can0 123#11 T\r").record.direction, Direction::kTransmitted);
  EXPECT_EQ(parse("\r").kind, LineKind::kOther);
}

// A line that does not begin with "(" is no frame; players ignore it silently.
TEST(CandumpForm, TakesLinesWithoutAParenthesisForRemarks) {
  for (const char* line :
       {"", "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)", "# a remark",
        "can0  123   [8]  11 22 33 44 55 66 77 88", " (1.0)", "date Wed Jan 1 00:00:00 2020"}) {
    EXPECT_EQ(parse(line).kind, LineKind::kOther) << line;
  }
}

// The cause appears in the summary, so it must name the wrong part of the line.
TEST(CandumpForm, TellsWhatIsWrongWithAStamp) {
  EXPECT_EQ(why_malformed("("), "stamp: the seconds are not a number");
  EXPECT_EQ(why_malformed("(-1.000000) can0 123#"), "stamp: the seconds are not a number");
  EXPECT_EQ(why_malformed("(nan) can0 123#"), "stamp: the seconds are not a number");
  EXPECT_EQ(why_malformed("(12345678901.0) can0 123#"), "stamp: the seconds are not a number");
  EXPECT_EQ(why_malformed("(9000000001.0) can0 123#"), "stamp: beyond the year 2255");
  EXPECT_EQ(why_malformed("(17) can0 123#"), "stamp: no decimal point");
  EXPECT_EQ(why_malformed("(1,5) can0 123#"), "stamp: no decimal point");
  EXPECT_EQ(why_malformed("(1.) can0 123#"), "stamp: the fraction needs 1 to 9 digits");
  EXPECT_EQ(why_malformed("(1.0123456789) can0 123#"), "stamp: the fraction needs 1 to 9 digits");
  EXPECT_EQ(why_malformed("(1.5 can0 123#"), "stamp: no closing parenthesis");
  EXPECT_EQ(why_malformed("(1.5e3) can0 123#"), "stamp: no closing parenthesis");
}

// asc2log of can-utils 2020.11, which Debian 12 has, prints a whole million of microseconds if two
// stamps add up to exactly that: read as a fraction, the line would be 0.9 s too early.
TEST(CandumpForm, CarriesAMillionMicrosecondsIntoTheNextSecond) {
  EXPECT_EQ(parse("(1795884748.1000000) can0 123#01 R").record.stamp,
            parse("(1795884749.000000) can0 123#01 R").record.stamp);
  EXPECT_EQ(parse("(1795884748.1000000) can0 123#01 R").record.fraction_digits, 6);
  EXPECT_EQ(parse("(1.1000001) can0 123#01").record.stamp, time_from_ns(1'100'000'100));
}

// In a line without its interface every field is shifted; the frame must not become the name.
TEST(CandumpForm, TellsWhatIsWrongWithAnInterface) {
  EXPECT_EQ(why_malformed("(1.5)"), "no interface name");
  EXPECT_EQ(why_malformed("(1.5) "), "no interface name");
  EXPECT_EQ(why_malformed("(1.5) 123#11"), "no interface name");
  EXPECT_EQ(why_malformed("(1.5) " + std::string(32, 'c') + " 123#11"),
            "the interface name is longer than 31 characters");
  EXPECT_EQ(parse("(1.5) " + std::string(31, 'c') + " 123#11").interface, std::string(31, 'c'));
}

// One digit more or less would be another message: identifiers are never guessed.
TEST(CandumpForm, TellsWhatIsWrongWithAnIdentifier) {
  EXPECT_EQ(why_malformed("(1.5) can0"), "no \"#\" after the identifier");
  EXPECT_EQ(why_malformed_frame("123"), "no \"#\" after the identifier");
  EXPECT_EQ(why_malformed_frame("12G#11"), "no \"#\" after the identifier");
  EXPECT_EQ(why_malformed_frame("#11"), "identifier: neither 3 nor 8 hex digits");
  EXPECT_EQ(why_malformed_frame("12#11"), "identifier: neither 3 nor 8 hex digits");
  EXPECT_EQ(why_malformed_frame("1234#11"), "identifier: neither 3 nor 8 hex digits");
  EXPECT_EQ(why_malformed_frame("012345678#11"), "identifier: neither 3 nor 8 hex digits");
  EXPECT_EQ(why_malformed_frame("800#11"), "identifier: above 7FF needs 8 digits");
  EXPECT_EQ(why_malformed_frame("FFF#11"), "identifier: above 7FF needs 8 digits");
  EXPECT_EQ(why_malformed_frame("40000000#11"), "identifier: above 1FFFFFFF");
  EXPECT_EQ(why_malformed_frame("80000123#11"), "identifier: above 1FFFFFFF");
}

// An incomplete payload would be decoded to a wrong rate.
TEST(CandumpForm, TellsWhatIsWrongWithAPayload) {
  EXPECT_EQ(why_malformed_frame("123#112"), "payload: an odd number of hex digits");
  EXPECT_EQ(why_malformed_frame("123#1.1"), "payload: an odd number of hex digits");
  EXPECT_EQ(why_malformed_frame("123##1112"), "payload: an odd number of hex digits");
  EXPECT_EQ(why_malformed_frame("123#112233445566778899"),
            "payload: more bytes than the frame can hold");
  EXPECT_EQ(why_malformed_frame("123##"), "FD frame: no flags after \"##\"");
  EXPECT_EQ(why_malformed_frame("123##G"), "FD frame: no flags after \"##\"");
  EXPECT_EQ(why_malformed_frame("123#R9"), "remote frame: length above 8");
  EXPECT_EQ(why_malformed_frame("123#1122334455667788_"),
            "raw DLC: \"_\" must be followed by 9 to F");
  EXPECT_EQ(why_malformed_frame("123#1122334455667788_8"),
            "raw DLC: \"_\" must be followed by 9 to F");
  EXPECT_EQ(why_malformed_frame("123#11223344556677_9"), "raw DLC: only with 8 bytes");
  EXPECT_EQ(why_malformed_frame("123#R7_9"), "raw DLC: only with 8 bytes");
}

// Five digits begin an XL frame; errors after them are reported as those of an XL frame.
TEST(CandumpForm, TellsWhatIsWrongWithAnXlFrame) {
  const std::string form = "XL frame: not VVPPP#FF:SS:AAAAAAAA#";
  EXPECT_EQ(why_malformed_frame("45123#"), form);
  EXPECT_EQ(why_malformed_frame("45123#1122"), form);
  EXPECT_EQ(why_malformed_frame("45123#8:00:12345678#"), form);
  EXPECT_EQ(why_malformed_frame("45123#81:0:12345678#"), form);
  EXPECT_EQ(why_malformed_frame("45123#81:00:1234567#"), form);
  EXPECT_EQ(why_malformed_frame("45123#81:00:12345678"), form);
  EXPECT_EQ(why_malformed_frame("45800#81:00:12345678#"), "XL frame: priority above 7FF");
  EXPECT_EQ(why_malformed_frame("45123#81:00:12345678#1"), "payload: an odd number of hex digits");
}

// Letters attached to the payload, or two of them, are damage and not a direction.
TEST(CandumpForm, TellsThatSomethingStandsBehindTheFrame) {
  for (const char* text : {"123#11G", "123#11 X", "123#11 R T", "123#11 RT", "123#11R", "123#T",
                           "123##1R", "123#R T5", "123#R5T", "123#1122334455667788_9A", "123#R55",
                           "123#11 22", "123#11\r", "123#11-22", "45123#81:00:12345678#11T"}) {
    const std::string line =
        std::string(text) + (std::string_view(text).back() == '\r' ? "\r" : "");
    EXPECT_EQ(why_malformed_frame(line), "unexpected text after the frame") << text;
  }
}

// NUL bytes come from disks that lost power; they do not end a string here.
TEST(CandumpForm, TakesNulBytesForDamage) {
  EXPECT_EQ(why_malformed(std::string("(1.5) can0 123#11\0\0", 19)),
            "unexpected text after the frame");
  EXPECT_EQ(why_malformed(std::string("(\0\0\0", 4)), "stamp: the seconds are not a number");
  EXPECT_EQ(parse(std::string(20, '\0')).kind, LineKind::kOther);
}

}  // namespace
}  // namespace vgyro::canlog
