// Two gyros on one platform, block by block, and conditions in which one of them may seem blind.

#include "fusion/coherence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "fusion/quadratic.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr std::array<double, 2> kWhite{1e-3, 3e-3};  // deg/s/√Hz
constexpr double kBlock_s = 0.5;
constexpr double kTimingTolerance_s = 0.02;

/// A vehicle among other traffic.
double winding(double t_s) {
  return 15.0 * std::sin(0.5 * t_s) + 10.0 * std::sin(0.13 * t_s);
}
double at_rest(double /*t_s*/) {
  return 0.0;
}

class Pair {
 public:
  explicit Pair(std::uint64_t seed) : random_(seed) {}

  using Rate = std::function<double(double)>;
  Coherence coherence;
  /// The rate that each gyro feels, without noise.
  std::array<Rate, 2> rate{at_rest, at_rest};

  void block() {
    std::array<double, 2> mean{};
    double bend = 0.0;
    constexpr int kSteps = 10;
    for (std::size_t k = 0; k < 2; ++k) {
      double before = rate[k](t_s);
      for (int i = 0; i < kSteps; ++i) {
        const double h = kBlock_s / kSteps;
        mean[k] += rate[k](t_s + (i + 0.5) * h) / kSteps;
        const double after = rate[k](t_s + (i + 1) * h);
        bend = std::max(bend, std::abs(after - before) / h);
        before = after;
      }
      mean[k] += random_.normal(kWhite[k] / std::sqrt(kBlock_s));
    }
    coherence.judge(mean, t_s, t_s + kBlock_s, {squared(kWhite[0]), 0.0, squared(kWhite[1])},
                    kTimingTolerance_s * bend);
    t_s += kBlock_s;
    for (std::size_t k = 0; k < 2; ++k)
      greatest_[k] = std::max(greatest_[k], coherence.blind(k));
    contradicted_ = contradicted_ || coherence.contradict();
  }
  void run(double seconds) {
    for (const double until = t_s + seconds; t_s < until;)
      block();
  }
  /// Greatest probability since the beginning.
  [[nodiscard]] double greatest(std::size_t gyro) const { return greatest_[gyro]; }
  [[nodiscard]] bool contradicted() const { return contradicted_; }

  double t_s = 0.0;

 private:
  Random random_;
  std::array<double, 2> greatest_{};
  bool contradicted_ = false;
};

constexpr double kLikely = 0.5;
/// Largest probability of blindness from a step, which shows in three blocks.
constexpr double kSuspicious = 0.2;

// After a few seconds of motion, the gyro that stays constant is found blind.
TEST(Coherence, FindsAGyroThatFeelsNoRotation) {
  for (std::size_t bad = 0; bad < 2; ++bad) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(::testing::Message() << "gyro " << bad + 1 << ", seed " << seed);
      Pair pair(seed);
      pair.rate = {winding, winding};
      pair.run(100.0);
      EXPECT_LT(pair.greatest(bad), 1e-3);
      pair.rate[bad] = at_rest;
      pair.run(7.0);
      EXPECT_GT(pair.coherence.blind(bad), kLikely);
      EXPECT_LT(pair.coherence.blind(1 - bad), 1e-3);
      pair.run(30.0);
      EXPECT_GT(pair.coherence.blind(bad), 0.99) << "sure";
      pair.rate[bad] = winding;
      pair.run(10.0);
      EXPECT_LT(pair.coherence.blind(bad), kLikely) << "it feels again";
    }
  }
}

// A slow turn is enough if it is far above the noise: 0.5 deg/s, to and fro.
TEST(Coherence, FindsABlindGyroOnASlowPlatform) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Pair pair(seed);
    pair.rate = {at_rest, [](double t_s) { return 0.5 * std::sin(0.5 * t_s); }};
    pair.run(60.0);
    EXPECT_GT(pair.coherence.blind(0), kLikely) << "seed " << seed;
  }
}

TEST(Coherence, FindsNothingInNoiseAtRestForAHundredHours) {
  constexpr std::uint64_t kSeed = 1;
  Pair pair(kSeed);
  pair.run(100.0 * 3600.0);
  EXPECT_LT(pair.greatest(0), 1e-6) << "seed " << kSeed;
  EXPECT_LT(pair.greatest(1), 1e-6) << "seed " << kSeed;
  EXPECT_FALSE(pair.contradicted()) << "seed " << kSeed;
}

