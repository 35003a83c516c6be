// The effect of a later TOML file on an earlier one, and the recorded origin of each value.

#include "base/toml_merge.h"

#include <map>
#include <string>
#include <utility>

#include <gtest/gtest.h>

namespace vgyro {
namespace {

toml::table parsed(const std::string& text, const std::string& file) {
  return parse_toml(text, file, "remedy").value();
}

/// key → "value @ file:line"
std::map<std::string, std::string> merged(const std::string& earlier, const std::string& later) {
  toml::table table = parsed(earlier, "a.toml");
  merge_toml(table, parsed(later, "b.toml"));
  std::map<std::string, std::string> found;
  for (const TomlOrigin& origin : toml_origins(table))
    found[origin.key] = origin.value + " @ " + origin.where;
  return found;
}

using Found = std::map<std::string, std::string>;

TEST(TomlMerge, ATableIsMergedKeyByKey) {
  EXPECT_EQ(merged("[t]\nkept = 1\nchanged = 2\n", "[t]\n\nchanged = 3\nadded = 4\n"),
            (Found{{"t.kept", "1 @ " + at_line("a.toml", 2)},
                   {"t.changed", "3 @ " + at_line("b.toml", 3)},
                   {"t.added", "4 @ " + at_line("b.toml", 4)}}));
}

TEST(TomlMerge, ATableThatOnlyOneFileHasIsKept) {
  EXPECT_EQ(
      merged("[a]\nx = 1\n", "[b.c]\ny = 2\n"),
      (Found{{"a.x", "1 @ " + at_line("a.toml", 2)}, {"b.c.y", "2 @ " + at_line("b.toml", 2)}}));
}

TEST(TomlMerge, AListOfTablesIsMergedInItsOrder) {
  EXPECT_EQ(merged("[[g]]\nx = 1\n[[g]]\nx = 2\n", "[[g]]\n[[g]]\nx = 5\n[[g]]\nx = 6\n"),
            (Found{{"g[0].x", "1 @ " + at_line("a.toml", 2)},
                   {"g[1].x", "5 @ " + at_line("b.toml", 3)},
                   {"g[2].x", "6 @ " + at_line("b.toml", 5)}}));
}

TEST(TomlMerge, AListOfValuesTakesThePlaceOfTheOtherOne) {
  EXPECT_EQ(merged("x = [1, 2, 3]\n", "x = [4]\n"),
            (Found{{"x", "[ 4 ] @ " + at_line("b.toml", 1)}}));
}

TEST(TomlMerge, AValueOfAnotherTypeTakesThePlace) {
  EXPECT_EQ(merged("[x]\ny = 1\n", "x = 2\n"), (Found{{"x", "2 @ " + at_line("b.toml", 1)}}));
  EXPECT_EQ(merged("x = 2\n", "[x]\ny = true\n"),
            (Found{{"x.y", "true @ " + at_line("b.toml", 2)}}));
}

TEST(TomlMerge, AnEmptyFileChangesNothing) {
  EXPECT_EQ(merged("[t]\nx = 1\n", ""), (Found{{"t.x", "1 @ " + at_line("a.toml", 2)}}));
  EXPECT_EQ(merged("", "[t]\nx = 1\n"), (Found{{"t.x", "1 @ " + at_line("b.toml", 2)}}));
}

}  // namespace
}  // namespace vgyro
