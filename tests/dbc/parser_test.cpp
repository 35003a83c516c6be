#include "dbc/parser.h"

#include <cstdio>
#include <ctime>
#include <string>

#include <fmt/core.h>
#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

const std::string kGyro =
    "BO_ 291 GYRO: 8 ECU\n"
    " SG_ Rate : 0|16@1- (0.005,-163.84) [-160|160] \"deg/s\" ECU,LOG\n"
    " SG_ Status : 16|8@1+ (1,0) [0|0] \"\" ECU\n";

std::string told(const Database& database) {
  std::string text;
  for (const Diagnostic& odd : database.diagnostics) {
    text += fmt::format("{}: {}\n", odd.line, odd.what);
  }
  return text;
}

Database parse_clean(std::string_view text) {
  Database database = parse(text, "test.dbc");
  EXPECT_EQ(told(database), "");
  return database;
}

const Signal& signal_in(const Database& database, std::string_view message, std::string_view name) {
  static const Signal kNone;
  const Message* const found = database.find_message(message);
  const Signal* const signal = found == nullptr ? nullptr : found->find_signal(name);
  EXPECT_NE(signal, nullptr) << message << '.' << name;
  return signal == nullptr ? kNone : *signal;
}

// A message and its signals are read with everything in their lines.
TEST(DbcParser, ReadsMessagesAndSignals) {
  const Database database =
      parse_clean("VERSION \"\"\n\nNS_ :\n\tCM_\n\tBA_\n\nBS_:\n\nBU_: ECU\n" + kGyro);
  ASSERT_EQ(database.messages.size(), 1U);
  const Message& message = database.messages[0];
  EXPECT_EQ(message.name, "GYRO");
  EXPECT_EQ(message.id, 0x123U);
  EXPECT_FALSE(message.extended);
  EXPECT_FALSE(message.is_j1939);
  EXPECT_EQ(message.size_bytes, 8);
  EXPECT_EQ(message.sender, "ECU");
  EXPECT_EQ(message.line, 10U);
  ASSERT_EQ(message.signals.size(), 2U);
  const Signal& rate = message.signals[0];
  EXPECT_EQ(rate.name, "Rate");
  EXPECT_EQ(rate.start_bit, 0);
  EXPECT_EQ(rate.length_bits, 16);
  EXPECT_EQ(rate.byte_order, ByteOrder::kIntel);
  EXPECT_EQ(rate.type, ValueType::kSigned);
  EXPECT_EQ(rate.factor, 0.005);
  EXPECT_EQ(rate.offset, -163.84);
  EXPECT_EQ(rate.minimum, -160);
  EXPECT_EQ(rate.maximum, 160);
  EXPECT_EQ(rate.unit, "deg/s");
  EXPECT_EQ(rate.line, 11U);
  EXPECT_FALSE(rate.is_multiplexor);
  EXPECT_FALSE(rate.condition);
}

// Windows line ends, a byte order mark and cp1252 bytes are converted.
TEST(DbcParser, ReadsFilesOfWindowsTools) {
  const Database database = parse_clean(
      "\xEF\xBB\xBFVERSION \"1\"\r\n\r\nBO_ 1 M: 8 E\r\n SG_ S : 7|8@0+ (1,0) [0|0] \"\xC2\xB0/s\" "
      "E\r\n");
  EXPECT_EQ(signal_in(database, "M", "S").unit, "°/s");
  const Database cp1252 = parse_clean(
      "BO_ 1 M: 8 E\r\n SG_ S : 7|8@0+ (1,0) [0|0] \"\xB0/s\" E\r\n"
      "CM_ SG_ 1 S \"gr\xF6\xDF"
      "er\r\nals\";\r\n");
  EXPECT_EQ(signal_in(cp1252, "M", "S").unit, "°/s");
  EXPECT_EQ(signal_in(cp1252, "M", "S").comment, "größer\nals");
  EXPECT_EQ(signal_in(cp1252, "M", "S").byte_order, ByteOrder::kMotorola);
}

// Texts may hold newlines, escaped quotes, semicolons and text that looks like statements.
TEST(DbcParser, ReadsTextsOverSeveralLines) {
  const Database database = parse_clean(
      kGyro + "CM_ BO_ 291 \"first; \\\"second\\\"\nBO_ 5 X: 8 Y\nSG_ no statement\";\n" +
      "CM_ SG_ 291 Rate \"ends in a backslash \\\\\" ;\nCM_ \"file\";\nCM_ BU_ ECU \"node\";\n");
  EXPECT_EQ(database.messages.size(), 1U);
  EXPECT_EQ(database.messages[0].comment, "first; \"second\"\nBO_ 5 X: 8 Y\nSG_ no statement");
  EXPECT_EQ(signal_in(database, "GYRO", "Rate").comment, "ends in a backslash \\\\");
}

