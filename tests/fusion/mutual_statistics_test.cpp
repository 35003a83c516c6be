// The effect of noise on the paper's method, measured on many seeds and compared with the algebra.

#include <gtest/gtest.h>

#include "fusion/calibration.h"
#include "fusion/corrector.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kSigma_dps = 0.02;

Calibration calibrated(int order, double rest_s, double rate_hz, Random& random) {
  Calibrator calibrator(order, rest_s);
  for (int i = 0;; ++i) {
    const std::array<double, 2> rate_dps{random.normal(kSigma_dps), random.normal(kSigma_dps)};
    if (!calibrator.add((i + 0.5) / rate_hz, rate_dps, 0.0)) return calibrator.result();
  }
}

// A slope fitted on a short rest has σ_slope = σ·√12/(T√n), and its heading error grows as
// ½σ_slope·t². Holding the bias alone costs far less, unless there really is a slope.
TEST(MutualStatistics, HeadingErrorOfAFittedSlopeGrowsWithTheSquareOfTime) {
  constexpr double kRest_s = 60.0;
  constexpr double kRate_hz = 10.0;
  constexpr double kSamples = kRest_s * kRate_hz;
  constexpr int kRuns = 300;
  // Of the mean of two gyros.
  const double bias_sigma = kSigma_dps / std::sqrt(2.0 * kSamples);
  const double slope_sigma = bias_sigma * std::sqrt(12.0) / kRest_s;
  const auto predicted = [&](int order, double t_s) {
    // Level and slope are independent at the middle of the rest, T/2 before the run begins.
    const double by_slope = slope_sigma * (0.5 * t_s * t_s + 0.5 * kRest_s * t_s);
    return std::hypot(bias_sigma * t_s, order == 0 ? 0.0 : by_slope);
  };
  for (const int order : {0, 1}) {
    Rms at_300_s;
    Rms at_600_s;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      Random random(seed);
      const auto corrector = make_mutual_corrector(order, 10.0);
      corrector->start(calibrated(order, kRest_s, kRate_hz, random));
      double heading_deg = 0.0;
      for (int i = 0; i < 6000; ++i) {
        if (i == 3000) at_300_s.add(heading_deg);
        heading_deg += corrector->update({kRest_s + (i + 0.5) * 0.1, {0.0, 0.0}}).rate_dps * 0.1;
      }
      at_600_s.add(heading_deg);
    }
    SCOPED_TRACE(::testing::Message() << "order " << order << ", seeds from 1");
    const double allowed = kSigmas * at_300_s.relative_error();
    EXPECT_NEAR(at_300_s.value() / predicted(order, 300.0), 1.0, allowed);
    EXPECT_NEAR(at_600_s.value() / predicted(order, 600.0), 1.0, allowed);
    if (order == 1) {
      // ½σ_slope·t² alone is nearly all of the error.
      EXPECT_NEAR(at_600_s.value() / (0.5 * slope_sigma * 600.0 * 600.0), 1.0, 0.1 + allowed);
      EXPECT_GT(at_600_s.value(), 10.0 * predicted(0, 600.0));
    }
  }
}

// "Linear extrapolation by one window costs √7 times holding the mean", made precise. In white
// noise of σ over n samples the next window's *measured* mean differs from its prediction by
//   holding the mean:      1 + 1 = 2        (its own noise and that of the mean held)  ·σ²/n
//   the line, one T on:    1 + 12 + 1 = 14  (level, slope·T, and the measurement)      ·σ²/n
// and √(14/2) = √7. Against the *true* mean it is worse still: √13.
TEST(MutualStatistics, LinearExtrapolationByOneWindowCostsRootSeven) {
  constexpr double kWindow_s = 10.0;
  constexpr int kSamples = 100;
  constexpr int kRuns = 1500;
  std::array<Rms, 2> against_measured;
  std::array<Rms, 2> against_truth;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    for (const int order : {0, 1}) {
      Random random(seed);
      const auto corrector = make_mutual_corrector(order, kWindow_s);
      corrector->start(Calibration{});
      const auto window = [&](int number) {
        double mean = 0.0;
        for (int i = 0; i < kSamples; ++i) {
          const double difference = random.normal(kSigma_dps);
          corrector->update({number * kWindow_s + (i + 0.5) * kWindow_s / kSamples,
                             {0.5 * difference, -0.5 * difference}});
          mean += difference / kSamples;
        }
        return mean;
      };
      window(0);
      const double measured = window(1);
      const Drift drift = corrector->drift(1.5 * kWindow_s);
      const double prediction = drift.bias_dps[0] - drift.bias_dps[1];
      against_measured[static_cast<std::size_t>(order)].add(prediction - measured);
      against_truth[static_cast<std::size_t>(order)].add(prediction);
    }
  }
  const double unit = kSigma_dps / std::sqrt(kSamples);
  const double allowed = kSigmas * against_measured[0].relative_error();
  EXPECT_NEAR(against_measured[0].value() / (std::sqrt(2.0) * unit), 1.0, allowed);
  EXPECT_NEAR(against_measured[1].value() / (std::sqrt(14.0) * unit), 1.0, allowed);
  EXPECT_NEAR(against_truth[1].value() / (std::sqrt(13.0) * unit), 1.0, allowed);
  const double cost = against_measured[1].value() / against_measured[0].value();
  EXPECT_NEAR(cost / std::sqrt(7.0), 1.0, allowed * std::sqrt(2.0));
}

