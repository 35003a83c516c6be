// The bank of drift filters on known drifts: walks, ramps, gyros that warm up, and biases that
// follow temperature.

#include "fusion/drift_bank.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "fusion/drift_filter.h"
#include "fusion/quadratic.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr std::array<double, 2> kWhite{1e-3, 2e-3};  // deg/s/√Hz
constexpr double kWindow_s = 2.0;
constexpr std::uint64_t kRuns = 40;

using Course = std::function<double(std::size_t gyro, double t_s)>;

/// Two gyros whose biases take a given course, with a walk on top.
class World {
 public:
  World(std::uint64_t seed, Course course, const std::array<double, 2>& walk_dps_rts = {})
      : random_(seed), course_(std::move(course)), walk_(walk_dps_rts) {}

  void begin(DriftBank& bank) {
    const DriftMeasurement first = rest(kWindow_s);
    bank.begin(kWhite, {first.values(0), first.values(1)},
               {first.noise(0, 0), 0.0, first.noise(1, 1)});
  }
  void learn_rest(DriftBank& bank, double seconds) {
    for (double t = 0.0; t < seconds; t += kWindow_s)
      bank.learn(kWindow_s, rest(kWindow_s));
  }
  DriftMeasurement rest(double length_s) {
    const std::array<double, 2> mean = pass(length_s);
    DriftMeasurement both(2);
    both.rows(0, kBias1) = both.rows(1, kBias2) = 1.0;
    for (int gyro = 0; gyro < 2; ++gyro) {
      const double sigma = kWhite[static_cast<std::size_t>(gyro)] / std::sqrt(length_s);
      both.values(gyro) = mean[static_cast<std::size_t>(gyro)] + random_.normal(sigma);
      both.noise(gyro, gyro) = squared(sigma);
    }
    return both;
  }
  DriftMeasurement difference(double length_s) {
    const DriftMeasurement both = rest(length_s);
    DriftMeasurement one(1);
    one.rows(0, kBias1) = 1.0;
    one.rows(0, kBias2) = -1.0;
    one.values(0) = both.values(0) - both.values(1);
    one.noise(0, 0) = both.noise(0, 0) + both.noise(1, 1);
    return one;
  }
  /// Time passes without a measurement; returns the means.
  std::array<double, 2> pass(double length_s) {
    constexpr int kSteps = 20;
    std::array<double, 2> mean{};
    const double h = length_s / kSteps;
    for (int i = 0; i < kSteps; ++i, t_s_ += h) {
      for (std::size_t k = 0; k < 2; ++k) {
        const double step = random_.normal(walk_[k] * std::sqrt(h));
        mean[k] += (walked_[k] + 0.5 * step + course_(k, t_s_ + 0.5 * h)) / kSteps;
        walked_[k] += step;
      }
    }
    return mean;
  }
  [[nodiscard]] double bias(std::size_t gyro) const { return walked_[gyro] + course_(gyro, t_s_); }

 private:
  Random random_;
  Course course_;
  std::array<double, 2> walk_;
  std::array<double, 2> walked_{};
  double t_s_ = 0.0;
};

double sigma_of(const DriftBank& bank, int gyro) {
  return std::sqrt(bank.estimate().covariance(gyro, gyro));
}
double error_of(const DriftBank& bank, const World& world, int gyro) {
  return bank.estimate().mean(gyro) - world.bias(static_cast<std::size_t>(gyro));
}

// A ramp that shows in two minutes of rest is predicted for 100 s: within σ, and better than if its
// level were held.
TEST(DriftBank, ForetellsARampForAHundredSeconds) {
  for (const double share : {0.03, 0.1, 0.3}) {
    double square = 0.0;
    double error_square = 0.0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      SCOPED_TRACE(::testing::Message() << share << " N a second, seed " << seed);
      World world(seed, [share](std::size_t gyro, double t_s) {
        return (gyro == 0 ? 0.1 : -0.2) + (gyro == 0 ? share : -share) * kWhite[gyro] * t_s;
      });
      DriftBank bank({});
      world.begin(bank);
      world.learn_rest(bank, 120.0);
      bank.predict(100.0);
      world.pass(100.0);
      for (int gyro = 0; gyro < 2; ++gyro) {
        const double error = error_of(bank, world, gyro);
        EXPECT_LT(std::abs(error), 4.0 * sigma_of(bank, gyro)) << gyro;
        square += squared(error / sigma_of(bank, gyro)) / (2.0 * kRuns);
        error_square += squared(error / (share * 100.0 * kWhite[static_cast<std::size_t>(gyro)])) /
                        (2.0 * kRuns);
      }
    }
    EXPECT_LT(square, 1.0 + kSigmas * std::sqrt(2.0 / (2.0 * kRuns))) << share;
    if (share >= 0.1) {
      EXPECT_LT(std::sqrt(error_square), 0.5) << share << ", of what it ran away";
    }
  }
}