// Comments, labels and float types may precede the message that they refer to.
TEST(DbcParser, ReadsSectionsOutOfOrder) {
  const Database database = parse_clean(
      "CM_ SG_ 291 Status \"of the unit\";\nVAL_ 291 Status 0 \"ok\" 1 \"bad\" ;\n"
      "SIG_VALTYPE_ 5 F : 1;\nSG_MUL_VAL_ 5 F M 1-2;\n" +
      kGyro +
      "BO_ 5 X: 8 E\n SG_ F m1 : 8|32@1- (1,0) [0|0] \"\" E\n"
      " SG_ M M : 0|8@1+ (1,0) [0|0] \"\" E\n");
  EXPECT_EQ(signal_in(database, "GYRO", "Status").comment, "of the unit");
  EXPECT_EQ(*signal_in(database, "GYRO", "Status").label(1), "bad");
  EXPECT_EQ(signal_in(database, "X", "F").type, ValueType::kFloat32);
  EXPECT_EQ(signal_in(database, "X", "F").condition->ranges.size(), 1U);
  EXPECT_EQ(signal_in(database, "X", "F").condition->ranges[0].second, 2U);
}

// Numbers are read in all writers' spellings; names may begin with a digit.
TEST(DbcParser, ReadsOddNumbersAndNames) {
  const Database database = parse_clean(
      "BO_ 1 2nd_Message: 8 3rdEcu\n SG_ 4x4 : 0|8@1+ (.25,-.5) [-1E+002|+1e2] \"\" E\n"
      " SG_ B:8|8@1+(1E-006,1.)[0|0]\"\"E\n");
  EXPECT_EQ(signal_in(database, "2nd_Message", "4x4").factor, 0.25);
  EXPECT_EQ(signal_in(database, "2nd_Message", "4x4").offset, -0.5);
  EXPECT_EQ(signal_in(database, "2nd_Message", "4x4").minimum, -100);
  EXPECT_EQ(signal_in(database, "2nd_Message", "4x4").maximum, 100);
  EXPECT_EQ(signal_in(database, "2nd_Message", "B").factor, 1e-6);
  EXPECT_EQ(signal_in(database, "2nd_Message", "B").offset, 1.0);
}

// A range beyond all doubles counts as none; a scale beyond them removes the signal.
TEST(DbcParser, ReadsNumbersBeyondAllDoubles) {
  const Database database = parse(
      "BO_ 1 M: 8 E\n SG_ A : 0|8@1+ (1,0) [-1E999|1E999] \"\" E\n"
      " SG_ B : 8|8@1+ (1E999,0) [0|0] \"\" E\n SG_ C : 16|8@1+ (1,1E-999) [0|0] \"\" E\n",
      "test.dbc");
  EXPECT_EQ(signal_in(database, "M", "A").minimum, 0.0);
  EXPECT_EQ(signal_in(database, "M", "A").maximum, 0.0);
  EXPECT_EQ(signal_in(database, "M", "C").offset, 0.0);
  EXPECT_EQ(told(database), "3: the scaling of signal B is beyond all numbers\n");
}

// Infinity and NaN are words, not numbers.
TEST(DbcParser, RefusesInfinityAndNanAsNumbers) {
  for (const char* const number : {"inf", "-inf", "nan", "-nan", "+", "-", "--1", "0x"}) {
    const Database database = parse(
        fmt::format("BO_ 1 M: 8 E\n SG_ A : 0|8@1+ ({},0) [0|0] \"\" E\n", number), "test.dbc");
    EXPECT_TRUE(database.messages[0].signals.empty()) << number;
    EXPECT_EQ(database.diagnostics.size(), 1U) << number;
  }
}

// Identifiers with bit 31 have 29 bits. Larger ones than 0x7FF without it are read so too, and
// reported.
TEST(DbcParser, ReadsIdentifiers) {
  const Database database = parse(
      "BO_ 2364549858 A: 8 E\nBO_ 2048 B: 8 E\nBO_ 2047 C: 8 E\nBO_ 2147483649 D: 8 E\n"
      "BO_ 3758096385 E: 8 E\nCM_ BO_ 2048 \"found\";\n",
      "test.dbc");
  ASSERT_EQ(database.messages.size(), 5U);
  EXPECT_EQ(database.messages[0].id, 0x0CF02AE2U);
  EXPECT_TRUE(database.messages[0].extended);
  EXPECT_EQ(database.messages[1].id, 0x800U);
  EXPECT_TRUE(database.messages[1].extended);
  EXPECT_EQ(database.messages[1].comment, "found");
  EXPECT_FALSE(database.messages[2].extended);
  EXPECT_EQ(database.messages[3].id, 1U);
  EXPECT_TRUE(database.messages[3].extended);
  EXPECT_EQ(told(database),
            "2: identifier 2048 of message B is above 0x7FF without bit 31; taken as extended\n"
            "5: identifier 3758096385 of message E has more than 29 bits; taken as 0x1\n"
            "5: message E has the identifier of message D\n");
}