// With equal weights the worse gyro contributes half of its noise: (σ₁² + σ₂²)/4 > σ₁² once σ₂ >
// √3·σ₁.
TEST(MutualStatistics, MeanIsWorseThanTheBetterGyroBeyondRootThree) {
  constexpr int kSamples = 20'000;
  for (const double ratio : {1.0, 1.6, std::sqrt(3.0), 1.87, 10.0}) {
    SCOPED_TRACE(::testing::Message() << "ratio " << ratio << " seed 1");
    Random random(1);
    const auto mean = make_mean_corrector();
    const auto mutual = make_mutual_corrector(1, 10.0);
    mutual->start(Calibration{});
    Rms better;
    Rms of_mean;
    Rms of_mutual;
    for (int i = 0; i < kSamples; ++i) {
      const RatePair pair{0.01 * i, {random.normal(kSigma_dps), random.normal(ratio * kSigma_dps)}};
      better.add(pair.rate_dps[0]);
      of_mean.add(mean->update(pair).rate_dps);
      of_mutual.add(mutual->update(pair).rate_dps);
    }
    const double allowed = kSigmas * better.relative_error();
    const double predicted = 0.5 * std::sqrt(1.0 + ratio * ratio);
    EXPECT_NEAR(of_mean.value() / kSigma_dps, predicted, predicted * allowed);
    EXPECT_NEAR(of_mutual.value() / kSigma_dps, predicted, predicted * allowed)
        << "the mutual step does nothing about it";
    if (ratio < 1.7) {
      EXPECT_LT(of_mean.value(), better.value());
    }
    if (ratio > 1.8) {
      EXPECT_GT(of_mean.value(), better.value());
    }
  }
}

// With noise, the difference of the drifts is known as well as one window allows: the extrapolated
// line of a window errs by 2σ_d/√n at its end and by √28·σ_d/√n at the end of the next.
TEST(MutualStatistics, FollowsAChangingDifferenceWithinTheNoiseOfOneWindow) {
  constexpr double kWindow_s = 10.0;
  constexpr int kSamples = 200;
  constexpr int kRuns = 300;
  Rms at_start;
  Rms at_end;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    Random random(seed);
    const auto corrector = make_mutual_corrector(1, kWindow_s);
    corrector->start(Calibration{});
    const double slope = random.uniform(-0.01, 0.01);
    constexpr double kEnd_s = 5 * kWindow_s;
    for (int i = 0; i <= 5 * kSamples; ++i) {
      const double t_s = (i + 0.5) * kWindow_s / kSamples;
      corrector->update(
          {t_s, {5.0 + slope * t_s + random.normal(kSigma_dps), 5.0 + random.normal(kSigma_dps)}});
    }
    const auto error = [&](double t_s) {
      const Drift drift = corrector->drift(t_s);
      return drift.bias_dps[0] - drift.bias_dps[1] - slope * t_s;
    };
    at_start.add(error(kEnd_s));
    at_end.add(error(kEnd_s + kWindow_s));
  }
  const double unit = std::sqrt(2.0) * kSigma_dps / std::sqrt(kSamples);
  const double allowed = kSigmas * at_start.relative_error();
  EXPECT_NEAR(at_start.value() / (2.0 * unit), 1.0, allowed);
  EXPECT_NEAR(at_end.value() / (std::sqrt(28.0) * unit), 1.0, allowed);
}

}  // namespace
}  // namespace vgyro::fusion
