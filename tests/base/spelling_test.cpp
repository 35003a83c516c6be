#include "base/spelling.h"

#include <algorithm>
#include <cstdint>
#include <random>

#include <gtest/gtest.h>

namespace vgyro {
namespace {

const std::vector<std::string> kKeys = {"bus",  "dbc",   "message",     "rate",
                                        "name", "valid", "temperature", "counter"};

// Directly from the definition; exponential, so for short words only.
std::size_t distance_by_definition(std::string_view a, std::string_view b) {
  if (a.empty() || b.empty()) return std::max(a.size(), b.size());
  const std::string_view a1 = a.substr(0, a.size() - 1);
  const std::string_view b1 = b.substr(0, b.size() - 1);
  std::size_t best = std::min({distance_by_definition(a1, b) + 1, distance_by_definition(a, b1) + 1,
                               distance_by_definition(a1, b1) + (a.back() == b.back() ? 0U : 1U)});
  if (a.size() > 1 && b.size() > 1 && a.back() == b1.back() && a1.back() == b.back()) {
    best = std::min(
        best, distance_by_definition(a.substr(0, a.size() - 2), b.substr(0, b.size() - 2)) + 1);
  }
  return best;
}

// Usual typing errors count as one edit each.
TEST(EditDistance, CountsInsertedDeletedReplacedAndSwappedLettersOnce) {
  EXPECT_EQ(edit_distance("window", "window"), 0U);
  EXPECT_EQ(edit_distance("windw", "window"), 1U);
  EXPECT_EQ(edit_distance("windoow", "window"), 1U);
  EXPECT_EQ(edit_distance("windaw", "window"), 1U);
  EXPECT_EQ(edit_distance("widnow", "window"), 1U);
  EXPECT_EQ(edit_distance("", "window"), 6U);
  EXPECT_EQ(edit_distance("window", ""), 6U);
}

// Signal names may be CamelCase in one file and capitals in the next: that is no typing error.
TEST(EditDistance, IgnoresLetterCase) {
  EXPECT_EQ(edit_distance("ratez", "RateZ"), 0U);
  EXPECT_EQ(edit_distance("RTAEZ", "ratez"), 1U);
}

// The table of rows agrees with the definition, in either order of the words.
TEST(EditDistance, AgreesWithItsDefinitionOnRandomWords) {
  constexpr std::uint32_t kSeed = 20'240'601;
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  std::mt19937 random(kSeed);
  const auto word = [&random] {
    std::string text(random() % 7, ' ');
    for (char& c : text)
      c = static_cast<char>('a' + random() % 3);
    return text;
  };
  for (int i = 0; i < 3000; ++i) {
    const std::string a = word();
    const std::string b = word();
    ASSERT_EQ(edit_distance(a, b), distance_by_definition(a, b)) << a << ' ' << b;
    ASSERT_EQ(edit_distance(a, b), edit_distance(b, a)) << a << ' ' << b;
  }
}

// Of several near names the nearest is suggested; of equally near ones the first.
TEST(NearestName, FindsTheNearest) {
  EXPECT_EQ(nearest_name("mesage", kKeys), "message");
  EXPECT_EQ(nearest_name("TEMPERTURE", kKeys), "temperature");
  EXPECT_EQ(nearest_name("rat", {"cat", "rate", "bat"}), "cat");
  EXPECT_EQ(nearest_name("rate", {"rated", "rate"}), "rate");
}

// A far-fetched suggestion is worse than none.
TEST(NearestName, FindsNothingWhereNothingIsNear) {
  EXPECT_EQ(nearest_name("quaternion", kKeys), std::nullopt);
  EXPECT_EQ(nearest_name("abc", {"xyz"}), std::nullopt);
  EXPECT_EQ(nearest_name("anything", {}), std::nullopt);
}

// Two errors are accepted in short names, a third of the letters in long ones, and no more.
TEST(NearestName, ForgivesAThirdOfALongName) {
  EXPECT_EQ(nearest_name("axxd", {"abcd"}), "abcd");
  EXPECT_EQ(nearest_name("axxx", {"abcd"}), std::nullopt);
  EXPECT_EQ(nearest_name("temperaxxxx1", {"temperature1"}), "temperature1");
  EXPECT_EQ(nearest_name("temperxxxxx1", {"temperature1"}), std::nullopt);
}

// The error's remedy: one name if one is near, otherwise the list.
TEST(SuggestName, SuggestsOneNameOrListsThemAll) {
  EXPECT_EQ(suggest_name("dbz", kKeys), "did you mean \"dbc\"?");
  EXPECT_EQ(suggest_name("zzzzzz", {"mean", "mutual"}), "one of: mean, mutual");
  EXPECT_EQ(suggest_name("zzzzzz", {}), "");
}

// A DBC file may hold hundreds of messages; the list stays short and ends with "…".
TEST(SuggestName, ListsAtMostTwelveNames) {
  std::vector<std::string> names(12, "N");
  EXPECT_EQ(suggest_name("zzzzzz", names), "one of: N, N, N, N, N, N, N, N, N, N, N, N");
  names.emplace_back("LAST");
  EXPECT_EQ(suggest_name("zzzzzz", names), "one of: N, N, N, N, N, N, N, N, N, N, N, N, …");
}

TEST(Spelling, NamesTheFirstUnknownOption) {
  const std::vector<std::string> known{"--plot", "--output"};
  EXPECT_FALSE(unknown_option({"drive.log", "-"}, known));
  const auto typed = unknown_option({"drive.log", "--plto=a.svg", "--outptu"}, known);
  ASSERT_TRUE(typed);
  EXPECT_EQ(typed->name, "--plto");
  EXPECT_EQ(typed->near, "--plot");
  const auto strange = unknown_option({"--bananas"}, known);
  ASSERT_TRUE(strange);
  EXPECT_FALSE(strange->near);
}

}  // namespace
}  // namespace vgyro
