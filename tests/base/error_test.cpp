#include "base/error.h"

#include <gtest/gtest.h>

namespace vgyro {
namespace {

// Programs print errors in one form, so that editors and people find the place at once.
TEST(Error, TellsWhereWhatAndWhatWouldBeRight) {
  const Error error{"vgyro.toml:7", "\"windw_s\" is no key", "did you mean \"window_s\"?"};
  EXPECT_EQ(error.message(), "vgyro.toml:7: \"windw_s\" is no key; did you mean \"window_s\"?");
}

// Missing parts leave no punctuation behind.
TEST(Error, LeavesOutWhatIsEmpty) {
  EXPECT_EQ((Error{"", "no gyro", ""}.message()), "no gyro");
  EXPECT_EQ((Error{"", "no gyro", "add [[gyro]]"}.message()), "no gyro; add [[gyro]]");
  EXPECT_EQ((Error{"can0", "is down", ""}.message()), "can0: is down");
}

// A line number follows the file name as in compilers' errors, also beyond 16 bits.
TEST(Error, NamesALineAsCompilersDo) {
  EXPECT_EQ(at_line("a/b.dbc", 1), "a/b.dbc:1");
  EXPECT_EQ(at_line("b.dbc", 4'000'000'000), "b.dbc:4000000000");
}

// fail() makes an Expected of any type; the type does not matter for the error.
TEST(Error, TravelsInsideExpectedOfAnyType) {
  const Expected<int> number = fail("here", "wrong", "right");
  const Expected<std::string> text = fail("here", "wrong");
  ASSERT_FALSE(number);
  ASSERT_FALSE(text);
  EXPECT_EQ(number.error().message(), "here: wrong; right");
  EXPECT_EQ(text.error().message(), "here: wrong");
}

}  // namespace
}  // namespace vgyro