// The pseudo-message for signals without a message is skipped with everything that refers to it.
TEST(DbcParser, PassesOverThePseudoMessage) {
  const Database database = parse_clean(
      "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n"
      " SG_ Lost : 0|8@1+ (1,0) [0|0] \"\" Vector__XXX\n\n" +
      kGyro +
      "CM_ SG_ 3221225472 Lost \"x\";\nVAL_ 3221225472 Lost 0 \"x\" ;\n"
      "BA_ \"VFrameFormat\" BO_ 3221225472 3;\nSIG_VALTYPE_ 3221225472 Lost : 1;\n");
  EXPECT_EQ(database.message_names(), std::vector<std::string>{"GYRO"});
}

// An odd line is skipped and reported with its number; everything else is kept.
TEST(DbcParser, KeepsTheRestAfterAnOddLine) {
  const Database database = parse(
      "BO_ 1 M: 8 E\n"
      " SG_ A : 0|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ B : zero|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ C : 8|8@1+ (1,0) [0|0] \"no end E\n"
      " SG_ D : 8|8@2+ (1,0) [0|0] \"\" E\n"
      "BO_ X Y: 8 E\n"
      " SG_ Z : 8|8@1+ (1,0) [0|0] \"\" E\n"
      "BO_ 2 N: 8 E\n"
      " SG_ A : 16|8@1+ (1,0) [0|0] \"\" E\n"
      "nonsense 17 ;\n"
      "CM_ SG_ 1 A \"an \"inner\" quote\";\n"
      "VAL_ 1 A 0 \"ok\" 1 \"bad\" ;\n",
      "test.dbc");
  EXPECT_EQ(database.message_names(), (std::vector<std::string>{"M", "N"}));
  EXPECT_EQ(database.messages[0].signal_names(), std::vector<std::string>{"A"});
  EXPECT_EQ(database.messages[1].signal_names(), std::vector<std::string>{"A"});
  EXPECT_EQ(signal_in(database, "M", "A").labels.size(), 2U);
  EXPECT_EQ(told(database),
            "3: expected the start bit, found 'zero'\n"
            "4: the quotes around the unit are not closed\n"
            "5: the byte order 2 is above 1\n"
            "6: expected the identifier of a message, found 'X'\n"
            "10: 'nonsense' begins no section of a DBC file\n"
            "11: expected ';' after the statement, found 'inner'\n");
}

// A comment on a signal without its name is reported and ignored.
TEST(DbcParser, TellsCommentsWithoutSignalName) {
  const Database database =
      parse(kGyro + "CM_ SG_ 291 \"about what?\";\nCM_ BO_ 291 \"kept\";\n", "test.dbc");
  EXPECT_EQ(database.messages[0].comment, "kept");
  EXPECT_EQ(told(database), "4: this comment names no signal; ignored\n");
}

// References to missing elements are reported and ignored.
TEST(DbcParser, TellsReferencesToNothing) {
  const Database database = parse(kGyro +
                                      "VAL_ 291 Rat 0 \"x\" ;\nVAL_ 292 Rate 0 \"x\" ;\n"
                                      "VAL_ 291 Rate Table ;\nSG_MUL_VAL_ 291 Rate Mux 0-1;\n",
                                  "test.dbc");
  EXPECT_EQ(told(database),
            "4: message GYRO has no signal Rat\n"
            "5: no message has the identifier 292\n"
            "6: there is no value table Table\n"
            "7: message GYRO has no signal Mux\n");
}

// Duplicates are reported. Two messages of one name are both kept, because their frames differ in
// more than the name; the second signal of a name in one message is dropped.
TEST(DbcParser, TellsDuplicates) {
  const Database database = parse(
      "BO_ 1 M: 8 E\n SG_ A : 0|8@1+ (1,0) [0|0] \"\" E\n SG_ A : 8|8@1+ (2,0) [0|0] \"\" E\n"
      "BO_ 2 M: 8 E\nBO_ 1 N: 8 E\nVAL_TABLE_ T 0 \"a\" ;\nVAL_TABLE_ T 0 \"b\" ;\n",
      "test.dbc");
  EXPECT_EQ(database.messages.size(), 3U);
  EXPECT_EQ(signal_in(database, "M", "A").factor, 1.0);
  EXPECT_EQ(told(database),
            "3: message M has a signal A already; this one is ignored\n"
            "4: there is a message M already; names find the first one\n"
            "5: message N has the identifier of message M\n"
            "7: there is a value table T already; this one is ignored\n");
}

