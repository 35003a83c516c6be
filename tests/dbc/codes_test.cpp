// Raw values that are not measurements, against the protocols' tables, computed by hand.

#include "dbc/codes.h"

#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

Signal signal_of(std::uint16_t bits, ValueType type = ValueType::kUnsigned) {
  Signal signal;
  signal.length_bits = bits;
  signal.type = type;
  signal.factor = 0.5;
  return signal;
}

// J1939-71: 0xFB to 0xFF in the top byte, whatever follows.
TEST(Codes, OfJ1939BeginWhereTheTopByteIsFb) {
  struct Case {
    std::uint16_t bits;
    std::uint64_t first;
    std::uint64_t last;
  };
  for (const Case& it :
       {Case{8, 0xFB, 0xFF}, Case{10, 0x3EC, 0x3FF}, Case{12, 0xFB0, 0xFFF},
        Case{16, 0xFB00, 0xFFFF}, Case{24, 0xFB0000, 0xFFFFFF}, Case{32, 0xFB000000, 0xFFFFFFFF},
        Case{64, 0xFB00000000000000, 0xFFFFFFFFFFFFFFFF}}) {
    const Codes codes = codes_of(signal_of(it.bits), CodeRules::kJ1939);
    EXPECT_EQ(codes.first, it.first) << it.bits;
    EXPECT_EQ(codes.last, it.last) << it.bits;
    EXPECT_FALSE(codes.contains(static_cast<std::int64_t>(it.first - 1))) << it.bits;
    EXPECT_TRUE(codes.contains(static_cast<std::int64_t>(it.last))) << it.bits;
  }
}

// Short fields are states. A signed -1 has all bits set, but is a measurement.
TEST(Codes, OfJ1939AreNoneInShortOrSignedSignalsAndFloats) {
  for (std::uint16_t bits = 1; bits < 8; ++bits)
    EXPECT_TRUE(codes_of(signal_of(bits), CodeRules::kJ1939).empty()) << bits;
  EXPECT_TRUE(codes_of(signal_of(16, ValueType::kSigned), CodeRules::kJ1939).empty());
  EXPECT_TRUE(codes_of(signal_of(32, ValueType::kFloat32), CodeRules::kJ1939).empty());
  EXPECT_TRUE(codes_of(signal_of(16), CodeRules::kNone).empty());
}

// The topmost values: in a signed number those below 0x80…, and no negative one.
TEST(Codes, OfNmea2000AreTheTopmostValues) {
  struct Case {
    std::uint16_t bits;
    ValueType type;
    std::uint64_t first;
    std::uint64_t last;
  };
  constexpr ValueType kS = ValueType::kSigned;
  constexpr ValueType kU = ValueType::kUnsigned;
  for (const Case& it :
       {Case{2, kU, 3, 3}, Case{3, kU, 7, 7}, Case{4, kU, 14, 15}, Case{8, kU, 0xFD, 0xFF},
        Case{8, kS, 0x7D, 0x7F}, Case{16, kU, 0xFFFD, 0xFFFF}, Case{16, kS, 0x7FFD, 0x7FFF},
        Case{24, kS, 0x7FFFFD, 0x7FFFFF}, Case{32, kS, 0x7FFFFFFD, 0x7FFFFFFF},
        Case{64, kS, 0x7FFFFFFFFFFFFFFD, 0x7FFFFFFFFFFFFFFF}}) {
    const Codes codes = codes_of(signal_of(it.bits, it.type), CodeRules::kNmea2000);
    EXPECT_EQ(codes.first, it.first) << it.bits;
    EXPECT_EQ(codes.last, it.last) << it.bits;
    EXPECT_FALSE(codes.contains(-1)) << it.bits;
  }
  EXPECT_TRUE(codes_of(signal_of(1), CodeRules::kNmea2000).empty());
  EXPECT_TRUE(codes_of(signal_of(2, kS), CodeRules::kNmea2000).empty());
}

TEST(Codes, SayWhatTheyMean) {
  const Signal word = signal_of(16);
  EXPECT_EQ(code_text(word, CodeRules::kJ1939, 0xFAFF), "");
  EXPECT_EQ(code_text(word, CodeRules::kJ1939, 0xFB00), "parameter specific");
  EXPECT_EQ(code_text(word, CodeRules::kJ1939, 0xFC00), "reserved");
  EXPECT_EQ(code_text(word, CodeRules::kJ1939, 0xFDFF), "reserved");
  EXPECT_EQ(code_text(word, CodeRules::kJ1939, 0xFE00), "error");
  EXPECT_EQ(code_text(word, CodeRules::kJ1939, 0xFF12), "not available");
  const Signal turn = signal_of(32, ValueType::kSigned);
  EXPECT_EQ(code_text(turn, CodeRules::kNmea2000, 0x7FFFFFFC), "");
  EXPECT_EQ(code_text(turn, CodeRules::kNmea2000, 0x7FFFFFFD), "reserved");
  EXPECT_EQ(code_text(turn, CodeRules::kNmea2000, 0x7FFFFFFE), "out of range");
  EXPECT_EQ(code_text(turn, CodeRules::kNmea2000, 0x7FFFFFFF), "not available");
}

