#include "gateway/model_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "gateway/pipeline.h"
#include "model/catalogue.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using model::Kind;

model::Model model_of(std::initializer_list<model::Effect> effects) {
  return {.file = "known.toml", .effects = effects};
}

std::vector<Error> apply(const model::Model& model, Plan& plan) {
  std::vector<Error> errors;
  apply_model(model, plan, errors);
  return errors;
}

TEST(ModelPlan, GivesNoiseToTheCorrector) {
  Plan plan = rig::two_gyros();
  plan.corrector.gyros[1].resolution_dps = 1e-3;
  const auto errors = apply(model_of({{0, Kind::kWhiteNoise, {3e-4}, 3},
                                      {0, Kind::kWhiteNoise, {4e-4}, 6},
                                      {0, Kind::kGaussMarkov, {1e-3, 100.0}, 9},
                                      {0, Kind::kGaussMarkov, {2e-3, 10.0}, 12},
                                      {1, Kind::kRateRandomWalk, {5e-6}, 15},
                                      {1, Kind::kRateNoise, {1e-5}, 18},
                                      {1, Kind::kQuantization, {1e-2}, 21}}),
                            plan);
  EXPECT_TRUE(errors.empty());
  const auto& [a, b] = plan.corrector.gyros;
  ASSERT_TRUE(a.white_dps_rthz);
  EXPECT_DOUBLE_EQ(*a.white_dps_rthz, 5e-4) << "in squares";
  EXPECT_FALSE(a.walk_dps_rts) << "what is not given is not zero";
  ASSERT_EQ(a.gauss_markov_count, 2U);
  EXPECT_EQ(a.gauss_markov[1].sigma_dps, 2e-3);
  EXPECT_EQ(a.gauss_markov[1].tau_s, 10.0);
  EXPECT_FALSE(b.white_dps_rthz);
  EXPECT_EQ(b.walk_dps_rts, 5e-6);
  EXPECT_EQ(b.rate_noise_rthz, 1e-5);
  EXPECT_EQ(b.resolution_dps, 1e-2);
}

/// Checks the rates after the calibration; during it they are not valid.
struct Finite final : RateObserver {
  void on_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) override {
    (void)raw_dps;
    if (t < TimePoint{rig::ms(3000)}) return;
    ++rates;
    all = all && std::isfinite(virtual_dps);
  }
  std::size_t rates = 0;
  bool all = true;
};

// The weakest and the strongest noise that a model file may state: of either gyro, of both, in any
// mix.
TEST(ModelPlan, AnyNoiseOfTheCatalogueGivesFiniteRates) {
  const auto turn = [](double t_s) { return t_s < 5.0 ? 0.0 : 20.0 * std::sin(t_s); };
  const rig::Recording recording = rig::merge(
      {rig::stream_a({}, rig::ms(15000), turn), rig::stream_b({}, rig::ms(15000), turn)});
  for (const Kind kind : {Kind::kWhiteNoise, Kind::kRateRandomWalk, Kind::kGaussMarkov,
                          Kind::kRateNoise, Kind::kQuantization}) {
    const auto parameters = model::info(kind).parameters;
    for (unsigned corner = 0; corner < 16; ++corner) {
      model::Model model{.file = "known.toml", .effects = {}};
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        model::Effect effect{gyro, kind, {}, 3};
        for (std::size_t i = 0; i < parameters.size(); ++i) {
          const model::Parameter& p = parameters[i];
          const bool most = (corner >> (2 * gyro + i) & 1U) != 0;
          effect.parameters[i] = most ? p.maximum : std::max(p.minimum, p.least);
        }
        model.effects.push_back(effect);
      }
      Plan plan = rig::two_gyros();
      ASSERT_TRUE(apply(model, plan).empty());
      Pipeline pipeline(plan);
      Finite finite;
      pipeline.observe(&finite);
      rig::Collector sink;
      rig::play(pipeline, recording, sink);
      EXPECT_GT(finite.rates, 1000U);
      EXPECT_TRUE(finite.all) << model::info(kind).name << " corner " << corner;
      for (const GyroStatus& gyro : pipeline.status().gyros)
        EXPECT_TRUE(std::isfinite(gyro.bias_dps)) << model::info(kind).name << " " << corner;
    }
  }
}

TEST(ModelPlan, GivesLimitsToTheGyros) {
  Plan plan = rig::two_gyros();
  EXPECT_TRUE(apply(model_of({{0, Kind::kSaturation, {300.0}, 3},
                              {0, Kind::kSaturation, {250.0}, 6},
                              {1, Kind::kDeadBand, {0.1}, 9}}),
                    plan)
                  .empty());
  EXPECT_EQ(plan.gyros[0].saturation_dps, 250.0);
  EXPECT_EQ(plan.gyros[0].dead_band_dps, 0.0);
  EXPECT_EQ(plan.gyros[1].dead_band_dps, 0.1);
}