// The other gyro's bias jumps at rest, again and again: this gyro is not blind.
TEST(Coherence, TakesNoStepForARotation) {
  for (const double step_dps : {0.06, 0.5, 5.0, 50.0}) {
    for (std::size_t bad = 0; bad < 2; ++bad) {
      SCOPED_TRACE(::testing::Message() << step_dps << " deg/s of gyro " << bad + 1);
      Pair pair(2);
      pair.run(30.0);
      pair.rate[bad] = [step_dps](double t_s) { return step_dps * std::floor(t_s / 61.3); };
      pair.run(1200.0);
      EXPECT_LT(pair.greatest(0), kSuspicious);
      EXPECT_LT(pair.greatest(1), kSuspicious);
      EXPECT_FALSE(pair.contradicted());
    }
  }
}

// A drift of the other gyro, as fast as drifts can be, does not make this one blind either.
TEST(Coherence, TakesNoRampForARotation) {
  for (const double slope_dps_s : {1e-4, 1e-3, 1e-2, 3e-2}) {
    for (std::size_t bad = 0; bad < 2; ++bad) {
      SCOPED_TRACE(::testing::Message() << slope_dps_s << " deg/s² of gyro " << bad + 1);
      Pair pair(3);
      pair.rate[bad] = [slope_dps_s](double t_s) { return slope_dps_s * t_s; };
      pair.run(600.0);
      EXPECT_LT(pair.greatest(0), kSuspicious);
      EXPECT_LT(pair.greatest(1), kSuspicious);
      EXPECT_FALSE(pair.contradicted());
    }
  }
}

// Healthy gyros differ in scale, and in time.
TEST(Coherence, AllowsScaleFactorsAndSkewsToDiffer) {
  for (const double scale : {0.98, 1.02}) {
    for (const double late_s : {-0.02, 0.0, 0.02}) {
      SCOPED_TRACE(::testing::Message() << "scale " << scale << ", " << late_s << " s late");
      Pair pair(4);
      // Hard turns as well: 100 deg/s within a second.
      const auto rate = [](double t_s) {
        return winding(t_s) + 100.0 * std::exp(-0.5 * std::pow(std::fmod(t_s, 20.0) - 10.0, 2.0));
      };
      pair.rate = {rate, [=](double t_s) { return scale * rate(t_s - late_s); }};
      pair.run(3600.0);
      EXPECT_LT(pair.greatest(0), 1e-6);
      EXPECT_LT(pair.greatest(1), 1e-6);
      EXPECT_FALSE(pair.contradicted());
    }
  }
}

// Foreign frames: both gyros move, but not alike. This is reported, and ends when its cause ends.
TEST(Coherence, SeesAForeignSignal) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Pair pair(seed);
    pair.rate = {winding, winding};
    pair.run(60.0);
    EXPECT_FALSE(pair.contradicted());
    pair.rate[1] = [](double t_s) { return 12.0 * std::sin(0.83 * t_s + 2.0); };
    pair.run(15.0);
    EXPECT_TRUE(pair.contradicted());
    EXPECT_TRUE(pair.coherence.contradict());
    EXPECT_LT(pair.greatest(0), kLikely) << "it moves, too";
    pair.rate[1] = winding;
    pair.run(15.0);
    EXPECT_FALSE(pair.coherence.contradict()) << "it has ended";
    EXPECT_LT(pair.coherence.blind(0), kLikely);
  }
}

// A change across a gap is no evidence.
TEST(Coherence, ComparesNothingAcrossAGap) {
  for (const bool told : {false, true}) {
    Pair pair(5);
    pair.run(10.0);
    for (int i = 0; i < 20; ++i) {
      pair.rate[1] = [i](double /*t_s*/) { return 3.0 * i; };
      if (told) {
        pair.coherence.break_off();
      } else {
        pair.t_s += 5.0;
      }
      pair.run(1.0);
    }
    EXPECT_LT(pair.greatest(0), 1e-6) << told;
  }
}

}  // namespace
}  // namespace vgyro::fusion
