#include "base/fnv1a.h"

#include <gtest/gtest.h>

namespace vgyro {
namespace {

// From the test vectors published with the algorithm.
static_assert(fnv1a("") == 0x811c9dc5U);
static_assert(fnv1a("a") == 0xe40c292cU);
static_assert(fnv1a("foobar") == 0xbf9cf968U);

TEST(Fnv1a, OfTwoTextsIsThatOfBothInOne) {
  EXPECT_EQ(fnv1a("bar", fnv1a("foo")), fnv1a("foobar"));
  EXPECT_EQ(fnv1a("\xE9"), (kFnv1aBegin ^ 0xE9U) * 16777619U) << "bytes have no sign";
}

}  // namespace
}  // namespace vgyro
