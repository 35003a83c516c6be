#include "fleet/leave_one_out.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::fleet {
namespace {

constexpr std::uint64_t kSeed = 17;

/// A fleet whose units differ by `between`, and every `odd`-th by a thousand times as much.
struct Fleet {
  std::size_t units;
  double between;
  double sigma_decades;  ///< how unequal the units' σ are
  std::size_t odd;       ///< 0: none
  double mean;
};

std::vector<Estimate> drawn(const Fleet& fleet, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> even(-0.5, 0.5);
  std::vector<Estimate> units;
  for (std::size_t i = 0; i < fleet.units; ++i) {
    const double sigma = std::pow(10.0, fleet.sigma_decades * even(random));
    const double own = fleet.odd > 0 && i % fleet.odd == 0 ? 1e3 : 1.0;
    units.push_back(
        {fleet.mean + own * fleet.between * normal(random) + sigma * normal(random), sigma});
  }
  return units;
}

RandomEffects directly(std::vector<Estimate> units, std::size_t without) {
  units.erase(units.begin() + static_cast<std::ptrdiff_t>(without));
  return random_effects(units);
}

// Tolerance: of a mean in units of its σ, of all else relative. Sums of some thousand terms are
// this precise.
constexpr double kRounding = 1e-9;

void expect_same(const RandomEffects& got, const RandomEffects& want) {
  EXPECT_NEAR(got.mean, want.mean, kRounding * want.sigma);
  EXPECT_NEAR(got.sigma, want.sigma, kRounding * want.sigma);
  EXPECT_NEAR(got.q, want.q, kRounding * want.q);
  // Compared as squares: near 0, a spread is the root of a difference.
  EXPECT_NEAR(got.between * got.between, want.between * want.between,
              kRounding * (want.between * want.between + want.between_sigma * want.between_sigma));
  EXPECT_NEAR(got.between_sigma, want.between_sigma, kRounding * want.between_sigma);
  EXPECT_EQ(got.freedom, want.freedom);
}

TEST(LeaveOneOut, IsWhatTheOthersGiveDirectly) {
  std::mt19937_64 random(kSeed);
  for (const Fleet& fleet :
       {Fleet{65, 0.0, 0.0, 0, 0.0}, Fleet{300, 0.0, 1.0, 0, 5.0}, Fleet{300, 2.0, 1.0, 0, -7.0},
        Fleet{300, 2.0, 4.0, 0, 1e4}, Fleet{300, 0.5, 6.0, 40, 3.0}, Fleet{300, 1.0, 0.5, 3, 0.0},
        Fleet{300, 0.05, 0.2, 0, 1.0}, Fleet{900, 1e-3, 2.0, 300, 1.0}}) {
    for (int turn = 0; turn < 5; ++turn) {
      const std::vector<Estimate> units = drawn(fleet, random);
      const std::vector<RandomEffects> all = random_effects_of_others(units);
      ASSERT_EQ(all.size(), units.size());
      for (std::size_t i = 0; i < units.size(); ++i) {
        SCOPED_TRACE(testing::Message()
                     << "seed " << kSeed << ", " << fleet.units << " units, between "
                     << fleet.between << ", odd " << fleet.odd << ", unit " << i);
        expect_same(all[i], directly(units, i));
        if (HasFailure()) return;
      }
    }
  }
}

TEST(LeaveOneOut, IsTheSameToTheBitOfFewUnits) {
  std::mt19937_64 random(kSeed + 1);
  for (const std::size_t count : {1U, 2U, 3U, 20U, 64U}) {
    const std::vector<Estimate> units = drawn({count, 1.0, 1.0, 0, 2.0}, random);
    const std::vector<RandomEffects> all = random_effects_of_others(units);
    for (std::size_t i = 0; i < units.size(); ++i) {
      const RandomEffects want = directly(units, i);
      EXPECT_EQ(all[i].mean, want.mean);
      EXPECT_EQ(all[i].sigma, want.sigma);
      EXPECT_EQ(all[i].between, want.between);
    }
  }
}

}  // namespace
}  // namespace vgyro::fleet
