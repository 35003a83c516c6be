// Text forms against files of other tools: lines from files made with these tools (named at each),
// and from the makers' own descriptions. The program runs in UTC (set below), so that local dates
// can be computed by hand.

#include <cstdlib>
#include <ctime>

#include <gtest/gtest.h>

#include "tests/canlog/opened_log.h"

namespace vgyro::canlog {
namespace {

using Lines = std::vector<std::string>;

class Forms : public ::testing::Test {
 protected:
  Forms() { set_zone("UTC"); }
  ~Forms() override { set_zone("UTC"); }
  static void set_zone(const char* zone) {
    ::setenv("TZ", zone, 1);
    ::tzset();
  }
  static Lines read(const std::string& text) {
    const ReadLog log = open_and_read(text);
    EXPECT_EQ(log.error, "");
    EXPECT_EQ(malformed(log.counts), Lines{});
    return as_candump(log);
  }
};

// log2asc of can-utils 2020.11.
constexpr const char* kLog2asc =
    "date Tue Nov 14 22:13:20 2023\n"
    "base hex  timestamps absolute\n"
    "no internal events logged\n"
    "   0.000000 1  123             Rx   d 4 11 22 33 44 \n"
    "   0.010001 2  12345678x       Rx   d 8 11 22 33 44 55 66 77 88 \n"
    "   0.020002 1  123             Rx   r 0\n"
    "   0.030003 1  123             Rx   r 5\n"
    "   0.040004 CANFD   1 Rx        123                                   1 1 9 12 11 22 33 44 55 "
    "66 77 88 99 AA BB CC   130000  130     7000 0 0 0 0 0\n"
    "   0.050005 1  7FF             Rx   d 0 \n"
    "   1.060006 2  ErrorFrame\n"
    "   1.070007 CANFD   1 Rx   12345678x                                  0 0 0  0   130000  130  "
    "  "
    " 1000 0 0 0 0 0\n";

TEST_F(Forms, ReadLog2asc) {
  EXPECT_EQ(read(kLog2asc),
            (Lines{"(1700000000.000000) can0 123#11223344 R",
                   "(1700000000.010001) can1 12345678#1122334455667788 R",
                   "(1700000000.020002) can0 123#R R", "(1700000000.030003) can0 123#R5 R",
                   "(1700000000.040004) can0 123##3112233445566778899AABBCC R",
                   "(1700000000.050005) can0 7FF# R",
                   "(1700000001.060006) can1 20000080#0000000000000000",
                   "(1700000001.070007) can0 12345678##0 R"}));
}

// python-can 4.1.0: the date is the time of writing, the block's is that of the first frame.
TEST_F(Forms, ReadAscOfPythonCan) {
  EXPECT_EQ(read("date Sun Nov 29 05:49:37.083 AM 2026\nbase hex  timestamps absolute\n"
                 "internal events logged\nBegin Triggerblock Tue Nov 14 10:13:20.5 PM 2023\n"
                 " 0.000000 Start of measurement\n"
                 " 0.000000 1  123             Rx   d 4 11 22 33 44\n"
                 " 0.010001 2  12345678x       Tx   d 8 00 01 02 03 04 05 06 07\n"
                 " 0.040004 CANFD   1 Rx        123                                   1 0 9 12 00 "
                 "01 02 03 "
                 "04 05 06 07 08 09 0A 0B        0    0     3000        0        0        0        "
                 "0        0\n"
                 "End TriggerBlock\n"),
            (Lines{"(1700000000.500000) can0 123#11223344 R",
                   "(1700000000.510001) can1 12345678#0001020304050607 T",
                   "(1700000000.540004) can0 123##1000102030405060708090A0B R"}));
}

// As written by CANoe and CANalyzer, with a German date, names, other events and their additions.
TEST_F(Forms, ReadAscOfVector) {
  const std::string text =
      "date Die M\xE4r 14 22:13:20.250 2023\r\n"
      "base dec  timestamps absolute\r\n"
      "internal events logged\r\n"
      "// version 9.0.0\r\n"
      "Begin Triggerblock Die M\xE4r 14 22:13:20.250 2023\r\n"
      "   0.000000 Start of measurement\r\n"
      "   0.015991 CAN 1 Status:chip status error active\r\n"
      "   0.020000 1  291             Rx   d 2 17 255  Length = 245910 BitCount = 126 ID = 291\r\n"
      "   0.030000 2  305419896x      Tx   d 1 00  Length = 0 BitCount = 0 ID = 305419896x\r\n"
      "   0.040000 1  291             TxRq   d 2 17 255\r\n"
      "   0.050000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\r\n"
      "   0.060000 CANFD   2 Rx        291  SpeedInfo                       0 0 2  2 17 34   "
      "102203  "
      "133     1000 1000 46500250 460a0250 20011736 2001040d\r\n"
      "   0.070000 CANFD   1 Rx        291                                  0 0 2  2 17 34   "
      "102203  "
      "133        0 1000 46500250 460a0250 20011736 2001040d\r\n"
      "   0.080000 CANFD   2 Rx        ErrorFrame Not Acknowledge error, dominant error flag fffe "
      "c7 "
      "31ca Arb. 556 44 0 0 0 0 0\r\n"
      "End TriggerBlock\r\n";
  const ReadLog log = open_and_read(text);
  EXPECT_EQ(as_candump(log),
            (Lines{"(1678832000.270000) can0 123#11FF R", "(1678832000.280000) can1 12345678#00 T",
                   "(1678832000.310000) can1 123##01122 R", "(1678832000.320000) can0 123#1122 R",
                   "(1678832000.330000) can1 20000080#0000000000000000 R"}));
  EXPECT_EQ(told(log.counts),
            "15 lines, 5 frames, 0 XL, 3 other, 0 malformed, 0 cut off, 0 skipped; ");
}

// Each stamp counts from the event before it, of whatever kind.
TEST_F(Forms, AddUpRelativeStampsOfAsc) {
  EXPECT_EQ(
      read("date Tue Nov 14 10:13:20 pm 2023\nbase hex timestamps relative\n"
           "0.500000 1 123 Rx d 1 01\n0.250000 1 Statistic: D 0 R 0\n0.250000 1 123 Rx d 1 02\n"),
      (Lines{"(1700000000.500000) can0 123#01 R", "(1700000001.000000) can0 123#02 R"}));
}

// In a block that begins with a trigger, stamps count from the file's date; its own date is that of
// the trigger.
TEST_F(Forms, CountTriggeredBlocksOfAscFromTheFilesDate) {
  EXPECT_EQ(read("date Tue Nov 14 22:13:20 2023\nbase hex timestamps absolute\n"
                 "Begin Triggerblock Tue Nov 14 22:13:25.125 2023\n   5.125000 log trigger event\n"
                 "   5.250000 1 123 Rx d 1 01\nEnd TriggerBlock\n"
                 "Begin Triggerblock Tue Nov 14 22:13:29.000 2023\n"
                 "   9.000000 1 123 Rx d 1 02\nEnd TriggerBlock\n"),
            (Lines{"(1700000005.250000) can0 123#01 R", "(1700000009.000000) can0 123#02 R"}));
}

// Dates are local time: the reader's zone is assumed for the writer.
TEST_F(Forms, TakeDatesForLocalTime) {
  set_zone("UTC-1");  // POSIX: one hour east
  EXPECT_EQ(read("date Tue Nov 14 23:13:20 2023\n0.5 1 123 Rx d 1 01\n"),
            Lines{"(1700000000.500000) can0 123#01 R"});
  EXPECT_EQ(read(" (2023-11-14 23:13:20.123456)  can0  123   [1]  01\n"),
            Lines{"(1700000000.123456) can0 123#01"});
}

TEST_F(Forms, TellWhatIsWrongInAsc) {
  const ReadLog log = open_and_read(
      "base hex timestamps absolute\ndate of somebody's birth\n0.1 1 800 Rx d 1 01\n"
      "0.2 1 123 Rx d 4 01 02\n0.3 CANFD 1 Rx 123 1 1 9 65 00\n0.4 1 123 Rx d 1 01\n0.5 1 12");
  EXPECT_EQ(malformed(log.counts), (Lines{"2: date: not understood; the stamps count from zero",
                                          "3: identifier: larger than its kind can be",
                                          "4: payload: shorter than its length",
                                          "5: length: more bytes than the frame can hold"}));
  EXPECT_EQ(as_candump(log), Lines{"(0000000000.400000) can0 123#01 R"});
  EXPECT_EQ(log.counts.cut_off_lines, 1U);
}

// The example in PEAK's description of the format, version 1.1, which gives its date as 24.03.2003
// 12:52:32.484.
TEST_F(Forms, ReadTrc11) {
  const ReadLog log = open_and_read(
      ";$FILEVERSION=1.1\r\n;$STARTTIME=37704.5364870833\r\n;\r\n"
      ";---+--   ----+----  --+--  ----+---  +  -+ -- -- -- -- -- -- --\r\n"
      "     1)      1059.9  Rx         0300  7  00 00 00 00 04 00 00 \r\n"
      "     2)      1298.6  Tx     18EFC034  2  00 FF \r\n"
      "     3)      1323.0  Rx         0300  3  RTR \r\n"
      "     4)      1346.8  Warng  FFFFFFFF  4  00 00 00 08  BUSLIGHT \r\n"
      "     5)      1349.2  Error      0008  4  00 19 08 08 \r\n");
  EXPECT_EQ(as_candump(log),
            (Lines{"(1048510353.543900) can0 300#00000000040000 R",
                   "(1048510353.782600) can0 18EFC034#00FF T", "(1048510353.807000) can0 300#R3 R",
                   "(1048510353.833200) can0 20000080#0000000000000000"}));
  EXPECT_EQ(log.counts.other_lines, 1U);
}

TEST_F(Forms, ReadTrc10AndTrc13) {
  EXPECT_EQ(read(";##########\n;   Start time: 14.11.2023 22:13:20.250.0\n;\n"
                 "     1)      1841 0001 8 00 00 00 00 00 00 00 00 \n"
                 "     2)      1842 00000001 1 FF \n"),
            (Lines{"(1700000002.091000) can0 001#0000000000000000",
                   "(1700000002.092000) can0 00000001#FF"}));
  EXPECT_EQ(read(";$FILEVERSION=1.3\n;$STARTTIME=45244.9259259259\n"
                 "     1)      1059.900 1  Rx        0300 -  7    00 00 00 00 04 00 00 \n"
                 "     2)      1283.231 2  Tx    0C29F15A -  1    A5 \n"),
            (Lines{"(1700000001.059900) can0 300#00000000040000 R",
                   "(1700000001.283231) can1 0C29F15A#A5 T"}));
}

TEST_F(Forms, ReadTrc21) {
  const ReadLog log = open_and_read(
      ";$FILEVERSION=2.1\n;$STARTTIME=45244.9259259259\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
      "      1      1059.900 DT 1      0300 Rx -  7    00 00 00 00 04 00 00 \n"
      "      2      1283.231 FB 2  18EF0034 Tx -  9    01 02 03 04 05 06 07 08 09 0A 0B 0C \n"
      "      3      1283.500 RR 1      0300 Rx -  3\n"
      "      4      1284.000 BI 1      0301 Rx -  0\n"
      "      5      1285.000 ER 1         - Rx -  5    04 00 02 00 00 \n"
      "      6      1286.000 ST 1         - Rx -  4    00 00 00 08 \n");
  EXPECT_EQ(as_candump(log),
            (Lines{"(1700000001.059900) can0 300#00000000040000 R",
                   "(1700000001.283231) can1 18EF0034##10102030405060708090A0B0C T",
                   "(1700000001.283500) can0 300#R3 R", "(1700000001.284000) can0 301##3 R",
                   "(1700000001.285000) can0 20000080#0000000000000000 R"}));
  EXPECT_EQ(log.counts.other_lines, 1U);
}

// Version 2.0 has no bus, and some loggers write lengths instead of codes.
TEST_F(Forms, ReadTheColumnsOfTrcThatTheFileNames) {
  EXPECT_EQ(
      read(";$FILEVERSION=2.0\n;$STARTTIME=45244.9259259259\n;$COLUMNS=N,O,T,I,d,l,D\n"
           "      1      1059.900 DT      0300 Rx  2    00 01 \n"
           "      2      1060.900 FD      0300 Rx 12    00 01 02 03 04 05 06 07 08 09 0A 0B \n"),
      (Lines{"(1700000001.059900) can0 300#0001 R",
             "(1700000001.060900) can0 300##0000102030405060708090A0B R"}));
}

// python-can 4.1.0.
TEST_F(Forms, ReadCsvOfPythonCan) {
  const Lines expected{"(1700000000.000000) can0 123#11223344",
                       "(1700000000.010001) can0 12345678#0001020304050607",
                       "(1700000000.020002) can0 123#R5",
                       "(1700000000.040004) can0 123##0000102030405060708090A0B",
                       "(1700000000.050005) can0 7FF#",
                       "(1700000001.060006) can0 20000080#0000000000000000"};
  const std::string rows =
      "1700000000.0,0x123,0,0,0,4,ESIzRA==\n1700000000.010001,0x12345678,1,0,0,8,AAECAwQFBgc=\n"
      "1700000000.020002,0x123,0,1,0,5,\n1700000000.040004,0x123,0,0,0,12,AAECAwQFBgcICQoL\n"
      "1700000000.050005,0x7ff,0,0,0,0,\n1700000001.060006,0x0,1,0,1,0,\n";
  EXPECT_EQ(read("timestamp,arbitration_id,extended,remote,error,dlc,data\n" + rows), expected);
  // A log that was appended to has no head.
  EXPECT_EQ(read(rows), expected);
  EXPECT_EQ(read("1e-05,0x123,0,0,0,1,AA==\n"), Lines{"(0000000000.000010000) can0 123#00"});
}

TEST_F(Forms, ReadCsvOfSavvyCan) {
  EXPECT_EQ(read("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\r\n"
                 "1700000000123456,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,\r\n"
                 "1700000000123460,18DAF110,true,Tx,1,2,02,3E,\r\n"),
            (Lines{"(1700000000.123456) can0 21A#FE3612FE690507AD R",
                   "(1700000000.123460) can1 18DAF110#023E T"}));
  // The form before 2018.
  EXPECT_EQ(read("Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
                 "166064000,0000021A,false,0,3,FE,36,12,,,,,,\n"),
            Lines{"(0000000166.064000) can0 21A#FE3612"});
}

// candump -ta, -tA, with -x, with colours and with -i; FD frames of the newest version.
TEST_F(Forms, ReadScreenTextOfCandump) {
  EXPECT_EQ(
      read(" (1700000000.123456)  can0  123   [8]  11 22 33 44 55 66 77 88\n"
           " (1700000000.123457)  can1  12345678   [2]  11 22   '.\"'\n"
           " (1700000000.123458)  can0  RX B -  123  [08]  11 22 33 44 55 66 77 88\n"
           " (1700000000.123459)  can0  TX - -  123   [0]  remote request\n"
           " (1700000000.123460)  can0  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME\n"
           " \x1B[31m(1700000000.123461)  \x1B[34mcan0\x1B[0m  123   [1]  FF\n"
           " (1700000000.123462)  can0  123   [2]  00010001 11111111\n"
           " (1700000000.123463)  can0  123   [3]  33`22`11\n"
           " (1700000000.123464)  can0  123   {B}  11 22 33 44 55 66 77 88\n"),
      (Lines{
          "(1700000000.123456) can0 123#1122334455667788", "(1700000000.123457) can1 12345678#1122",
          "(1700000000.123458) can0 123##11122334455667788 R", "(1700000000.123459) can0 123#R T",
          "(1700000000.123460) can0 20000004#0001000000000000", "(1700000000.123461) can0 123#FF",
          "(1700000000.123462) can0 123#11FF", "(1700000000.123463) can0 123#112233",
          "(1700000000.123464) can0 123#1122334455667788_B"}));
}

// With -td each stamp counts from the frame before it, with -tz from the first one. They look
// alike.
TEST_F(Forms, TellDeltasFromTimeSinceTheBeginning) {
  const std::string tail = "  can0  123   [1]  00\n";
  EXPECT_EQ(read(" (000.000000)" + tail + " (000.010003)" + tail + " (000.009998)" + tail),
            (Lines{"(0000000000.000000) can0 123#00", "(0000000000.010003) can0 123#00",
                   "(0000000000.020001) can0 123#00"}));
  EXPECT_EQ(read(" (000.000000)" + tail + " (000.010003)" + tail + " (000.019998)" + tail),
            (Lines{"(0000000000.000000) can0 123#00", "(0000000000.010003) can0 123#00",
                   "(0000000000.019998) can0 123#00"}));
}

// For forms that are not read, the error names the form and a remedy.
TEST_F(Forms, NameWhatIsNotRead) {
  const auto error = [](const std::string& text) { return open_and_read(text).error; };
  EXPECT_EQ(error("  can0  123   [1]  00\n").find("text: is what candump prints without stamps"),
            0U);
  EXPECT_EQ(error("#ROSBAG V2.0\nabc").find("text: is a ROS 1 bag"), 0U);
  EXPECT_EQ(error("\x89MCAP0\r\n").find("text: is an MCAP recording"), 0U);
  EXPECT_EQ(error("%PDF-1.7\n").find("text: is a PDF document"), 0U);
  EXPECT_EQ(error("PK\x03\x04zip").find("text: is a ZIP archive"), 0U);
  EXPECT_EQ(error(std::string("\xFF\xFE(\0", 4)).find("text: is UTF-16 text"), 0U);
  EXPECT_EQ(error("Dear diary,\n").find("text: is text, but not a known log of CAN frames"), 0U);
  EXPECT_EQ(error("\x01\x02\x03").find("text: is not a known log of CAN frames"), 0U);
}

// Comments, NUL bytes and byte-order marks before the first frame do not hide the form.
TEST_F(Forms, AreFoundBehindOtherLines) {
  const std::string frame = "(1.500000) can0 123#01\n";
  for (const std::string before : {"", "# drive of May\n\n", "\xEF\xBB\xBF", "DROPCOUNT: 3\n"})
    EXPECT_EQ(as_candump(open_and_read(before + frame)), Lines{"(0000000001.500000) can0 123#01"});
  EXPECT_EQ(as_candump(open_and_read(std::string(100'000, '\0') + frame)),
            Lines{"(0000000001.500000) can0 123#01"});
  EXPECT_EQ(open_and_read("\xEF\xBB\xBF" + std::string(kLog2asc)).records.size(), 8U);
}

// In any pieces, and with any end that a killed writer may leave.
TEST_F(Forms, ReadTheSameInAnyPieces) {
  const std::string whole(kLog2asc);
  const ReadLog log = open_and_read(whole);
  for (const std::size_t chunk : {1U, 7U, 64U, 1000U})
    EXPECT_EQ(open_and_read(whole, chunk).records, log.records);
  for (std::size_t size = 90; size < whole.size(); size += 13) {
    const ReadLog cut = open_and_read(whole.substr(0, size));
    EXPECT_EQ(cut.error, "");
    ASSERT_LE(cut.records.size(), log.records.size());
    for (std::size_t i = 0; i < cut.records.size(); ++i)
      EXPECT_EQ(cut.records[i], log.records[i]);
  }
}

}  // namespace
}  // namespace vgyro::canlog