// Labels come from the statement itself or from a table; labels of environment variables are
// ignored.
TEST(DbcParser, ReadsLabels) {
  const Database database = parse_clean("VAL_TABLE_ OnOff 1 \"on\" 0 \"off\" ;\n" + kGyro +
                                        "VAL_ 291 Status OnOff ;\nVAL_ 291 Rate -32768 "
                                        "\"in\nvalid\" 1.0 \"one\" 65535 \"minus one\" ;\n"
                                        "VAL_ Environment 0 \"x\" ;\n");
  EXPECT_EQ(*signal_in(database, "GYRO", "Status").label(1), "on");
  const Signal& rate = signal_in(database, "GYRO", "Rate");
  EXPECT_EQ(*rate.label(-32768), "in\nvalid");
  EXPECT_EQ(*rate.label(1), "one");
  EXPECT_EQ(*rate.label(-1), "minus one") << "the bit pattern of a signed signal";
}

// 64-bit unsigned labels above the signed range are kept as their bit pattern.
TEST(DbcParser, ReadsLabelsAbove2To63) {
  const Database database = parse_clean(
      "BO_ 1 M: 8 E\n SG_ A : 0|64@1+ (1,0) [0|0] \"\" E\n"
      "VAL_ 1 A 18446744073709551615 \"all\" ;\n");
  EXPECT_EQ(*signal_in(database, "M", "A").label(-1), "all");
}

// Float types are read with and without the colon.
TEST(DbcParser, ReadsFloatTypes) {
  const Database database = parse_clean(
      "BO_ 1 M: 16 E\n SG_ A : 7|32@0- (1,0) [0|0] \"\" E\n SG_ B : 64|64@1- (1,0) [0|0] \"\" E\n"
      " SG_ C : 32|8@1- (1,0) [0|0] \"\" E\n"
      "SIG_VALTYPE_ 1 A : 1;\nSIG_VALTYPE_ 1 B 2;\nSIG_VALTYPE_ 1 C : 0;\n");
  EXPECT_EQ(signal_in(database, "M", "A").type, ValueType::kFloat32);
  EXPECT_EQ(signal_in(database, "M", "B").type, ValueType::kFloat64);
  EXPECT_EQ(signal_in(database, "M", "C").type, ValueType::kSigned);
}

// m0 refers to the signal marked M, wherever that is in the message.
TEST(DbcParser, ReadsSimpleMultiplexing) {
  const Database database = parse_clean(
      "BO_ 1 M: 8 E\n SG_ A m0 : 8|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ B m17 : 8|8@1+ (1,0) [0|0] \"\" E\n SG_ Mux M : 0|8@1+ (1,0) [0|0] \"\" E\n");
  EXPECT_TRUE(signal_in(database, "M", "Mux").is_multiplexor);
  EXPECT_FALSE(signal_in(database, "M", "Mux").condition);
  const auto& condition = signal_in(database, "M", "B").condition;
  ASSERT_TRUE(condition);
  EXPECT_EQ(condition->multiplexor, "Mux");
  EXPECT_EQ(condition->ranges, (decltype(condition->ranges){{17, 17}}));
}

// Extended multiplexing: SG_MUL_VAL_ names the multiplexor and several ranges, and overrides m0.
TEST(DbcParser, ReadsExtendedMultiplexing) {
  const Database database = parse_clean(
      "BO_ 1 M: 8 E\n SG_ Outer M : 0|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ Inner m3M : 8|8@1+ (1,0) [0|0] \"\" E\n SG_ A m0 : 16|8@1+ (1,0) [0|0] \"\" E\n"
      "SG_MUL_VAL_ 1 Inner Outer 3-5, 9-9;\nSG_MUL_VAL_ 1 A Inner 0-0;\nSG_MUL_VAL_ 1 A Inner "
      "7-8;\n");
  EXPECT_TRUE(signal_in(database, "M", "Inner").is_multiplexor);
  const auto& inner = signal_in(database, "M", "Inner").condition;
  ASSERT_TRUE(inner);
  EXPECT_EQ(inner->multiplexor, "Outer");
  EXPECT_EQ(inner->ranges, (decltype(inner->ranges){{3, 5}, {9, 9}}));
  const auto& a = signal_in(database, "M", "A").condition;
  ASSERT_TRUE(a);
  EXPECT_EQ(a->multiplexor, "Inner");
  EXPECT_EQ(a->ranges, (decltype(a->ranges){{0, 0}, {7, 8}}));
}

