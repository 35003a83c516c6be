#include "base/toml_reader.h"

#include <iterator>
#include <random>

#include <gtest/gtest.h>

namespace vgyro {
namespace {

// Comments and names contain °C and any language.
TEST(ParseToml, TakesAnyLetterInCommentsAndStrings) {
  const auto table = parse_toml(
      "# Кут: °/s, Ω — 😀\n"
      "name = \"лівий °\"  # °C\n"
      "other = 'straße'\n"
      "long = \"\"\"\nä\\\n  ö\"\"\"\n",
      "a.toml");
  ASSERT_TRUE(table) << table.error().message();
  EXPECT_EQ((*table)["name"].value<std::string>(), "лівий °");
  EXPECT_EQ((*table)["other"].value<std::string>(), "straße");
  EXPECT_EQ((*table)["long"].value<std::string>(), "äö");
  EXPECT_EQ((*table)["other"].node()->source().begin.line, 3U);
}

TEST(ParseToml, RefusesLettersWhereNoneCanStand) {
  const std::string bad[] = {"a = 1\nb = 25 °C\n", "a = 1\nb = 25°\n",    "a = 1\nшвидкість = 2\n",
                             "a = 1\nb = trueя\n", "a = 1\nb = [1, é]\n", "a = 1\n[é]\n"};
  for (const std::string& text : bad) {
    const auto table = parse_toml(text, "a.toml", "a remedy");
    ASSERT_FALSE(table) << text;
    EXPECT_EQ(table.error().where, "a.toml:2") << text;
    EXPECT_FALSE(table.error().what.empty()) << text;
    EXPECT_EQ(table.error().remedy, "a remedy");
  }
}

std::string utf8(unsigned c) {
  const auto tail = [](unsigned bits) { return static_cast<char>(0x80U | (bits & 0x3FU)); };
  if (c < 0x800) return {static_cast<char>(0xC0U | c >> 6U), tail(c)};
  return {static_cast<char>(0xE0U | c >> 12U), tail(c >> 6U), tail(c)};
}

// At every kind of place; the sanitizers watch the parser.
TEST(ParseToml, MeetsEveryLetterEverywhere) {
  for (unsigned c = 0x80; c < 0x10000; c += c < 0x500 ? 1 : 7) {
    if (c >= 0xD800 && c < 0xE000) continue;  // surrogates are no characters
    const std::string letter = utf8(c);
    // These end a line for the parser, but not in TOML.
    const bool ends_line = c == 0x85 || c == 0x2028 || c == 0x2029;
    EXPECT_TRUE(ends_line || parse_toml("a = 1 # " + letter, "a.toml")) << std::hex << c;
    EXPECT_TRUE(parse_toml("a = '" + letter + "'", "a.toml")) << std::hex << c;
    for (const char* place : {"", "a", "a = ", "a = 1", "a = tru", "[", "a = [1,", "a = \"\"\"\\"})
      (void)parse_toml(place + letter, "a.toml");
  }
}

// Damaged UTF-8 and odd pieces in sequence.
TEST(ParseToml, SurvivesAnyText) {
  const std::string pieces[] = {
      "°",    "я", "\xFF", "\xC3",   "\n",   "\"",  "'", "\"\"\"",  "'''", "#",
      "=",    "a", "1",    "[",      "]",    "{",   "}", ",",       "\\",  ".",
      "true", "-", "\r\n", "\u2003", "x = ", "inf", "_", "\\u00e9", "\t",  "2020-01-01"};
  for (std::uint32_t seed = 0; seed < 10'000; ++seed) {
    std::mt19937 dice(seed);
    std::string text;
    for (auto left = 1 + dice() % 14; left > 0; --left)
      text += pieces[dice() % std::size(pieces)];
    const auto table = parse_toml(text, "a.toml");
    EXPECT_TRUE(table || !table.error().what.empty()) << "seed " << seed;
  }
}

// A wrong file has thousands of unknown keys.
TEST(TomlReader, NamesTheFirstUnknownKeysAndCountsTheRest) {
  std::string text = "known = 1\n";
  for (int i = 0; i < 47; ++i)
    text += "key_" + std::to_string(i) + " = 1\n";
  const auto table = parse_toml(text, "a.toml");
  ASSERT_TRUE(table);
  std::vector<Error> errors;
  TomlReader reader(*table, "a.toml", "[a]", errors);
  (void)reader.integer("known");
  reader.finish();
  ASSERT_EQ(errors.size(), 11U);
  EXPECT_EQ(errors[10].what, "… and 37 more unknown keys in [a]");
}

// The library returns nothing for such an integer, and a default would silently replace it.
TEST(TomlReader, ComplainsOfAnIntegerThatNoNumberHolds) {
  const auto table = parse_toml("a = 9007199254740993\nb = 9007199254740992\n", "a.toml");
  ASSERT_TRUE(table);
  std::vector<Error> errors;
  TomlReader reader(*table, "a.toml", "the file", errors);
  EXPECT_FALSE(reader.number("a"));
  EXPECT_EQ(reader.number("b"), 0x1p53);
  ASSERT_EQ(errors.size(), 1U);
  EXPECT_EQ(errors[0].where, "a.toml:1");
  EXPECT_NE(errors[0].what.find("more digits"), std::string::npos) << errors[0].what;
}

}  // namespace
}  // namespace vgyro
