// Written files read back unchanged: the product's own, and odd ones.

#include "dbc/writer.h"

#include <string>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "dbc/parser.h"

namespace vgyro::dbc {
namespace {

void expect_same(const Signal& a, const Signal& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.start_bit, b.start_bit);
  EXPECT_EQ(a.length_bits, b.length_bits);
  EXPECT_EQ(a.byte_order, b.byte_order);
  EXPECT_EQ(a.type, b.type);
  EXPECT_EQ(a.factor, b.factor);
  EXPECT_EQ(a.offset, b.offset);
  EXPECT_EQ(a.minimum, b.minimum);
  EXPECT_EQ(a.maximum, b.maximum);
  EXPECT_EQ(a.unit, b.unit);
  EXPECT_EQ(a.comment, b.comment);
  ASSERT_EQ(a.labels.size(), b.labels.size());
  for (std::size_t i = 0; i < a.labels.size(); ++i) {
    EXPECT_EQ(a.labels[i].raw, b.labels[i].raw);
    EXPECT_EQ(a.labels[i].text, b.labels[i].text);
  }
}

void expect_same(const Message& a, const Message& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.extended, b.extended);
  EXPECT_EQ(a.is_j1939, b.is_j1939);
  EXPECT_EQ(a.size_bytes, b.size_bytes);
  EXPECT_EQ(a.comment, b.comment);
  ASSERT_EQ(a.signals.size(), b.signals.size());
  for (std::size_t i = 0; i < a.signals.size(); ++i)
    expect_same(a.signals[i], b.signals[i]);
}

TEST(Writer, GivesBackTheProfilesAndVgyrosOwnMessages) {
  for (const char* const name : {"vgyro.dbc", "profiles/bosch_mm7.dbc", "profiles/ford_yaw.dbc",
                                 "profiles/honeywell_hg1120.dbc", "profiles/j1939_ari.dbc",
                                 "profiles/nmea2000_rate_of_turn.dbc", "profiles/oxts_rt.dbc",
                                 "profiles/racelogic_imu04.dbc", "profiles/sbg_ellipse.dbc",
                                 "profiles/vw_esp_02.dbc", "profiles/xsens_mti.dbc"}) {
    SCOPED_TRACE(name);
    const auto original = load(fmt::format("{}/{}", VGYRO_DBC_DIR, name));
    ASSERT_TRUE(original);
    const auto again = parse(to_text(original->messages, "a comment"), "again.dbc");
    EXPECT_TRUE(again.diagnostics.empty());
    ASSERT_EQ(again.messages.size(), original->messages.size());
    for (std::size_t i = 0; i < again.messages.size(); ++i)
      expect_same(original->messages[i], again.messages[i]);
  }
}

TEST(Writer, WritesSmallNumbersWithoutAnExponent) {
  Message message;
  message.name = "M";
  message.id = 0x123;
  message.size_bytes = 8;
  Signal signal;
  signal.name = "S";
  signal.length_bits = 32;
  signal.factor = 1e-9;
  signal.offset = -2.5e-7;
  signal.unit = "deg/s";
  signal.comment = "says \"so\" \\ more";
  message.signals = {signal};
  const std::string text = to_text({message}, "");
  EXPECT_NE(text.find(" SG_ S : 0|32@1+ (0.000000001,-0.00000025) [0|0] \"deg/s\" Vector__XXX\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("CM_ SG_ 291 S \"says 'so' / more\";\n"), std::string::npos) << text;
}

}  // namespace
}  // namespace vgyro::dbc