// A multiplexed signal without a multiplexor is left out and reported, since its presence is
// unknown.
TEST(DbcParser, LeavesOutSignalsWithoutMultiplexor) {
  const Database database = parse(
      "BO_ 1 M: 8 E\n SG_ A m0 : 8|8@1+ (1,0) [0|0] \"\" E\n SG_ B : 16|8@1+ (1,0) [0|0] \"\" E\n"
      "BO_ 2 N: 8 E\n SG_ P M : 0|8@1+ (1,0) [0|0] \"\" E\n SG_ Q M : 8|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ A m0 : 16|8@1+ (1,0) [0|0] \"\" E\n",
      "test.dbc");
  EXPECT_EQ(database.messages[0].signal_names(), std::vector<std::string>{"B"});
  EXPECT_EQ(database.messages[1].signal_names(), (std::vector<std::string>{"P", "Q"}));
  EXPECT_EQ(told(database),
            "2: signal A is multiplexed but message M has no multiplexor; left out\n"
            "7: signal A is multiplexed but message N has several multiplexors; left out\n");
}

// Odd multiplexing marks and ranges are reported as odd lines.
TEST(DbcParser, TellsOddMultiplexing) {
  const Database database = parse(
      "BO_ 1 M: 8 E\n SG_ A mx : 8|8@1+ (1,0) [0|0] \"\" E\n SG_ B X : 8|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ C m1x : 8|8@1+ (1,0) [0|0] \"\" E\n SG_ D M : 0|8@1+ (1,0) [0|0] \"\" E\n"
      " SG_ E : 8|8@1+ (1,0) [0|0] \"\" E\nSG_MUL_VAL_ 1 E D 5-3;\n",
      "test.dbc");
  EXPECT_EQ(database.messages[0].signal_names(), (std::vector<std::string>{"D", "E"}));
  EXPECT_EQ(database.diagnostics.size(), 4U);
  EXPECT_FALSE(signal_in(database, "M", "E").condition);
}

// J1939 groups are recognised by the message's format, as number or label, or by the file's
// protocol.
TEST(DbcParser, KnowsJ1939Groups) {
  const std::string messages = "BO_ 2364549858 A: 8 E\nBO_ 2364550626 B: 8 E\nBO_ 5 C: 8 E\n";
  const std::string format =
      "BA_DEF_ BO_ \"VFrameFormat\" ENUM "
      "\"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n";
  const auto is_j1939 = [&](const std::string& attributes) {
    const Database database = parse_clean(messages + attributes);
    std::string flags;
    for (const Message& message : database.messages)
      flags += message.is_j1939 ? '1' : '0';
    return flags;
  };
  EXPECT_EQ(is_j1939(""), "000");
  EXPECT_EQ(is_j1939(format + "BA_ \"VFrameFormat\" BO_ 2364549858 3;\n"), "100");
  EXPECT_EQ(is_j1939("BA_ \"VFrameFormat\" BO_ 2364549858 3;\n"), "100");
  EXPECT_EQ(is_j1939(format + "BA_ \"VFrameFormat\" BO_ 2364550626 \"J1939PG\";\n"), "010");
  EXPECT_EQ(is_j1939(format + "BA_ \"VFrameFormat\" BO_ 2364549858 1;\n"), "000");
  EXPECT_EQ(is_j1939("BA_ \"ProtocolType\" \"J1939\";\n"), "110");
  EXPECT_EQ(is_j1939("BA_DEF_DEF_ \"ProtocolType\" \"J1939\";\n"), "110");
  EXPECT_EQ(is_j1939(format + "BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n"), "110");
  EXPECT_EQ(is_j1939(format +
                     "BA_ \"ProtocolType\" \"J1939\";\nBA_ \"VFrameFormat\" BO_ 2364549858 1;\n"),
            "010")
      << "what a message says of itself counts more";
  EXPECT_EQ(is_j1939("BA_DEF_ BO_ \"VFrameFormat\" ENUM \"J1939PG\",\"other\";\n"
                     "BA_ \"VFrameFormat\" BO_ 2364549858 0;\n"),
            "100")
      << "the file's own labels count more than the usual numbers";
}

// The same attribute marks CAN FD, with 11 and with 29 bits.
TEST(DbcParser, KnowsCanFdFrames) {
  const std::string messages = "BO_ 2364549858 A: 8 E\nBO_ 5 B: 8 E\nBO_ 6 C: 64 E\n";
  const std::string format =
      "BA_DEF_ BO_ \"VFrameFormat\" ENUM "
      "\"StandardCAN\",\"ExtendedCAN\",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\n";
  const auto is_fd = [&](const std::string& attributes) {
    const Database database = parse_clean(messages + attributes);
    std::string flags;
    for (const Message& message : database.messages)
      flags += message.is_fd ? '1' : '0';
    return flags;
  };
  EXPECT_EQ(is_fd(""), "001") << "no classic frame has 64 bytes";
  EXPECT_EQ(is_fd(format + "BA_ \"VFrameFormat\" BO_ 5 2;\n"), "011");
  EXPECT_EQ(is_fd("BA_ \"VFrameFormat\" BO_ 5 14;\nBA_ \"VFrameFormat\" BO_ 2364549858 15;\n"),
            "111");
  EXPECT_EQ(is_fd(format + "BA_DEF_DEF_ \"VFrameFormat\" \"ExtendedCAN_FD\";\n"
                           "BA_ \"VFrameFormat\" BO_ 5 0;\n"),
            "101");
}

