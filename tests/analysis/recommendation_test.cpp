#include "analysis/recommendation.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vgyro::analysis {
namespace {

NoiseFit make_fit(double white, double walk) {
  NoiseFit fit;
  fit.white_dps_rthz = {true, white, 0.01 * white, 0.0};
  fit.walk_dps_rts = {true, walk, 0.1 * walk, 0.0};
  fit.ramp_sigma_dps_s = 1e-7;
  return fit;
}

// Variance of the prediction of a simulated drift, window by window, as in the corrector.
double simulated_variance(double white, double walk, double ramp_dps_s, int order) {
  std::mt19937_64 engine(5);
  std::normal_distribution<double> normal;
  constexpr int kSteps = 100;
  constexpr double kWindow_s = 20.0;
  constexpr double kStep_s = kWindow_s / kSteps;
  double sum = 0.0;
  constexpr int kWindows = 10'000;
  for (int w = 0; w < kWindows; ++w) {
    double drift = 0.0;
    double mean = 0.0;
    double slope = 0.0;
    double truth = 0.0;
    for (int i = 0; i < 2 * kSteps; ++i) {
      drift += normal(engine) * walk * std::sqrt(kStep_s) + ramp_dps_s * kStep_s;
      if (i >= kSteps) {
        truth += drift / kSteps;
        continue;
      }
      const double y = drift + normal(engine) * white / std::sqrt(kStep_s);
      mean += y / kSteps;
      slope += y * ((i + 0.5) / kSteps - 0.5) * 12.0 / kSteps;
    }
    const double error = mean + (order == 1 ? slope : 0.0) - truth;
    sum += error * error / kWindows;
  }
  return sum;
}

TEST(Recommendation, PredictionVarianceIsThatOfSimulatedWindows) {
  const double of_variance = std::sqrt(2.0 / 10'000);
  for (const int order : {0, 1}) {
    for (const auto& [white, walk, ramp] :
         {std::array{1e-3, 1e-9, 0.0}, std::array{1e-9, 1e-3, 0.0}, std::array{1e-3, 1e-4, 1e-4}}) {
      const double simulated = simulated_variance(white, walk, ramp, order);
      // A window of a hundred steps approximates a continuous one within 1.5 %.
      EXPECT_NEAR(prediction_variance(make_fit(white, walk), walk, ramp, 20.0, order) / simulated,
                  1.0, 0.015 + 3.5 * of_variance)
          << order << " " << white << " " << walk;
    }
  }
}

TEST(Recommendation, WindowGrowsWithNoiseAndShrinksWithDrift) {
  const double base_s = recommend(make_fit(1e-3, 1e-4), 1e5).window_s;
  EXPECT_GT(recommend(make_fit(1e-2, 1e-4), 1e5).window_s, base_s);
  EXPECT_LT(recommend(make_fit(1e-3, 1e-3), 1e5).window_s, base_s);
  // √1.5 N/K is the optimum; a shorter window within 10 % of its error is chosen.
  EXPECT_LE(base_s, 12.0);
  EXPECT_GE(base_s, 5.0);
}

TEST(Recommendation, SlopeNeedsEvidenceAndMustPay) {
  NoiseFit fit = make_fit(1e-4, 1e-7);
  fit.ramp_dps_s = 1e-4;
  fit.ramp_sigma_dps_s = 1e-4;
  EXPECT_EQ(recommend(fit, 3600.0).order, 0);
  fit.ramp_sigma_dps_s = 1e-6;
  EXPECT_EQ(recommend(fit, 3600.0).order, 1);
  fit.ramp_dps_s = 1e-8;
  fit.ramp_sigma_dps_s = 1e-10;
  EXPECT_EQ(recommend(fit, 3600.0).order, 0);
}

TEST(Recommendation, ShortRecordAllowsNoLongWindow) {
  const Recommendation advice = recommend(make_fit(1e-2, 1e-5), 60.0);
  EXPECT_LE(advice.window_s, 15.0);
  EXPECT_TRUE(advice.record_limits);
}

}  // namespace
}  // namespace vgyro::analysis
