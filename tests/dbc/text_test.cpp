#include "dbc/text.h"

#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

// Text of a Windows tool becomes UTF-8, also where cp1252 differs from Latin-1.
TEST(NormalisedText, TurnsCp1252IntoUtf8) {
  EXPECT_EQ(normalised("\xB0/s"), "°/s");
  EXPECT_EQ(normalised("\xB5V \x80"), "µV €");
  EXPECT_EQ(normalised("\x81"), "\xEF\xBF\xBD");
}

// UTF-8 text is unchanged.
TEST(NormalisedText, LeavesUtf8Alone) {
  EXPECT_EQ(normalised("°/s €"), "°/s €");
  EXPECT_EQ(normalised("\xF0\x9F\x8E\xA1"), "\xF0\x9F\x8E\xA1");
}

// The byte-order mark and carriage returns are removed; a lone carriage return also ends a line.
TEST(NormalisedText, DropsByteOrderMarkAndCarriageReturns) {
  EXPECT_EQ(normalised("\xEF\xBB\xBF"
                       "a\r\nb\rc\n"),
            "a\nb\nc\n");
  EXPECT_EQ(normalised(""), "");
  EXPECT_EQ(normalised("\r"), "\n");
}

// Overlong forms, surrogates, stray and missing continuation bytes are not UTF-8.
TEST(NormalisedText, KnowsMalformedUtf8) {
  for (const char* const bad : {"\xC0\x80", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80",
                                "\xF5\x80\x80\x80", "\x80", "\xC3", "\xE2\x82", "\xC3("}) {
    EXPECT_FALSE(is_utf8(bad)) << bad;
  }
  EXPECT_TRUE(is_utf8("\xF4\x8F\xBF\xBF"));
  EXPECT_TRUE(is_utf8("\xED\x9F\xBF"));
}

}  // namespace
}  // namespace vgyro::dbc
