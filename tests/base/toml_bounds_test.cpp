#include "base/toml_bounds.h"

#include <gtest/gtest.h>

#include "base/toml_reader.h"

namespace vgyro {
namespace {

std::string repeated(const std::string& piece, int times) {
  std::string text;
  for (int i = 0; i < times; ++i)
    text += piece;
  return text;
}

std::string brackets(int deep) {
  return repeated("[", deep) + repeated("]", deep);
}

std::string key(int parts) {
  return "a" + repeated(".a", parts - 1);
}

void expect_broken(const std::string& text, unsigned line, const std::string& what) {
  const auto table = parse_toml(text, "a.toml");
  ASSERT_FALSE(table) << what;
  EXPECT_EQ(table.error().where, at_line("a.toml", line));
  EXPECT_EQ(table.error().what, what);
  EXPECT_FALSE(table.error().remedy.empty());
}

// The library's own limit is 256 nested values; it has none for keys.
TEST(TomlBounds, RefuseNestingFarBelowWhatTheLibraryBears) {
  static_assert(kTomlNestingMax * 10 < 256 && kTomlKeyPartsMax * 10 < 256);
  const std::string deep = "nests deeper than 16 brackets";
  EXPECT_TRUE(parse_toml("\na = " + brackets(kTomlNestingMax), "a.toml"));
  expect_broken("\na = " + brackets(kTomlNestingMax + 1), 2, deep);
  expect_broken("a = [\n" + repeated("[\n", 20), 1 + kTomlNestingMax, deep);
  expect_broken("a = " + repeated("{a=", 17) + "1" + repeated("}", 17), 1, deep);
  const std::string long_key = "has a key of more than 16 parts";
  EXPECT_TRUE(
      parse_toml("[" + key(kTomlKeyPartsMax) + "]\n" + key(kTomlKeyPartsMax) + " = 1\n", "a.toml"));
  expect_broken("\n\n[" + key(17) + "]\n", 3, long_key);
  expect_broken(key(17) + " = 1", 1, long_key);
  expect_broken("x = {" + key(17) + " = 1}", 1, long_key);
  expect_broken("\"a\"" + repeated(" . 'a'", 16) + " = 1", 1, long_key);
}

TEST(TomlBounds, RefuseLongLinesManyLinesAndMuchText) {
  const std::string line = "# " + repeated("x", static_cast<int>(kTomlLineBytesMax) - 2);
  EXPECT_TRUE(parse_toml("a = 1\n" + line + "\n", "a.toml"));
  expect_broken("a = 1\n" + line + "x\n", 2, "is longer than 8192 bytes");
  const std::string lines = repeated("\n", kTomlLinesMax - 1);
  EXPECT_TRUE(parse_toml(lines + "a = 1", "a.toml"));
  expect_broken(lines + "a = 1\n", kTomlLinesMax + 1, "has more than 20000 lines");
  const auto large = parse_toml(repeated("# " + repeated("x", 997) + "\n", 1049), "a.toml");
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().message().substr(0, 32), "a.toml: is larger than 1024 KiB;");
}

// Brackets and dots in strings and comments are only text, however the string ends.
TEST(TomlBounds, LookIntoNoStringAndNoComment) {
  const std::string many = repeated("[", 40) + repeated(".", 40);
  for (const std::string& text :
       {"# " + many, "a = \"" + many + "\"", "a = '" + many + "'", "a = \"\\\"" + many + "\"",
        "a = \"\"\"\n" + many + "\n\\\"\"\"" + many + "\"\"\"\"\"",
        "a = '''\n" + many + "''" + many + "'''", "a = \"\\\\\" # \"" + many,
        repeated("a = [1.5, 2.5]\n", 1)}) {
    EXPECT_TRUE(check_toml_shape(text, "a.toml")) << text;
    EXPECT_TRUE(parse_toml(text, "a.toml")) << text;
  }
}

// Everything that ends a comment or a string for the library ends it here.
TEST(TomlBounds, LookBehindWhateverEndsALine) {
  const std::string deep = repeated("[", kTomlNestingMax + 1);
  for (const char* before :
       {"# \xC2\x85 a = ", "# \xE2\x80\xA8 a = ", "# \xE2\x80\xA9 a = ", "# \r a = ", "a = \"\n",
        "a = 'x\n", "a = \"\\\n", "a = \"\"\"x\"\"\"\"\na = ", "a = '\\'\na = "}) {
    EXPECT_FALSE(check_toml_shape(before + deep, "a.toml")) << before;
  }
}

}  // namespace
}  // namespace vgyro
