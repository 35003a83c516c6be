#include "gap/noise_search.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

constexpr double kSigmas = 4.0;
// What noise needs to be named; docs/gap.md.
constexpr double kNoiseNeeds = 24.0;
constexpr int kSeeds = 10;
constexpr std::array<bool, 2> kBoth{true, true};

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = 80.0;
  making.interval_s = 0.02;
  making.rest_s = 20.0;
  making.seed = seed;
  return making;
}

// Beyond what white noise and walk of a Making bring, sample after sample.
class Extra {
 public:
  Extra(std::uint64_t seed, double interval_s) : random_(seed), interval_s_(interval_s) {}

  double white(double density) { return density / std::sqrt(interval_s_) * normal_(random_); }
  double walk(double density) {
    return value_ += density * std::sqrt(interval_s_) * normal_(random_);
  }
  double forgetting(double sigma_dps, double tau_s) {
    const double keeps = std::exp(-interval_s_ / tau_s);
    if (!begun_) value_ = sigma_dps * normal_(random_);
    begun_ = true;
    return value_ = keeps * value_ + sigma_dps * std::sqrt(1.0 - keeps * keeps) * normal_(random_);
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double interval_s_;
  double value_ = 0.0;
  bool begun_ = false;
};

std::string text_of(const Found& found) {
  return std::string(model::info(found.effect.kind).name) + " " +
         model::parameters_text(found.effect) + " of gyro " + std::to_string(found.effect.gyro) +
         ": " + std::to_string(found.statistic);
}

bool is_rival(const Found& found, Kind kind) {
  return std::any_of(found.ambiguous_with.begin(), found.ambiguous_with.end(),
                     [&](const Reading& reading) { return reading.kind == kind; });
}

std::optional<NoiseFound> found_in(std::shared_ptr<const Observations> data, const Effects& known,
                                   std::array<bool, 2> may = kBoth) {
  const Regression regression(std::move(data), known, Part::kAll);
  return find_noise({{&regression, {}}}, regression.known_noise(), may);
}

// The error of a size in its own σ, over the seeds: χ² of as many degrees of freedom.
class Scores {
 public:
  void add(double found, double truth, double sigma, std::uint64_t seed) {
    EXPECT_GT(sigma, 0.0) << "seed " << seed;
    EXPECT_NEAR(found, truth, kSigmas * sigma) << "seed " << seed;
    square_ += std::pow((found - truth) / sigma, 2);
    ++count_;
  }
  void expect_chi_square() const {
    EXPECT_NEAR(square_ / count_, 1.0, kSigmas * std::sqrt(2.0 / count_))
        << "seeds 1 to " << kSeeds;
  }

 private:
  double square_ = 0.0;
  double count_ = 0.0;
};

TEST(NoiseSearch, NamesWhiteNoiseBeyondTheModels) {
  constexpr double kMore = 6e-4;
  Scores scores;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Making making = making_of(seed);
    Extra extra(1000 + seed, making.interval_s);
    making.error = [&](std::size_t, double, double) { return extra.white(kMore); };
    const auto best = found_in(observations_of_one(making), noise_effects(making));
    ASSERT_TRUE(best) << "seed " << seed;
    const Found& found = best->found;
    EXPECT_EQ(found.effect.kind, Kind::kWhiteNoise) << "seed " << seed << ": " << text_of(found);
    EXPECT_EQ(found.effect.gyro, 0U);
    EXPECT_GT(found.adjusted(), kNoiseNeeds) << "seed " << seed << ": " << text_of(found);
    scores.add(found.effect.parameters[0], kMore, found.sigma[0], seed);
    // Of n deviations the density is known to 1/√(2n): four of five are deviations.
    const double total = std::hypot(kMore, making.white_dps_rthz[0]);
    const double relative = 1.0 / std::sqrt(2.0 * 0.8 * 80.0 / making.interval_s);
    EXPECT_NEAR(found.sigma[0] / (relative * total * total / kMore), 1.0, 0.3) << "seed " << seed;
    // The terms are the model's and what was found, in squares.
    EXPECT_NEAR(best->terms.white_dps_rthz,
                std::hypot(making.white_dps_rthz[0], found.effect.parameters[0]), 1e-12);
  }
  scores.expect_chi_square();
}