// Sections that the product does not use are skipped silently.
TEST(DbcParser, PassesOverUnusedSections) {
  const Database database = parse_clean(
      "VERSION \"x\"\nNS_ :\n\tNS_DESC_\n\tCM_\n\tBA_DEF_\n\tSG_MUL_VAL_\n\nBS_: 500000 : "
      "1,2\nBU_: A B\n"
      "EV_ E: 0 [0|1] \"\" 0 2 DUMMY_NODE_VECTOR0 Vector__XXX;\nENVVAR_DATA_ E: 5;\n"
      "BO_TX_BU_ 291 : A,B;\nSIG_GROUP_ 291 G 1 : Rate Status;\nBA_DEF_ \"BusType\" STRING ;\n"
      "BA_DEF_ SG_ \"GenSigStartValue\" FLOAT 0 1;\nBA_DEF_REL_ BU_SG_REL_ \"X\" INT 0 1;\n"
      "BA_DEF_DEF_REL_ \"X\" 0;\nBA_ \"GenSigStartValue\" SG_ 291 Rate 1.5;\n"
      "BA_ \"NodeX\" BU_ A 1;\nBA_ \"DbComment\" \"two\nlines\";\nBA_REL_ \"X\" BU_SG_REL_ A SG_ "
      "291 Rate 1;\n"
      "CM_ EV_ E \"x\";\n" +
      kGyro);
  EXPECT_EQ(database.messages.size(), 1U);
}

// A missing semicolon before the next statement is reported and has no other effect.
TEST(DbcParser, ForgivesAForgottenSemicolon) {
  const Database database = parse(kGyro + "CM_ BO_ 291 \"text\"\nVAL_ 291 Status 0 \"ok\"\n", "t");
  EXPECT_EQ(database.messages[0].comment, "text");
  EXPECT_EQ(signal_in(database, "GYRO", "Status").labels.size(), 1U);
  EXPECT_EQ(told(database),
            "4: the statement does not end in ';'\n5: the statement does not end in ';'\n");
}

// A thousand odd lines give a hundred diagnostics and the number of the others.
TEST(DbcParser, CountsDiagnosticsBeyondTheFirstHundred) {
  std::string text = kGyro;
  for (int i = 0; i < 1000; ++i)
    text += " SG_ odd\n";
  const Database database = parse(text, "test.dbc");
  ASSERT_EQ(database.diagnostics.size(), 101U);
  EXPECT_EQ(database.diagnostics.back().what, "and 900 more");
  EXPECT_EQ(database.diagnostics.back().line, 104U);
}

// A file can be cut anywhere without harm: statements before the cut are kept.
TEST(DbcParser, SurvivesEveryTruncation) {
  const std::string text = kGyro +
                           "CM_ SG_ 291 Rate \"te\\\"xt\nmore\";\nVAL_ 291 Status 0 \"ok\" ;\n"
                           "SG_MUL_VAL_ 291 Rate Status 0-1, 5-5;\nSIG_VALTYPE_ 291 Rate : 1;\n"
                           "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"A\",\"B\";\n"
                           "BA_ \"VFrameFormat\" BO_ 291 3;\n";
  for (std::size_t length = 0; length <= text.size(); ++length) {
    const Database database = parse(std::string_view{text}.substr(0, length), "test.dbc");
    EXPECT_LE(database.messages.size(), 1U);
  }
}

