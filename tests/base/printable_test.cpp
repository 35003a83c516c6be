#include "base/printable.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace vgyro {
namespace {

TEST(Printable, LeavesWhatPeopleWriteAsItIs) {
  for (const char* text : {"", "gyro left", "°/s, µ, √, 東, 🛰", "~ \\ ' \" `"}) {
    EXPECT_EQ(printable(text), text);
    EXPECT_EQ(printable_lines(text), text);
  }
}

TEST(Printable, ShowsWhatATerminalWouldObey) {
  EXPECT_EQ(printable("a\x1b[2Jb"), "a\\x1b[2Jb");
  EXPECT_EQ(printable(std::string_view("\0\a\b\t\r\n\x7f", 7)),
            "\\x00\\x07\\x08\\x09\\x0d\\x0a\\x7f");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\xc2\\x9b31m")
      << "U+009B is CSI";
}

TEST(Printable, ShowsBytesThatAreNoUtf8) {
  EXPECT_EQ(printable("\x9b"), "\\x9b");
  EXPECT_EQ(printable("\xc0\xaf"), "\\xc0\\xaf") << "overlong";
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond Unicode";
  EXPECT_EQ(printable("a\xe2\x82"), "a\\xe2\\x82") << "cut off";
}

TEST(Printable, KeepsLinesApartWhereThereAreSeveral) {
  EXPECT_EQ(printable_lines("a\nb\x1b\n"), "a\nb\\x1b\n");
}

// A file's name or a word in it cannot add lines to the programs' output.
TEST(Printable, MessagesOfErrorsAreOneLine) {
  const Error error{"evil\nerror: x:3", "there is no \x1b[31mred", "try\r\"blue\""};
  EXPECT_EQ(error.message(), "evil\\x0aerror: x:3: there is no \\x1b[31mred; try\\x0d\"blue\"");
}

}  // namespace
}  // namespace vgyro