TEST(NoiseSearch, NamesNoiseThatGrowsWithTheRate) {
  constexpr double kRatio = 4e-5;
  Scores scores;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Making making = making_of(seed);
    Extra extra(2000 + seed, making.interval_s);
    making.error = [&](std::size_t, double, double rate_dps) {
      return extra.white(kRatio * std::abs(rate_dps));
    };
    const auto best = found_in(observations_of_one(making), noise_effects(making));
    ASSERT_TRUE(best) << "seed " << seed;
    EXPECT_EQ(best->found.effect.kind, Kind::kRateNoise)
        << "seed " << seed << ": " << text_of(best->found);
    scores.add(best->found.effect.parameters[0], kRatio, best->found.sigma[0], seed);
  }
  scores.expect_chi_square();
}

TEST(NoiseSearch, NamesAWalkBeyondTheModels) {
  constexpr double kWalk = 1e-3;
  Scores scores;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Making making = making_of(seed);
    Extra extra(3000 + seed, making.interval_s);
    making.error = [&](std::size_t, double, double) { return extra.walk(kWalk); };
    const auto best = found_in(observations_of_one(making), noise_effects(making));
    ASSERT_TRUE(best) << "seed " << seed;
    const Found& found = best->found;
    EXPECT_TRUE(found.effect.kind == Kind::kRateRandomWalk ||
                is_rival(found, Kind::kRateRandomWalk))
        << "seed " << seed << ": " << text_of(found);
    if (found.effect.kind != Kind::kRateRandomWalk) continue;
    scores.add(found.effect.parameters[0], kWalk, found.sigma[0], seed);
  }
  scores.expect_chi_square();
}

TEST(NoiseSearch, NamesADriftThatForgetsAndWithinWhatTime) {
  constexpr double kSigma_dps = 5e-3;
  constexpr double kTau_s = 1.5;
  Scores sizes;
  Scores memories;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    Making making = making_of(seed);
    Extra extra(4000 + seed, making.interval_s);
    making.error = [&](std::size_t, double, double) {
      return extra.forgetting(kSigma_dps, kTau_s);
    };
    const auto best = found_in(observations_of_one(making), noise_effects(making));
    ASSERT_TRUE(best) << "seed " << seed;
    const Found& found = best->found;
    EXPECT_EQ(found.effect.kind, Kind::kGaussMarkov) << "seed " << seed << ": " << text_of(found);
    // Of what may be a half or the double the logarithm is known to its relative error.
    sizes.add(std::log(found.effect.parameters[0]), std::log(kSigma_dps),
              found.sigma[0] / found.effect.parameters[0], seed);
    memories.add(std::log(found.effect.parameters[1]), std::log(kTau_s),
                 found.sigma[1] / found.effect.parameters[1], seed);
    ASSERT_EQ(best->terms.markov.size(), 1U);
    EXPECT_EQ(best->terms.markov[0].sigma_dps, found.effect.parameters[0]);
    EXPECT_EQ(best->terms.markov[0].tau_s, found.effect.parameters[1]);
    EXPECT_FALSE(is_rival(found, Kind::kGaussMarkov)) << "a name is no rival of its own";
  }
  sizes.expect_chi_square();
  memories.expect_chi_square();
}

// A model file can hold no more: a fourth would be taken for one that the corrector knows.
TEST(NoiseSearch, NeverNamesAFourthDriftThatForgets) {
  Making making = making_of(81);
  Extra extra(81, making.interval_s);
  making.error = [&](std::size_t, double, double) { return extra.forgetting(5e-3, 1.5); };
  Effects known = noise_effects(making);
  for (std::size_t i = 0; i < model::kGaussMarkovMax; ++i) {
    const auto data = observations_of_one(making);
    const auto best = found_in(data, known);
    ASSERT_TRUE(best);
    EXPECT_EQ(best->found.effect.kind, Kind::kGaussMarkov) << i << ": " << text_of(best->found);
    known.push_back({0, Kind::kGaussMarkov, {1e-6, 50.0 + static_cast<double>(i)}, 0});
  }
  const auto last = found_in(observations_of_one(making), known);
  ASSERT_TRUE(last);
  EXPECT_NE(last->found.effect.kind, Kind::kGaussMarkov) << text_of(last->found);
  EXPECT_FALSE(is_rival(last->found, Kind::kGaussMarkov));
}