// Two gyros that warm up: A·exp(−t/τ), begun at a third to a half of N a second, seen for a minute.
TEST(DriftBank, ForetellsGyrosThatWarmUp) {
  for (const double tau_s : {60.0, 120.0, 300.0, 600.0}) {
    for (const double ahead_s : {30.0, 100.0, 300.0}) {
      double square = 0.0;
      for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
        SCOPED_TRACE(::testing::Message()
                     << "tau " << tau_s << " s, " << ahead_s << " s ahead, seed " << seed);
        World world(seed, [tau_s](std::size_t gyro, double t_s) {
          const double begin = gyro == 0 ? 0.3 : -0.5;
          return begin * kWhite[gyro] * tau_s * std::exp(-t_s / tau_s);
        });
        DriftBank bank({});
        world.begin(bank);
        world.learn_rest(bank, 60.0);
        bank.predict(ahead_s);
        world.pass(ahead_s);
        for (int gyro = 0; gyro < 2; ++gyro) {
          const double away = error_of(bank, world, gyro) / sigma_of(bank, gyro);
          EXPECT_LT(std::abs(away), 3.0) << gyro;
          square += squared(away) / (2.0 * kRuns);
        }
      }
      EXPECT_LT(square, 1.5) << "tau " << tau_s << " s, " << ahead_s << " s ahead";
    }
  }
}

// The cost of considering slopes when there are none: σ relative to one filter that models a walk
// alone, on the same data.
TEST(DriftBank, PaysLittleForSlopesThatAreNotThere) {
  constexpr std::array<double, 2> kWalk{3e-5, 6e-5};
  std::array<GyroParameters, 2> gyros;
  DriftModel model;
  for (std::size_t k = 0; k < 2; ++k) {
    gyros[k].walk_dps_rts = kWalk[k];
    model.walk_dps_rts[k] = kWalk[k];
  }
  constexpr std::array<double, 3> kAhead_s{10.0, 100.0, 600.0};
  std::array<std::array<double, 2>, kAhead_s.size()> ratio{};
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    World world(
        seed, [](std::size_t /*gyro*/, double /*t_s*/) { return 0.1; }, kWalk);
    DriftBank bank(gyros);
    const DriftMeasurement first = world.rest(kWindow_s);
    const Symmetric doubt{first.noise(0, 0), 0.0, first.noise(1, 1)};
    bank.begin(kWhite, {first.values(0), first.values(1)}, doubt);
    DriftFilter::Observables mean = DriftFilter::Observables::Zero();
    mean << first.values(0), first.values(1), 0.0, 0.0;
    DriftFilter::Covariance covariance = DriftFilter::Covariance::Zero();
    covariance.diagonal() << doubt[0], doubt[2], squared(DriftBank::kScaleSigma),
        squared(DriftBank::kSkewSigma_s);
    DriftFilter plain(model, mean, covariance);
    for (double t = kWindow_s; t < 120.0; t += kWindow_s) {
      const DriftMeasurement one = world.rest(kWindow_s);
      bank.learn(kWindow_s, one);
      plain.update(kWindow_s, one);
    }
    double ahead_s = 0.0;
    for (std::size_t i = 0; i < kAhead_s.size(); ++i) {
      for (; ahead_s < kAhead_s[i]; ahead_s += 10.0) {
        const DriftMeasurement one = world.difference(10.0);
        bank.learn(10.0, one);
        plain.update(10.0, one);
      }
      for (int gyro = 0; gyro < 2; ++gyro) {
        ratio[i][static_cast<std::size_t>(gyro)] +=
            sigma_of(bank, gyro) / std::sqrt(plain.covariance()(gyro, gyro)) / kRuns;
      }
    }
  }
  for (std::size_t i = 0; i < kAhead_s.size(); ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_LT(ratio[i][k], 1.1) << kAhead_s[i] << " s after a rest of 120 s, gyro " << k + 1;
      EXPECT_GT(ratio[i][k], 0.99) << "less than what is possible: " << kAhead_s[i];
    }
  }
}