// 127251 rate of turn, 130306 wind; 61482 angular rate, 65280 proprietary in both protocols.
TEST(Codes, GoByTheParameterGroupOrWhatTheFileSays) {
  EXPECT_EQ(code_rules_of(0x09F113FE, true, ""), CodeRules::kNmea2000);
  EXPECT_EQ(code_rules_of(0x09FD02FE, true, "J1939"), CodeRules::kNmea2000);
  EXPECT_EQ(code_rules_of(0x0CF02AFE, true, ""), CodeRules::kJ1939);
  EXPECT_EQ(code_rules_of(0x18FF00FE, true, ""), CodeRules::kJ1939);
  EXPECT_EQ(code_rules_of(0x18FF00FE, true, "NMEA 2000"), CodeRules::kNmea2000);
  EXPECT_EQ(code_rules_of(0x18FF00FE, true, "n2k"), CodeRules::kNmea2000);
  EXPECT_EQ(code_rules_of(0x09F113FE, false, ""), CodeRules::kNone) << "no J1939 message";
}

bool labelled(std::string_view text) {
  Signal signal = signal_of(12);
  signal.labels = {{0, "standing"}, {4095, std::string(text)}};
  EXPECT_FALSE(labelled_no_value(signal, 0)) << text;
  EXPECT_FALSE(labelled_no_value(signal, 17)) << text;
  return labelled_no_value(signal, 4095);
}

TEST(Labels, SayThatThereIsNoValue) {
  for (const char* text : {"invalid",
                           "Invalid",
                           "INVALID_VALUE",
                           "Signal invalid",
                           "invalid (0xFFF)",
                           "not valid",
                           "ungültig",
                           "Ungueltig",
                           "Wert ungültig",
                           "not_available",
                           "Not Available",
                           "NotAvailable",
                           "Signal not available",
                           "data not available",
                           "SNA",
                           "Signal Not Available (SNA)",
                           "N/A",
                           "n.a.",
                           "NA",
                           "unavailable",
                           "nicht verfügbar",
                           "Nicht_verfuegbar",
                           "NICHT VERFÜGBAR",
                           "Daten nicht verfügbar",
                           "No data",
                           "keine Daten",
                           "Error",
                           "Fehler",
                           "Sensor fault",
                           "error indicator"}) {
    EXPECT_TRUE(labelled(text)) << text;
  }
}

TEST(Labels, SayOtherThings) {
  for (const char* text : {"ok",
                           "valid",
                           "no error",
                           "kein Fehler",
                           "No fault",
                           "available",
                           "standing",
                           "N",
                           "A",
                           "max",
                           "7.5 ms or more",
                           "error counter overflow",
                           "invalidated once",
                           "Init",
                           "nation",
                           "not braking",
                           "not active",
                           "Fehlerspeicher leer",
                           "nicht betätigt",
                           ""}) {
    EXPECT_FALSE(labelled(text)) << text;
  }
}

// "invalid" beside "valid" is the meaning of a status, not a missing value.
TEST(Labels, OfAStatusAreItsValues) {
  Signal status = signal_of(2);
  status.labels = {{0, "valid"}, {1, "invalid"}, {3, "not available"}};
  EXPECT_FALSE(labelled_no_value(status, 1));
  EXPECT_TRUE(labelled_no_value(status, 3)) << "whether it is valid is not known";
  Signal merit = signal_of(2);
  merit.labels = {{0, "ok"}, {2, "error"}, {3, "not_available"}};
  EXPECT_FALSE(labelled_no_value(merit, 2));
  EXPECT_TRUE(labelled_no_value(merit, 3));
  Signal flag = signal_of(1);
  flag.labels = {{0, "invalid"}, {1, "usable"}};
  EXPECT_FALSE(labelled_no_value(flag, 0));
  Signal fitted = signal_of(2);
  fitted.labels = {{0, "not available"}, {1, "available"}};
  EXPECT_FALSE(labelled_no_value(fitted, 0));
}

// A counter of 8 bits uses the codes as values; a file whose range ends before them excludes them.
TEST(NoValues, LeavePlainNumbersAlone) {
  Signal counter = signal_of(8);
  counter.factor = 1.0;
  EXPECT_FALSE(NoValues(counter, CodeRules::kJ1939).contains(0xFF));
  counter.maximum = 255;
  EXPECT_FALSE(NoValues(counter, CodeRules::kJ1939).contains(0xFF));
  counter.maximum = 250;
  EXPECT_TRUE(NoValues(counter, CodeRules::kJ1939).contains(0xFB));
  EXPECT_FALSE(NoValues(counter, CodeRules::kJ1939).contains(250));
  counter.maximum = 252;
  EXPECT_FALSE(NoValues(counter, CodeRules::kJ1939).contains(252));
  EXPECT_TRUE(NoValues(counter, CodeRules::kJ1939).contains(253));
  counter.maximum = 0;
  counter.unit = "%";
  EXPECT_TRUE(NoValues(counter, CodeRules::kJ1939).contains(0xFB));
  EXPECT_FALSE(NoValues(counter, CodeRules::kNone).contains(0xFB));
}

}  // namespace
}  // namespace vgyro::dbc
