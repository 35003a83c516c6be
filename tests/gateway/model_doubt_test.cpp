// The published σ must include the doubt stated in the model file: after a wrong compensation both
// gyros agree, so nothing else reveals it.

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "gateway/model_plan.h"
#include "gateway/pipeline.h"
#include "model/catalogue.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using model::Kind;

constexpr unsigned kSeed = 1209;
// Gyro a reads too much by this factor, but the model assigns it to gyro b with the other sign.
constexpr double kScale = 8e-3;
constexpr double kTurn_dps = 4.0;
constexpr double kNoise_dps = 2e-3;
constexpr double kStart_s = 20.0;
constexpr Duration kEnd = std::chrono::seconds(320);

double truth_dps(double t_s) {
  return t_s < kStart_s ? 0.0 : kTurn_dps;
}

// The heading error after a drive that turns one way, and the limit from ∫σ.
struct Heading final : OutputObserver {
  void on_output(const RateOutput& output, const std::array<double, 2>& /*bias_dps*/) override {
    if (!output.valid) return;
    const double t_s = to_seconds(output.instant - TimePoint{});
    const double step_s = last_s > 0.0 ? t_s - last_s : 0.0;
    last_s = t_s;
    if (t_s < kStart_s - 1.0) rest_sigma_dps = output.sigma_dps;
    if (t_s < kStart_s + 1.0) return;
    error_deg += step_s * (output.rate_dps - truth_dps(t_s));
    allowed_deg += step_s * output.sigma_dps;
  }
  double last_s = 0.0;
  double error_deg = 0.0;
  double allowed_deg = 0.0;
  double rest_sigma_dps = 0.0;
};

Plan plan_with(const std::vector<model::Effect>& effects, Method method = Method::kOptimal) {
  Plan plan = rig::two_gyros();
  plan.corrector.method = method;
  plan.calibration.rest_s = 10.0;
  plan.corrector.window_s = 5.0;
  std::vector<Error> errors;
  apply_model({.file = "found.toml", .effects = effects}, plan, errors);
  EXPECT_TRUE(errors.empty());
  return plan;
}

rig::Recording one_way_drive() {
  std::mt19937 random(kSeed);
  std::normal_distribution<double> noise(0.0, kNoise_dps);
  const auto first = [&](double t_s) { return (1.0 + kScale) * truth_dps(t_s) + noise(random); };
  const auto second = [&](double t_s) { return truth_dps(t_s) + noise(random); };
  rig::Recording a = rig::stream_a({}, kEnd, first);
  return rig::merge({std::move(a), rig::stream_b({}, kEnd, second)});
}

Heading drive(const Plan& plan) {
  Pipeline pipeline(plan);
  Heading heading;
  pipeline.observe_output(&heading);
  rig::Collector sink;
  rig::play(pipeline, one_way_drive(), sink);
  return heading;
}

model::Effect scale(double error, double sigma, bool ambiguous) {
  return {.gyro = 1,
          .kind = Kind::kScaleFactor,
          .parameters = {error},
          .sigma = {sigma},
          .ambiguous = ambiguous};
}

TEST(ModelDoubt, OfAnAmbiguousScaleFactorCoversTheHeadingErrorOfAOneWayDrive) {
  const Heading heading = drive(plan_with({scale(-kScale / (1.0 + kScale), 3e-5, true)}));
  RecordProperty("seed", kSeed);
  EXPECT_GT(std::abs(heading.error_deg), 8.0) << "the wrong reading was applied";
  EXPECT_LT(std::abs(heading.error_deg), 1.2 * heading.allowed_deg);
  EXPECT_LT(heading.allowed_deg, 3.0 * std::abs(heading.error_deg)) << "and says no more than that";
  EXPECT_LT(heading.rest_sigma_dps, 2.0 * kNoise_dps) << "at rest nothing of it is there";
}

TEST(ModelDoubt, IsNeededForThat) {
  // Without the stated doubt, the same drive is far beyond σ: the corrector cannot see the error.
  const Heading heading = drive(plan_with({scale(-kScale / (1.0 + kScale), 0.0, false)}));
  EXPECT_GT(std::abs(heading.error_deg), 3.0 * heading.allowed_deg);
}

TEST(ModelDoubt, OfOneGyroCountsByItsShareOfTheRate) {
  const Heading known = drive(plan_with({scale(0.0, 0.0, false)}));
  const Heading doubted = drive(plan_with({scale(0.0, 8e-3, false)}));
  const double share = (doubted.allowed_deg - known.allowed_deg) / (8e-3 * kTurn_dps * 300.0);
  EXPECT_GT(share, 0.2);
  EXPECT_LT(share, 0.6);
  EXPECT_EQ(doubted.error_deg, known.error_deg) << "only the statement changes, never the rate";
}

TEST(ModelDoubt, LeavesAMethodWithoutAStatementAlone) {
  const Heading heading =
      drive(plan_with({scale(-kScale / (1.0 + kScale), 3e-5, true)}, Method::kMean));
  EXPECT_TRUE(std::isnan(heading.rest_sigma_dps));
}

TEST(ModelDoubt, OfADelayGoesToTheCorrector) {
  const Plan plan =
      plan_with({{.gyro = 0, .kind = Kind::kDelay, .parameters = {5e-3}, .sigma = {1e-3}},
                 {.gyro = 0, .kind = Kind::kDelay, .parameters = {2e-3}, .ambiguous = true},
                 {.gyro = 1, .kind = Kind::kBandwidth, .parameters = {10.0}, .sigma = {1.0}}});
  EXPECT_DOUBLE_EQ(plan.corrector.gyros[0].lag_sigma_s, 1e-3);
  EXPECT_DOUBLE_EQ(plan.corrector.gyros[0].lag_common_sigma_s, 2e-3);
  EXPECT_NEAR(plan.corrector.gyros[1].lag_sigma_s, 0.1 / (2.0 * 3.14159265358979 * 10.0), 1e-12);
  EXPECT_DOUBLE_EQ(plan.corrector.gyros[1].lag_common_sigma_s, 0.0);
}

}  // namespace
}  // namespace vgyro::gateway
