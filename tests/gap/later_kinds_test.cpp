// Kinds that drives need, each from the recording to the name.

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "gap/workflow.h"
#include "tests/gap/made_recording.h"

namespace vgyro::gap {
namespace {

using model::Kind;

constexpr double kSigmas = 5.0;

struct Made {
  Making making{.seconds = 240.0, .interval_s = 0.02, .rest_s = 40.0};
  Recording recording;
  model::Model model{.file = "m.toml", .effects = noise_effects(making)};

  explicit Made(const std::function<double(double t_s, double rate_dps)>& error_of_2) {
    making.error = [=](std::size_t gyro, double t_s, double rate_dps) {
      return gyro == 1 ? error_of_2(t_s, rate_dps) : 0.0;
    };
    recording = make_recording(making);
  }

  [[nodiscard]] Result found() const {
    const auto result = find_gap({recording}, model, {});
    EXPECT_TRUE(result);
    return result.value_or(Result{});
  }
};

void expect_only(const Result& result, Kind kind, const model::Parameters& truth) {
  ASSERT_EQ(result.effects.size(), 1U);
  const NamedEffect& named = result.effects[0];
  EXPECT_EQ(named.effect.kind, kind) << named.evidence;
  EXPECT_EQ(named.effect.gyro, 1U);
  EXPECT_TRUE(named.ambiguous_with.empty());
  EXPECT_EQ(result.verdict, Verdict::kExplained);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_NEAR(named.effect.parameters[i], truth[i], kSigmas * named.sigma[i])
        << named.evidence << ", parameter " << i;
  }
}

TEST(RunIn, IsNamedWhereADriftBecomesEverSlower) {
  const Made made([](double t_s, double) { return 0.01 * std::log(1.0 + t_s / 4.0); });
  const Result result = made.found();
  expect_only(result, Kind::kRunIn, {0.01, 4.0});
}

// A ramp is a logarithm that does not bend: the plainer word is enough, and the only one.
TEST(RunIn, IsNoRivalOfARamp) {
  const Made made([](double t_s, double) { return 5e-5 * t_s; });
  expect_only(made.found(), Kind::kBiasRamp, {5e-5});
}

// --- temperature with play ---

double swinging_c(double t_s) {
  return 25.0 + 4.0 * std::sin(2.0 * kPi * t_s / 100.0) + 1.5 * std::sin(2.0 * kPi * t_s / 37.0);
}

/// swinging_c() followed with a play, at multiples of a hundredth of a second.
std::vector<double> followed_c(double play_k, double seconds) {
  constexpr double kStep_s = 0.01;
  std::vector<double> followed{swinging_c(0.0)};
  for (int i = 1; i * kStep_s < seconds + 1.0; ++i) {
    const double now_c = swinging_c(i * kStep_s);
    followed.push_back(std::min(std::max(followed.back(), now_c - play_k), now_c + play_k));
  }
  return followed;
}

Made with_temperature(const std::function<double(double t_s, double rate_dps)>& error_of_2) {
  Made made(error_of_2);
  for (GyroSeries& gyro : made.recording.gyros) {
    for (const double t_s : gyro.t_s)
      gyro.temperature_c.push_back(swinging_c(t_s));
  }
  return made;
}

TEST(TemperatureHysteresis, IsNamedWhereTheBiasGoesAnotherWayBack) {
  const std::vector<double> followed = followed_c(1.0, 240.0);
  const Made made = with_temperature([&](double t_s, double) {
    return 0.006 * (followed[static_cast<std::size_t>(std::lround(100.0 * t_s))] - swinging_c(t_s));
  });
  const Result result = made.found();
  expect_only(result, Kind::kTemperatureHysteresis, {0.006, 1.0});
  EXPECT_EQ(result.effects[0].figure.x_label, "temperature with play less temperature / K");
}

// Its two words for what it is not: all of the temperature, and its slope.
TEST(TemperatureHysteresis, IsNoRivalOfWhatFollowsTheTemperatureAtOnce) {
  expect_only(
      with_temperature([](double t_s, double) { return 0.002 * (swinging_c(t_s) - 25.0); }).found(),
      Kind::kTemperatureBias, {0.002, 25.0});
}

// --- other axes ---

double rolling_dps(double t_s) {
  return 9.0 * std::sin(2.0 * kPi * t_s / 6.1) + 5.0 * std::sin(2.0 * kPi * t_s / 1.7);
}

Made rolling(double coefficient, double told) {
  Made made([=](double t_s, double) { return coefficient * rolling_dps(t_s); });
  for (GyroSeries& gyro : made.recording.gyros) {
    for (const double t_s : gyro.t_s) {
      gyro.other_rate_dps[0].push_back(told * rolling_dps(t_s));
      gyro.other_rate_dps[1].push_back(told * 10.0 * std::cos(2.0 * kPi * t_s / 4.3));
    }
  }
  return made;
}

TEST(CrossAxis, IsNamedWithTheAxisThatItComesFrom) {
  const Result result = rolling(2e-3, 1.0).found();
  expect_only(result, Kind::kCrossAxis, {0.0, 2e-3});
  EXPECT_EQ(result.effects[0].figure.x_label, "rate about x / (deg/s)");
  EXPECT_NE(result.effects[0].evidence.find("follows the rate about x"), std::string::npos);
}

// Who names no other axis is not asked for it; who does is told of each that never turned.
TEST(CrossAxis, IsAskedForOnlyWhereTheAxesAreToldAndStandStill) {
  const auto said = [](const Result& result) {
    return std::count_if(result.not_identifiable.begin(), result.not_identifiable.end(),
                         [](const NotIdentifiable& lack) { return lack.kind == Kind::kCrossAxis; });
  };
  EXPECT_EQ(said(Made([](double, double) { return 0.0; }).found()), 0);
  EXPECT_EQ(said(rolling(0.0, 1.0).found()), 0);
  EXPECT_EQ(said(rolling(0.0, 0.0).found()), 4);
}

// --- low-pass of second order ---

/// y'' = w² (rate − y) − 2 damping w y' by Runge and Kutta, ten steps in each sample, from rest.
std::vector<double> low_passed_twice_dps(const Making& making, double cutoff_hz, double damping) {
  constexpr int kParts = 10;
  using State = std::array<double, 2>;
  const double w = 2.0 * kPi * cutoff_hz;
  const double h = making.interval_s / kParts;
  const auto slope = [&](const State& y, double t_s) {
    return State{y[1], w * w * (true_rate_dps(making, t_s) - y[0]) - 2.0 * damping * w * y[1]};
  };
  const auto moved = [](const State& y, const State& by, double step) {
    return State{y[0] + step * by[0], y[1] + step * by[1]};
  };
  State y{true_rate_dps(making, 0.0), 0.0};
  std::vector<double> all{y[0]};
  for (int i = 0; i * making.interval_s < making.seconds; ++i) {
    for (int k = 0; k < kParts; ++k) {
      const double t_s = i * making.interval_s + k * h;
      const State a = slope(y, t_s);
      const State b = slope(moved(y, a, h / 2.0), t_s + h / 2.0);
      const State c = slope(moved(y, b, h / 2.0), t_s + h / 2.0);
      const State d = slope(moved(y, c, h), t_s + h);
      for (std::size_t j = 0; j < 2; ++j)
        y[j] += h / 6.0 * (a[j] + 2.0 * b[j] + 2.0 * c[j] + d[j]);
    }
    all.push_back(y[0]);
  }
  return all;
}

Made low_passed_twice(double cutoff_hz, double damping) {
  const Making making = Made([](double, double) { return 0.0; }).making;
  const std::vector<double> late = low_passed_twice_dps(making, cutoff_hz, damping);
  return Made([&](double t_s, double rate_dps) {
    return late[static_cast<std::size_t>(std::lround(t_s / making.interval_s))] - rate_dps;
  });
}

// The motion's fastest sine has 0.37 Hz.
TEST(BandwidthSecondOrder, IsNamedWhereTheCutOffIsWithinTheMotion) {
  expect_only(low_passed_twice(1.0, 0.6).found(), Kind::kBandwidthSecondOrder, {1.0, 0.6});
}

// --- flicker ---

/// Terms a factor of two apart, from the sampling interval to hours.
std::vector<double> flicker_dps(double coefficient_dps, const Making& making, std::uint64_t seed) {
  const double sigma_dps = coefficient_dps * std::sqrt(std::log(2.0) / kPi);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> sum(static_cast<std::size_t>(making.seconds / making.interval_s) + 1, 0.0);
  for (double tau_s = making.interval_s; tau_s < 2e4; tau_s *= 2.0) {
    const double keep = std::exp(-making.interval_s / tau_s);
    double state = sigma_dps * normal(random);
    for (double& value : sum) {
      state = keep * state + sigma_dps * std::sqrt(1.0 - keep * keep) * normal(random);
      value += state;
    }
  }
  return sum;
}

TEST(BiasInstability, IsNamedWhereDriftIsAsStrongOverAllTimes) {
  constexpr double kB_dps = 0.004;
  constexpr std::uint64_t kSeed = 3;
  const std::vector<double> flicker =
      flicker_dps(kB_dps, Making{.seconds = 240.0, .interval_s = 0.02}, kSeed);
  const Made made([&](double t_s, double) {
    return flicker[static_cast<std::size_t>(std::lround(t_s / 0.02))];
  });
  const Result result = made.found();
  ASSERT_EQ(result.effects.size(), 1U) << "seed " << kSeed;
  const NamedEffect& named = result.effects[0];
  EXPECT_EQ(named.effect.kind, Kind::kBiasInstability) << named.evidence;
  EXPECT_NEAR(named.effect.parameters[0], kB_dps, kSigmas * named.sigma[0]);
  EXPECT_LT(named.sigma[0], 0.2 * kB_dps);
  EXPECT_EQ(result.verdict, Verdict::kExplained);
}

}  // namespace
}  // namespace vgyro::gap
