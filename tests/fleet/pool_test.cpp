#include "fleet/pool.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::fleet {
namespace {

constexpr std::uint64_t kSeed = 11;

std::vector<Drive> drives(std::size_t count) {
  std::mt19937_64 random(kSeed);
  std::normal_distribution<double> normal;
  std::vector<Drive> list(count);
  for (std::size_t i = 0; i < count; ++i) {
    Drive& drive = list[i];
    drive.id = std::to_string(1000 + i) + "-x";
    drive.began_s = 1.7e9 + 1e5 * normal(random);
    drive.seconds = 300.1;
    drive.model = "none";
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      DriveGyro& its = drive.gyros[gyro];
      its.identity = {"t", gyro == 0 ? "a" : "b"};
      its.has_bias = true;
      its.bias_dps = normal(random);
      its.white_dps_rthz = 1e-3;
      its.walk_dps_rts = 1e-5 / 3.0;
      drive.places.push_back(
          {{gyro}, {0, 7}, {normal(random), 1e3 * normal(random)}, {1.0, 0.3, 1e6 / 3.0}});
    }
  }
  return list;
}

bool same(const Pool& a, const Pool& b) {
  if (a.drives != b.drives || a.units.size() != b.units.size()) return false;
  for (const auto& [who, sums] : a.groups) {
    const GroupSums& other = b.groups.at(who);
    if (sums.score != other.score || sums.information != other.information ||
        sums.heterogeneity != other.heterogeneity || sums.score_time != other.score_time)
      return false;
  }
  for (const auto& [identity, sums] : a.units) {
    for (std::size_t i = 0; i < kMeasures; ++i) {
      const Moments& mine = sums.measures[i];
      const Moments& its = b.units.at(identity).measures[i];
      if (mine.x != its.x || mine.xx != its.xx || mine.xt != its.xt) return false;
    }
  }
  return true;
}

TEST(Pool, IsTheSameToTheLastBitInAnyOrderAndGrouping) {
  std::vector<Drive> all = drives(50);
  Pool whole;
  for (const Drive& drive : all)
    ASSERT_TRUE(*whole.add(drive));
  std::mt19937_64 random(kSeed + 1);
  for (int turn = 0; turn < 5; ++turn) {
    std::shuffle(all.begin(), all.end(), random);
    std::array<Pool, 3> parts;
    for (std::size_t i = 0; i < all.size(); ++i)
      ASSERT_TRUE(*parts[random() % parts.size()].add(all[i]));
    ASSERT_TRUE(parts[1].add(parts[2]));
    ASSERT_TRUE(parts[1].add(parts[0]));
    EXPECT_TRUE(same(whole, parts[1]));
  }
}

TEST(Pool, CountsADriveOnce) {
  const std::vector<Drive> all = drives(3);
  Pool pool;
  for (const Drive& drive : all)
    ASSERT_TRUE(*pool.add(drive));
  Pool again = pool;
  EXPECT_FALSE(*again.add(all[1]));
  EXPECT_TRUE(same(pool, again));
  EXPECT_FALSE(again.add(pool).has_value());
  Drive other = all[0];
  other.id = "1000-y";
  EXPECT_FALSE(again.add(other).has_value());
}

TEST(Moments, SayMeanScatterAndTrend) {
  Moments moments;
  for (int i = 0; i < 5; ++i)
    moments.add(3.0 + 2.0 * i + (i % 2 == 0 ? 0.5 : -0.5), i);
  EXPECT_NEAR(moments.mean(), 7.1, 1e-5);
  EXPECT_NEAR(moments.slope(), 2.0, 1e-5);
  // Residuals 0.4, -0.6, 0.4, -0.6, 0.4: sum of squares 1.2, over 3 and Σ(t - 2)² = 10.
  EXPECT_NEAR(moments.slope_sigma(), std::sqrt(1.2 / 3.0 / 10.0), 1e-5);
  EXPECT_NEAR(moments.variance_about_line(), 1.2 / 3.0, 1e-5);
  EXPECT_EQ(moments.freedom_about_line(), 3.0);
}

TEST(Moments, HaveNoLineWhereAllWasToldAtOnce) {
  Moments moments;
  for (const double value : {1.0, 2.0, 3.0})
    moments.add(value, 4.0);
  EXPECT_FALSE(moments.has_line());
  EXPECT_EQ(moments.slope_sigma(), 0.0);
  EXPECT_NEAR(moments.variance_about_line(), 1.0, 1e-5);
}

}  // namespace
}  // namespace vgyro::fleet