TEST(ModelPlan, ComplainsAtTheModelsLineOfAnInputThatIsNotConfigured) {
  Plan plan = rig::two_gyros();
  plan.gyros[0].temperature = rig::quantity_of(rig::signal_of(32, 16));
  plan.gyros[0].rate_x = rig::quantity_of(rig::signal_of(48, 16));
  const auto errors = apply(model_of({{0, Kind::kTemperatureBias, {1e-3, 25.0}, 3},
                                      {1, Kind::kTemperatureBias, {1e-3, 25.0}, 8},
                                      {0, Kind::kGSensitivity, {0.0, 1e-3}, 13},
                                      {1, Kind::kSupplyVoltageBias, {1e-3, 5.0}, 18},
                                      {0, Kind::kCrossAxis, {0.0, 1e-3}, 23},
                                      {0, Kind::kCrossAxis, {1.0, 1e-3}, 28}}),
                            plan);
  ASSERT_EQ(errors.size(), 4U);
  EXPECT_EQ(errors[0].where, "known.toml:8");
  EXPECT_NE(errors[0].message().find("gyro b"), std::string::npos);
  EXPECT_NE(errors[0].remedy.find("temperature = "), std::string::npos);
  EXPECT_EQ(errors[1].where, "known.toml:13");
  EXPECT_NE(errors[1].remedy.find("[accelerometer]"), std::string::npos);
  EXPECT_EQ(errors[2].where, "known.toml:18");
  EXPECT_NE(errors[2].remedy.find("supply_voltage = "), std::string::npos);
  // The axis matters: only y is missing.
  EXPECT_EQ(errors[3].where, "known.toml:28");
  EXPECT_NE(errors[3].message().find("the rate of gyro a about y"), std::string::npos);
  EXPECT_NE(errors[3].remedy.find("rate_x, rate_y or rate_z = "), std::string::npos);
}

// Three correlated drifts a decade apart; fewer if the model has some already.
TEST(ModelPlan, GivesFlickerToTheCorrectorAsTheDriftsThatItHasRoomFor) {
  Plan plan = rig::two_gyros();
  EXPECT_TRUE(apply(model_of({{0, Kind::kBiasInstability, {3e-3}, 3},
                              {0, Kind::kBiasInstability, {4e-3}, 6},
                              {1, Kind::kBiasInstability, {5e-3}, 9},
                              {1, Kind::kGaussMarkov, {1e-3, 40.0}, 12},
                              {1, Kind::kGaussMarkov, {2e-3, 7.0}, 15}}),
                    plan)
                  .empty());
  // Independent noises add as squares.
  const fusion::GyroParameters& a = plan.corrector.gyros[0];
  ASSERT_EQ(a.gauss_markov_count, 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.gauss_markov[i].sigma_dps, 5e-3 * std::sqrt(std::log(10.0) / std::numbers::pi),
                1e-12);
    EXPECT_NEAR(a.gauss_markov[i].tau_s, 3.0 * std::pow(10.0, static_cast<double>(i) + 0.5), 1e-9);
  }
  const fusion::GyroParameters& b = plan.corrector.gyros[1];
  ASSERT_EQ(b.gauss_markov_count, 3U);
  EXPECT_EQ(b.gauss_markov[0].tau_s, 40.0);
  EXPECT_EQ(b.gauss_markov[1].tau_s, 7.0);
  EXPECT_NEAR(b.gauss_markov[2].tau_s, std::sqrt(3.0 * 3000.0), 1e-9);
}

TEST(ModelPlan, RefusesMoreLagThanTheBuffersHold) {
  Plan plan = rig::two_gyros();
  EXPECT_TRUE(apply(model_of({{0, Kind::kDelay, {0.2}, 3}}), plan).empty());
  const auto errors =
      apply(model_of({{0, Kind::kDelay, {0.2}, 3}, {0, Kind::kBandwidth, {1.0}, 7}}), plan);
  ASSERT_EQ(errors.size(), 1U);
  EXPECT_EQ(errors[0].where, "known.toml:7");
}

// Biases learned under one model are meaningless under another.
TEST(ModelPlan, MarksWhatIsTakenOffEachGyro) {
  const auto mark = [](std::initializer_list<model::Effect> effects) {
    Plan plan = rig::two_gyros();
    EXPECT_TRUE(apply(model_of(effects), plan).empty());
    return plan.gyros[0].taken_back;
  };
  const std::string bias = mark({{0, Kind::kBias, {0.1}, 3}});
  EXPECT_EQ(bias.size(), 8U);
  EXPECT_EQ(mark({{0, Kind::kBias, {0.1}, 30}}), bias) << "wherever it stands";
  EXPECT_NE(mark({{0, Kind::kBias, {0.1000001}, 3}}), bias);
  EXPECT_NE(mark({{0, Kind::kBiasRamp, {0.1}, 3}}), bias);
  EXPECT_EQ(mark({{0, Kind::kWhiteNoise, {0.1}, 3}, {1, Kind::kBias, {0.1}, 7}}), "");
}

TEST(ModelPlan, SortsEffectsByGyro) {
  Plan plan = rig::two_gyros();
  EXPECT_TRUE(effects_of(plan, 0).empty());
  apply(model_of({{1, Kind::kBias, {0.1}, 3}, {0, Kind::kBias, {0.2}, 7}}), plan);
  ASSERT_EQ(effects_of(plan, 1).size(), 1U);
  EXPECT_EQ(effects_of(plan, 1)[0].parameters[0], 0.1);
}

}  // namespace
}  // namespace vgyro::gateway