/// Processor time, which does not depend on the load of the machine.
double seconds_to_parse(const std::string& text) {
  const std::clock_t start = std::clock();
  static_cast<void>(parse(text, "test.dbc"));
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

std::string repeated(const std::string& part, std::size_t times) {
  std::string text = "BO_ 1 M: 8 E\n SG_ A : 0|8@1+ (1,0) [0|0] \"\" E\n";
  for (std::size_t i = 0; i < times; ++i)
    text += part;
  return text;
}

// Texts made to be slow: eight times the text may take somewhat more than eight times as long
// (maps, caches), but far less than the 64 times of a quadratic reader.
TEST(DbcParser, ReadsHostileTextInLinearTime) {
  for (const std::string part :
       {"CM_ \"", "CM_ \"\n", "VAL_ 1 A 0 \"\n", "VAL_ 1 A 0 \" 0 \"\n", "SIG_GROUP_\n",
        "VAL_ 1 A \n", "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"a\",\n", "SG_MUL_VAL_ 1 A A 0-1,\n",
        "((((", "\\\"", "NS_ :\nX\n", "BO_ 1 M: 8 E\n", " SG_ A : 0|8@1+ (1,0) [0|0] \"\" E\n",
        "BA_ \"x\" 1", "CM_ SG_ 1 A \"\\\"\n"}) {
    constexpr std::size_t kTimes = 4000;
    const double once = seconds_to_parse(repeated(part, kTimes));
    const double eightfold = seconds_to_parse(repeated(part, 8 * kTimes));
    EXPECT_LT(eightfold, 24 * once + 0.05) << part;
  }
}

// A large value table to which very many signals refer does not fill the memory.
TEST(DbcParser, BoundsCopiesOfValueTables) {
  std::string text = "VAL_TABLE_ T";
  for (int i = 0; i < 20000; ++i)
    text += fmt::format(" {} \"{}\"", i, std::string(40, 'x'));
  text += " ;\nBO_ 1 M: 8 E\n";
  for (int i = 0; i < 1000; ++i)
    text += fmt::format(" SG_ S{} : 0|8@1+ (1,0) [0|0] \"\" E\n", i);
  for (int i = 0; i < 1000; ++i)
    text += fmt::format("VAL_ 1 S{} T ;\n", i);
  const Database database = parse(text, "test.dbc");
  std::size_t labels = 0;
  for (const Signal& signal : database.messages[0].signals)
    labels += signal.labels.size();
  EXPECT_GT(labels, 20000U);
  EXPECT_LT(labels, 2000000U);
}

// A file without messages is an error that names the first place where reading failed.
TEST(DbcLoad, RefusesFilesWithoutMessages) {
  const auto missing = load("/nonexistent/a.dbc");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().where, "/nonexistent/a.dbc");
  const std::string path = testing::TempDir() + "/no_messages.dbc";
  std::FILE* const file = std::fopen(path.c_str(), "w");
  ASSERT_NE(file, nullptr);
  std::fputs("VERSION \"\"\nPK\x03\x04\n", file);
  std::fclose(file);
  const auto empty = load(path);
  ASSERT_FALSE(empty);
  EXPECT_EQ(empty.error().where, path + ":2");
}

// The start value is the signal's own, or the default of the file. Values of signals that were
// removed from the file are not reported.
TEST(DbcParser, ReadsStartValues) {
  const std::string defined =
      "BA_DEF_ SG_ \"GenSigStartValue\" FLOAT -1E9 1E9;\n"
      "BA_DEF_DEF_ \"GenSigStartValue\" 7;\n";
  const Database database = parse_clean(kGyro + defined +
                                        "BA_ \"GenSigStartValue\" SG_ 291 Rate -32768;\n"
                                        "BA_ \"GenSigStartValue\" SG_ 291 Gone 3;\n"
                                        "BA_ \"GenSigStartValue\" SG_ 999 Rate 3;\n");
  EXPECT_EQ(signal_in(database, "GYRO", "Rate").start_raw, -32768.0);
  EXPECT_EQ(signal_in(database, "GYRO", "Status").start_raw, 7.0);
  const Database without = parse_clean(kGyro + "BA_ \"GenSigStartValue\" SG_ 291 Status \"3\";\n");
  EXPECT_EQ(signal_in(without, "GYRO", "Rate").start_raw, std::nullopt);
  EXPECT_EQ(signal_in(without, "GYRO", "Status").start_raw, 3.0);
  const Database words = parse_clean(kGyro + "BA_ \"GenSigStartValue\" SG_ 291 Status none;\n");
  EXPECT_EQ(signal_in(words, "GYRO", "Status").start_raw, std::nullopt);
}

// --- Shift JIS -----------------------------------------------------------------------------------

// The second byte of some characters is a backslash, which seems to escape the quote after it: 表
// is 0x95 0x5C, 能 is 0x94 0x5C.
TEST(DbcParser, ReadsTextsThatEndInABackslashOfShiftJis) {
  const Database database =
      parse_clean(kGyro +
                  "CM_ SG_ 291 Status \"\x95\\\";\n"
                  "CM_ SG_ 291 Rate \"rate\";\n"
                  "VAL_ 291 Status 0 \"\x8B@\x94\\\" 1 \"ok\" 2 \"\x95\\\" ;\n"
                  "BA_DEF_ BO_ \"X\" INT 0 1;\n"
                  "CM_ BO_ 291 \"\x94\\\";");
  const Signal& status = signal_in(database, "GYRO", "Status");
  EXPECT_EQ(status.comment, "•\\");
  EXPECT_EQ(signal_in(database, "GYRO", "Rate").comment, "rate");
  ASSERT_EQ(status.labels.size(), 3U);
  EXPECT_EQ(status.labels[0].text, "‹@”\\");
  EXPECT_EQ(status.labels[1].text, "ok");
  EXPECT_EQ(status.labels[2].text, "•\\");
  EXPECT_EQ(database.messages[0].comment, "”\\");
}

