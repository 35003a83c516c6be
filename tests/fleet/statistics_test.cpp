#include "fleet/statistics.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::fleet {
namespace {

// Values from printed tables.
TEST(Statistics, TailsAreThoseOfTheTables) {
  EXPECT_NEAR(normal_tail(1.959964), 0.05, 1e-7);
  EXPECT_NEAR(student_tail(2.228139, 10.0), 0.05, 1e-7);
  EXPECT_NEAR(student_tail(-12.7062, 1.0), 0.05, 1e-6);
  EXPECT_NEAR(student_quantile(0.05, 4.0), 2.776445, 1e-5);
  EXPECT_NEAR(chi_square_tail(3.841459, 1.0), 0.05, 1e-7);
  EXPECT_NEAR(chi_square_tail(18.30704, 10.0), 0.05, 1e-7);
  EXPECT_NEAR(chi_square_tail(2.0, 2.0), std::exp(-1.0), 1e-12);
  EXPECT_NEAR(binomial_tail(2, 3, 0.5), 0.5, 1e-12);
  EXPECT_NEAR(binomial_tail(4, 4, 0.0455), std::pow(0.0455, 4), 1e-18);
  EXPECT_EQ(binomial_tail(0, 4, 0.0455), 1.0);
}

TEST(Statistics, NamesAsBenjaminiAndYekutieliDo) {
  // Worked by hand: 4 tests, harmonic sum 25/12, rate 0.25: thresholds 0.03, 0.06, 0.09, 0.12.
  const std::vector<bool> named = named_of({0.2, 0.05, 0.001, 0.08}, 4.0, 0.25);
  EXPECT_EQ(named, (std::vector<bool>{false, true, true, true}));
}

TEST(Statistics, SpreadAndMeanOfUnitsAreRightOnAverage) {
  constexpr std::uint64_t kSeed = 7;
  constexpr int kFleets = 2000;
  constexpr double kMean = 3.0;
  constexpr double kBetween = 2.0;
  std::mt19937_64 random(kSeed);
  std::normal_distribution<double> normal;
  int inside = 0;
  double variance = 0.0;
  for (int fleet = 0; fleet < kFleets; ++fleet) {
    std::vector<Estimate> units;
    for (int i = 0; i < 12; ++i) {
      const double sigma = 0.5 + 0.1 * i;
      units.push_back({kMean + kBetween * normal(random) + sigma * normal(random), sigma});
    }
    const RandomEffects pooled = random_effects(units);
    inside += std::abs(pooled.mean - kMean) <= pooled.half_width95() ? 1 : 0;
    variance += pooled.between * pooled.between / kFleets;
  }
  // Knapp and Hartung's interval covers at least 95 %; tolerance: three standard errors of a
  // binomial count.
  EXPECT_GE(inside, 0.95 * kFleets - 3.0 * std::sqrt(0.05 * 0.95 * kFleets));
  EXPECT_NEAR(variance, kBetween * kBetween, 0.2);
}

TEST(Statistics, OneUnitSaysNothingOfASpread) {
  const RandomEffects pooled = random_effects({{2.0, 0.5}});
  EXPECT_EQ(pooled.between, 0.0);
  EXPECT_EQ(pooled.freedom, 0.0);
  EXPECT_NEAR(pooled.half_width95(), 0.98, 1e-3);
}

}  // namespace
}  // namespace vgyro::fleet
