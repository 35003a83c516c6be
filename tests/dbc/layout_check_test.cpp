#include "dbc/layout_check.h"

#include <string>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "dbc/codec.h"
#include "dbc/parser.h"

namespace vgyro::dbc {
namespace {

std::string told(const std::string& signals, unsigned size = 8) {
  const Database database = parse(fmt::format("BO_ 1 M: {} E\n{}", size, signals), "test.dbc");
  std::string text;
  for (const Diagnostic& odd : database.diagnostics) {
    text += fmt::format("{}: {}\n", odd.line, odd.what);
  }
  return text;
}

// A signal outside of its frame is reported and kept, but no codec can be made for it.
TEST(LayoutCheck, TellsSignalsOutsideOfTheFrame) {
  const Database database = parse(
      "BO_ 1 M: 2 E\n SG_ A : 8|9@1+ (1,0) [0|0] \"\" E\n SG_ B : 0|8@1+ (1,0) [0|0] \"\" E\n",
      "test.dbc");
  ASSERT_EQ(database.diagnostics.size(), 1U);
  EXPECT_EQ(database.diagnostics[0].line, 2U);
  EXPECT_EQ(database.diagnostics[0].what, "signal A of message M ends in byte 2 of 2 bytes");
  ASSERT_EQ(database.messages[0].signals.size(), 2U);
  EXPECT_FALSE(SignalCodec::make(database.messages[0].signals[0], 2, "here"));
  EXPECT_TRUE(SignalCodec::make(database.messages[0].signals[1], 2, "here"));
}

// Reports lengths and scales that lose every value.
TEST(LayoutCheck, TellsUnreadableLengthsAndScales) {
  EXPECT_EQ(told(" SG_ A : 0|0@1+ (1,0) [0|0] \"\" E\n"),
            "2: signal A of message M is 0 bits long; 1 to 64 can be read\n");
  EXPECT_EQ(told(" SG_ A : 0|65@1+ (1,0) [0|0] \"\" E\n", 16),
            "2: signal A of message M is 65 bits long; 1 to 64 can be read\n");
  EXPECT_EQ(told(" SG_ A : 0|8@1+ (0,0) [0|0] \"\" E\n"),
            "2: signal A of message M has scale 0: all its values are the same\n");
  EXPECT_EQ(told(" SG_ A : 0|16@1- (1,0) [0|0] \"\" E\nSIG_VALTYPE_ 1 A : 1;\n"),
            "2: signal A of message M is a float of 16 bits; 32 or 64 can be read\n");
}

// A negative scale is normal; a minimum above the maximum is reported, and then there is no range.
TEST(LayoutCheck, TellsRangesTheWrongWayRound) {
  EXPECT_EQ(told(" SG_ A : 0|8@1+ (-1,0) [-255|0] \"\" E\n"), "");
  EXPECT_EQ(
      told(" SG_ A : 0|8@1+ (-1,0) [0|-255] \"\" E\n"),
      "2: signal A of message M has a minimum 0 above its maximum -255; the range is ignored\n");
}

// Each pair of overlapping signals is reported once, in both byte orders.
TEST(LayoutCheck, TellsOverlaps) {
  EXPECT_EQ(told(" SG_ A : 0|12@1+ (1,0) [0|0] \"\" E\n SG_ B : 15|4@0+ (1,0) [0|0] \"\" E\n"), "");
  EXPECT_EQ(told(" SG_ A : 0|13@1+ (1,0) [0|0] \"\" E\n SG_ B : 15|4@0+ (1,0) [0|0] \"\" E\n"),
            "3: signal B of message M overlaps A\n");
  EXPECT_EQ(told(" SG_ A : 7|12@0+ (1,0) [0|0] \"\" E\n SG_ B : 8|4@1+ (1,0) [0|0] \"\" E\n"), "");
  EXPECT_EQ(
      told(" SG_ A : 500|12@1+ (1,0) [0|0] \"\" E\n SG_ B : 511|1@1+ (1,0) [0|0] \"\" E\n", 64),
      "3: signal B of message M overlaps A\n");
}

// Multiplexed signals may share bits, unless they are present at the same time.
TEST(LayoutCheck, LetsMultiplexedSignalsShareBits) {
  const std::string multiplexor = " SG_ X M : 0|8@1+ (1,0) [0|0] \"\" E\n";
  EXPECT_EQ(told(multiplexor + " SG_ A m0 : 8|8@1+ (1,0) [0|0] \"\" E\n"
                               " SG_ B m1 : 8|8@1+ (1,0) [0|0] \"\" E\n"),
            "");
  EXPECT_EQ(told(multiplexor + " SG_ A m1 : 8|8@1+ (1,0) [0|0] \"\" E\n"
                               " SG_ B m1 : 8|8@1+ (1,0) [0|0] \"\" E\n"),
            "4: signal B of message M overlaps another one with the same multiplexor value\n");
  EXPECT_EQ(told(multiplexor + " SG_ A m1 : 7|8@1+ (1,0) [0|0] \"\" E\n"),
            "3: signal A of message M overlaps X\n");
}

}  // namespace
}  // namespace vgyro::dbc
