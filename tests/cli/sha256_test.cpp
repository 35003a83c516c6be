#include "cli/gap/sha256.h"

#include <gtest/gtest.h>

namespace vgyro::cli {
namespace {

std::string sum_of(std::string_view text) {
  Sha256 sum;
  sum.add(text);
  return sum.text();
}

TEST(Sha256, GivesTheSumsOfTheStandard) {
  // FIPS 180-4's examples; sha256sum prints the same.
  EXPECT_EQ(sum_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sum_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sum_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sum_of(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, IsTheSameInAnyPieces) {
  std::string text;
  for (int i = 0; i < 300; ++i) {
    text += static_cast<char>(i);
    Sha256 sum;
    for (std::size_t from = 0; from < text.size(); from += 7)
      sum.add(std::string_view(text).substr(from, 7));
    EXPECT_EQ(sum.text(), sum_of(text)) << i;
  }
}

TEST(Sha256, OfAFileThatIsNotThereIsAnError) {
  const auto sum = sha256_of_file("/nowhere/at/all");
  ASSERT_FALSE(sum);
  EXPECT_EQ(sum.error().where, "/nowhere/at/all");
}

}  // namespace
}  // namespace vgyro::cli