// Two stops, ten kelvins apart, determine the coefficient; farther away its effect grows, and its
// uncertainty too.
TEST(DriftBank, LearnsTheTemperatureCoefficientAtTwoStops) {
  constexpr std::array<double, 2> kCoefficient{1e-3, -3e-3};  // deg/s/K
  std::array<GyroParameters, 2> gyros;
  gyros[0].learns_temperature = gyros[1].learns_temperature = true;
  double square = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    SCOPED_TRACE(seed);
    double temperature_c = 20.0;
    World world(seed, [&](std::size_t gyro, double /*t_s*/) {
      return 0.1 + kCoefficient[gyro] * (temperature_c - 20.0);
    });
    DriftBank bank(gyros);
    world.begin(bank);
    bank.set_temperature({20.0, 20.0});
    world.learn_rest(bank, 60.0);
    const double unknown = sigma_of(bank, 0);
    for (int i = 1; i <= 10; ++i) {
      temperature_c = 20.0 + i;
      bank.set_temperature({temperature_c, temperature_c});
      bank.learn(6.0, world.difference(6.0));
    }
    EXPECT_GT(sigma_of(bank, 0), 2.0 * unknown) << "what the common part does is not known yet";
    world.learn_rest(bank, 60.0);

    std::array<double, 2> before{};
    for (const double away_k : {0.0, 10.0, 20.0, 40.0}) {
      temperature_c = 30.0 + away_k;
      bank.observe_at({temperature_c, temperature_c});
      for (int gyro = 0; gyro < 2; ++gyro) {
        const auto k = static_cast<std::size_t>(gyro);
        const double away = error_of(bank, world, gyro) / sigma_of(bank, gyro);
        EXPECT_LT(std::abs(away), 4.0) << gyro << " at " << temperature_c;
        EXPECT_GT(sigma_of(bank, gyro), before[k]) << gyro << " at " << temperature_c;
        before[k] = sigma_of(bank, gyro);
        if (away_k == 40.0) square += squared(away) / (2.0 * kRuns);
      }
    }
    DriftMemory memory;
    bank.save(memory);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_TRUE(memory.has_temperature[k]);
      EXPECT_LT(std::abs(memory.coefficient_dps_k[k] - kCoefficient[k]),
                4.0 * memory.coefficient_sigma_dps_k[k]);
      EXPECT_LT(memory.coefficient_sigma_dps_k[k], 0.3 * kWhite[k]) << "it has learned";
    }
  }
  EXPECT_LT(square, 1.0 + kSigmas * std::sqrt(2.0 / (2.0 * kRuns))) << "seeds 1 to " << kRuns;
}

// A missing thermometer gives no temperature.
TEST(DriftBank, PassesOverATemperatureThatIsNotKnown) {
  std::array<GyroParameters, 2> gyros;
  gyros[0].learns_temperature = gyros[1].learns_temperature = true;
  World world(1, [](std::size_t /*gyro*/, double /*t_s*/) { return 0.1; });
  DriftBank bank(gyros);
  world.begin(bank);
  world.learn_rest(bank, 60.0);
  const DriftEstimate before = bank.estimate();
  const double none = std::nan("");
  bank.set_temperature({none, none});
  bank.observe_at({none, none});
  EXPECT_EQ(bank.estimate().mean, before.mean);
  EXPECT_EQ(bank.estimate().covariance, before.covariance);
  DriftMemory memory;
  bank.save(memory);
  EXPECT_FALSE(memory.has_temperature[0] || memory.has_temperature[1]);
}

// Weights are probabilities, also in the saved memory.
TEST(DriftBank, SavesProbabilities) {
  World world(2, [](std::size_t gyro, double t_s) { return gyro == 0 ? 3e-4 * t_s : 0.0; });
  DriftBank bank({});
  world.begin(bank);
  world.learn_rest(bank, 120.0);
  DriftMemory memory;
  bank.save(memory);
  double kinds = 0.0;
  double walks = 0.0;
  for (const double weight : memory.kind_weight)
    kinds += weight;
  for (const double weight : memory.walk_weight)
    walks += weight;
  EXPECT_NEAR(kinds, 1.0, 1e-12);
  EXPECT_NEAR(walks, 1.0, 1e-12);
  const DriftEstimate now = bank.estimate();
  for (std::size_t kind = 0; kind < kDriftKinds; ++kind)
    EXPECT_NEAR(now.kind_weight[kind], memory.kind_weight[kind], 1e-6) << kind;
  EXPECT_LT(memory.kind_weight[0], 0.5) << "a ramp of a third of N a second is no walk";
}

}  // namespace
}  // namespace vgyro::fusion