// Of a drift whose memory is a good part of the recording nobody can say that it ever forgets.
TEST(NoiseSearch, SaysThatALongMemoryMayBeAWalk) {
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Making making = making_of(seed);
    Extra extra(5000 + seed, making.interval_s);
    making.error = [&](std::size_t, double, double) { return extra.forgetting(0.01, 8.0); };
    const auto best = found_in(observations_of_one(making), noise_effects(making));
    ASSERT_TRUE(best) << "seed " << seed;
    const Found& found = best->found;
    if (found.effect.kind != Kind::kGaussMarkov) continue;
    if (found.effect.parameters[1] <= making.seconds / 16.0) continue;
    ++seen;
    EXPECT_TRUE(is_rival(found, Kind::kRateRandomWalk)) << "seed " << seed << text_of(found);
  }
  EXPECT_GT(seen, 0) << "of seeds 1 to 6";
}

TEST(NoiseSearch, NamesNothingWhereTheModelIsRight) {
  constexpr std::uint64_t kCleanSeeds = 25;
  for (std::uint64_t seed = 1; seed <= kCleanSeeds; ++seed) {
    const Making making = making_of(seed);
    const auto best = found_in(observations_of_one(making), noise_effects(making));
    if (!best) continue;
    EXPECT_LT(best->found.adjusted(), kNoiseNeeds)
        << "seed " << seed << ": " << text_of(best->found);
    EXPECT_LT(best->found.statistic, kNoiseNeeds)
        << "seed " << seed << ": " << text_of(best->found);
  }
}

// Less noise than the model says is no effect.
TEST(NoiseSearch, NamesNoNoiseThatIsMissing) {
  const Making making = making_of(82);
  Making loud = making;
  loud.white_dps_rthz[0] *= 1.2;
  loud.walk_dps_rts[0] *= 5.0;
  const auto best = found_in(observations_of_one(making), noise_effects(loud));
  if (best) {
    EXPECT_LT(best->found.adjusted(), kNoiseNeeds) << text_of(best->found);
  }
}

// At rest each gyro is seen by itself.
TEST(NoiseSearch, SaysWhichOfTwoGyrosIsLouder) {
  for (const std::size_t gyro : {0U, 1U}) {
    Making making = making_of(83 + gyro);
    Extra extra(83, making.interval_s);
    const double more = making.white_dps_rthz[gyro];
    making.error = [&](std::size_t its, double, double) {
      return its == gyro ? extra.white(more) : 0.0;
    };
    const auto data = observations_of_two(making);
    const auto best = found_in(data, noise_effects(making));
    ASSERT_TRUE(best);
    EXPECT_EQ(best->found.effect.kind, Kind::kWhiteNoise) << text_of(best->found);
    EXPECT_EQ(best->found.effect.gyro, gyro) << text_of(best->found);
    EXPECT_NEAR(best->found.effect.parameters[0], more, kSigmas * best->found.sigma[0]);
    // Nothing is named of a gyro that must not be asked.
    std::array<bool, 2> may = kBoth;
    may[gyro] = false;
    const auto other = found_in(data, noise_effects(making), may);
    if (other) {
      EXPECT_EQ(other->found.effect.gyro, 1 - gyro);
    }
    EXPECT_FALSE(found_in(data, noise_effects(making), {false, false}));
  }
}

// What is taken off first is no noise.
TEST(NoiseSearch, LooksAtWhatTheTermsLeave) {
  Making making = making_of(85);
  making.error = [](std::size_t, double, double rate_dps) { return 0.01 * rate_dps; };
  const Regression regression(observations_of_one(making), noise_effects(making), Part::kAll);
  const PairNoise model = regression.known_noise();
  const auto without = find_noise({{&regression, {}}}, model, kBoth);
  ASSERT_TRUE(without);
  EXPECT_GT(without->found.adjusted(), kNoiseNeeds);
  const auto with = find_noise({{&regression, {{0, Kind::kScaleFactor, {0.01}, 0}}}}, model, kBoth);
  if (with) {
    EXPECT_LT(with->found.adjusted(), kNoiseNeeds) << text_of(with->found);
  }
}

}  // namespace
}  // namespace vgyro::gap
