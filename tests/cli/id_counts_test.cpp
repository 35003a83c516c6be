// Frames by identifier: every standard one is counted, extended ones up to a limit; the first of
// them are kept.

#include <map>
#include <random>
#include <utility>

#include <gtest/gtest.h>

#include "cli/replay/summary.h"

namespace vgyro::cli {
namespace {

constexpr std::uint64_t kSeed = 20'261'130;
constexpr std::size_t kExtendedMost = 4096;

can::Frame frame_of(std::uint32_t id, std::uint8_t flags) {
  can::Frame frame;
  frame.id = id;
  frame.flags = flags;
  return frame;
}

TEST(IdCounts, CountEveryFrameAndOfTooManyExtendedIdentifiersTheFirst) {
  SCOPED_TRACE(::testing::Message() << "seed " << kSeed);
  std::mt19937_64 random(kSeed);
  IdCounts counts;
  std::map<std::pair<can::BusIndex, std::uint32_t>, std::uint64_t> standard;
  std::map<std::pair<can::BusIndex, std::uint32_t>, std::uint64_t> extended;
  for (int i = 0; i < 200'000; ++i) {
    const auto bus = static_cast<can::BusIndex>(random() % 3);
    if (random() % 2 == 0) {
      const auto id = static_cast<std::uint32_t>(random() & can::kStandardIdMax);
      counts.add(bus, frame_of(id, 0));
      ++standard[{bus, id}];
      continue;
    }
    // Some 6000 identifiers, close together and far apart.
    const auto id = static_cast<std::uint32_t>(random() % 1000 * (random() % 2 == 0 ? 1 : 0x10001));
    counts.add(bus, frame_of(id, can::kExtended));
    const bool known = extended.contains({bus, id});
    if (known || extended.size() < kExtendedMost) ++extended[{bus, id}];
  }
  counts.add(0, frame_of(5, can::kError));
  EXPECT_EQ(counts.error_frames(), 1U);
  ASSERT_EQ(extended.size(), kExtendedMost);
  const std::vector<IdCounts::Row> rows = counts.rows();
  ASSERT_EQ(rows.size(), standard.size() + extended.size());
  for (const IdCounts::Row& row : rows) {
    const auto& expected = row.extended ? extended : standard;
    ASSERT_EQ(row.frames, expected.at({row.bus, row.id})) << row.id;
  }
}

}  // namespace
}  // namespace vgyro::cli