TEST(DbcParser, StillTakesEscapedQuotesForQuotes) {
  const Database database = parse_clean(kGyro +
                                        "CM_ SG_ 291 Rate \"called \\\"rate\\\"\";\n"
                                        "VAL_ 291 Status 0 \"\\\"\" 1 \"say \\\"on\\\"\" ;\n");
  EXPECT_EQ(signal_in(database, "GYRO", "Rate").comment, "called \"rate\"");
  const Signal& status = signal_in(database, "GYRO", "Status");
  ASSERT_EQ(status.labels.size(), 2U);
  EXPECT_EQ(status.labels[0].text, "\"");
  EXPECT_EQ(status.labels[1].text, "say \"on\"");
}

// A unit in Shift JIS loses no signal; a statement that parses neither way is reported once, with
// its first error.
TEST(DbcParser, TriesTheOtherMeaningOfABackslashOnce) {
  const Database unit = parse_clean(
      "BO_ 291 GYRO: 8 ECU\n SG_ Rate : 0|16@1- (1,0) [0|0] \"\x95\\\" ECU\n"
      " SG_ Next : 16|8@1- (1,0) [0|0] \"\" ECU\n");
  EXPECT_EQ(signal_in(unit, "GYRO", "Rate").unit, "•\\");
  EXPECT_EQ(signal_in(unit, "GYRO", "Next").start_bit, 16);
  const Database broken = parse(kGyro + "CM_ SG_ 291 Rate \"a\\\" b;\n", "test.dbc");
  ASSERT_EQ(broken.diagnostics.size(), 1U);
  EXPECT_EQ(broken.diagnostics[0].line, 4U);
}

// --- long names ----------------------------------------------------------------------------------

TEST(DbcParser, FindsMessagesAndSignalsByTheirLongNamesToo) {
  const Database database = parse_clean(
      "BA_ \"SystemSignalLongSymbol\" SG_ 291 Rate \"RateAroundTheVerticalAxisFiltered\";\n" +
      kGyro +
      "BA_DEF_ BO_ \"SystemMessageLongSymbol\" STRING ;\n"
      "BA_DEF_DEF_ \"SystemMessageLongSymbol\" \"\";\n"
      "BA_ \"SystemMessageLongSymbol\" BO_ 291 \"GYRO_OF_THE_LEFT_FRONT_AXLE_REPEATED\";\n"
      "BA_ \"GenSigStartValue\" SG_ 291 Status 3;\n");
  const Message* const message = database.find_message("GYRO_OF_THE_LEFT_FRONT_AXLE_REPEATED");
  ASSERT_NE(message, nullptr);
  EXPECT_EQ(message, database.find_message("GYRO"));
  EXPECT_EQ(message->find_signal("RateAroundTheVerticalAxisFiltered"),
            message->find_signal("Rate"));
  EXPECT_NE(message->find_signal("Rate"), nullptr);
  EXPECT_EQ(message->find_signal(""), nullptr);
  EXPECT_EQ(database.message_names(),
            (std::vector<std::string>{"GYRO", "GYRO_OF_THE_LEFT_FRONT_AXLE_REPEATED"}));
  EXPECT_EQ(message->signal_names(),
            (std::vector<std::string>{"Rate", "Status", "RateAroundTheVerticalAxisFiltered"}));
}

// A name in the file takes precedence over the long name of another signal.
TEST(DbcParser, PrefersNamesToLongNames) {
  const Database database =
      parse_clean(kGyro + "BA_ \"SystemSignalLongSymbol\" SG_ 291 Rate \"Status\";\n");
  EXPECT_EQ(database.find_message("GYRO")->find_signal("Status")->name, "Status");
}

// --- NMEA 2000 -----------------------------------------------------------------------------------

TEST(DbcParser, KnowsWhoseCodesAMessageHas) {
  const std::string messages =
      "BO_ 2314277886 TURN: 8 X\nBO_ 2364549886 ARI: 8 X\nBO_ 256 PLAIN: 8 X\n";
  const std::string j1939 = "BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n";
  const Database truck = parse_clean(messages + j1939);
  EXPECT_EQ(truck.messages[0].codes, CodeRules::kNmea2000);
  EXPECT_EQ(truck.messages[1].codes, CodeRules::kJ1939);
  EXPECT_EQ(truck.messages[2].codes, CodeRules::kNone);
  const Database boat = parse_clean(messages + "BA_ \"ProtocolType\" \"NMEA2000\";\n");
  EXPECT_TRUE(boat.messages[1].is_j1939) << "its frames are J1939's";
  EXPECT_EQ(boat.messages[1].codes, CodeRules::kNmea2000);
  EXPECT_EQ(boat.messages[2].codes, CodeRules::kNone);
  EXPECT_EQ(parse_clean(messages).messages[0].codes, CodeRules::kNone);
}

}  // namespace
}  // namespace vgyro::dbc
