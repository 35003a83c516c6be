#include "fleet/trends.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::fleet {
namespace {

constexpr std::uint64_t kSeed = 23;
constexpr double kThreshold = 1e-6;
constexpr double kFreedom = 8.0;

/// Slopes about `mean`, each with a σ as estimated from ten drives.
std::vector<UnitSlope> drawn(std::size_t units, double mean, double between,
                             std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::chi_squared_distribution<double> chi_square(kFreedom);
  std::vector<UnitSlope> slopes;
  for (std::size_t i = 0; i < units; ++i)
    slopes.push_back({i,
                      {mean + between * normal(random) + normal(random),
                       std::sqrt(chi_square(random) / kFreedom)},
                      kFreedom});
  return slopes;
}

TEST(Trends, NameNothingWhereNothingMoves) {
  std::mt19937_64 random(kSeed);
  for (int fleet = 0; fleet < 500; ++fleet) {
    const SlopesJudgement judged = judge_slopes(drawn(30, 0.0, 0.0, random), kThreshold);
    EXPECT_FALSE(judged.is_named || judged.varies) << "seed " << kSeed << ", fleet " << fleet;
    EXPECT_TRUE(judged.apart.empty()) << "seed " << kSeed << ", fleet " << fleet;
  }
}

TEST(Trends, AreTheTypesWhereAllUnitsMoveAlike) {
  std::mt19937_64 random(kSeed + 1);
  for (int fleet = 0; fleet < 100; ++fleet) {
    const SlopesJudgement judged = judge_slopes(drawn(30, 4.0, 0.0, random), kThreshold);
    EXPECT_TRUE(judged.is_named);
    EXPECT_TRUE(judged.apart.empty()) << "seed " << kSeed + 1 << ", fleet " << fleet;
    EXPECT_NEAR(judged.type.mean, 4.0, 5.0 * judged.type.sigma);
  }
}

TEST(Trends, AreOneUnitsWhereItAloneMoves) {
  std::mt19937_64 random(kSeed + 2);
  int found = 0;
  for (int fleet = 0; fleet < 100; ++fleet) {
    std::vector<UnitSlope> slopes = drawn(30, 0.0, 0.0, random);
    slopes[17].per_year = {40.0, 1.0};
    const SlopesJudgement judged = judge_slopes(slopes, kThreshold);
    EXPECT_FALSE(judged.is_named || judged.varies);
    ASSERT_EQ(judged.apart.size(), 1U) << "seed " << kSeed + 2 << ", fleet " << fleet;
    found += judged.apart.front().unit.unit == 17 ? 1 : 0;
  }
  EXPECT_EQ(found, 100);
}

// Biases that wander over the months: each unit seems to have a trend, and none is worse than the
// others.
TEST(Trends, OfUnitsThatMoveEachItsOwnWayAreASpread) {
  std::mt19937_64 random(kSeed + 3);
  for (int fleet = 0; fleet < 100; ++fleet) {
    const SlopesJudgement judged = judge_slopes(drawn(40, 0.0, 10.0, random), kThreshold);
    EXPECT_TRUE(judged.varies);
    EXPECT_FALSE(judged.is_named);
    EXPECT_TRUE(judged.apart.empty()) << "seed " << kSeed + 3 << ", fleet " << fleet;
  }
}

TEST(Trends, OfFewUnitsAreJudgedAlone) {
  const std::vector<UnitSlope> slopes{{0, {30.0, 1.0}, 20.0}, {1, {1.0, 1.0}, 20.0}};
  const SlopesJudgement judged = judge_slopes(slopes, kThreshold);
  ASSERT_EQ(judged.apart.size(), 1U);
  EXPECT_EQ(judged.apart.front().unit.unit, 0U);
  EXPECT_FALSE(judged.is_named);
  EXPECT_TRUE(judge_slopes({}, kThreshold).apart.empty());
}

}  // namespace
}  // namespace vgyro::fleet
