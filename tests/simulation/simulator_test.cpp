#include "simulation/simulator.h"

#include <cmath>
#include <complex>
#include <functional>
#include <numbers>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "simulation/low_pass.h"

namespace vgyro::simulation {
namespace {

using model::Effect;
using model::Kind;

constexpr double kRate_hz = 100.0;

Profile sampled(const std::function<double(double)>& rate_dps, std::size_t count) {
  std::vector<double> times_s;
  std::vector<double> rates_dps;
  for (std::size_t i = 0; i < count; ++i) {
    times_s.push_back(static_cast<double>(i) / kRate_hz);
    rates_dps.push_back(rate_dps(times_s.back()));
  }
  Profile profile;
  profile.file = "p.csv";
  profile.length_s = times_s.back();
  profile.rate_dps = Curve(times_s, rates_dps);
  return profile;
}

// The steady-state response to a sine, in complex arithmetic.
TEST(Simulator, LowPassAndDelayTurnASineAsTheyShould) {
  constexpr double kW = 2.0 * std::numbers::pi * 3.0;
  const Profile sine = sampled([](double t_s) { return std::sin(kW * t_s); }, 600);
  for (const std::vector<double>& cutoffs_hz :
       {std::vector<double>{2.0}, {40.0}, {5.0, 20.0}, {8.0, 8.0}, {9.0, 9.0, 9.0}, {3e4}}) {
    model::Model model{.file = "m.toml",
                       .effects = {{.kind = Kind::kDelay, .parameters = {0.0137}}}};
    std::complex<double> gain = std::exp(std::complex<double>(0.0, -kW * 0.0137));
    for (const double cutoff_hz : cutoffs_hz) {
      model.effects.push_back({.kind = Kind::kBandwidth, .parameters = {cutoff_hz}});
      gain /= std::complex<double>(1.0, kW / (2.0 * std::numbers::pi * cutoff_hz));
    }
    const auto simulator = Simulator::make(model, sine, {});
    ASSERT_TRUE(simulator) << simulator.error().message();
    const std::vector<GyroSample> samples = simulator->gyro(0);
    ASSERT_EQ(samples.size(), 600U);
    // Equal cutoffs are moved apart by a thousandth.
    const double tolerance = cutoffs_hz.size() > 1 && cutoffs_hz[0] == cutoffs_hz[1] ? 1e-3 : 1e-8;
    for (std::size_t i = 300; i < 590; ++i) {
      const double t_s = samples[i].t_s;
      const auto answer = std::exp(std::complex<double>(0.0, kW * t_s)) * gain;
      ASSERT_NEAR(samples[i].reading_dps, answer.imag(), tolerance)
          << cutoffs_hz[0] << " Hz at " << t_s;
    }
  }
}

// Ringing, maximally flat, critically damped, and two real poles; alone and after another low-pass.
TEST(Simulator, SecondOrderTurnsASineAsItShould) {
  constexpr double kW = 2.0 * std::numbers::pi * 3.0;
  const Profile sine = sampled([](double t_s) { return std::sin(kW * t_s); }, 1200);
  for (const double damping : {0.2, std::numbers::sqrt2 / 2.0, 1.0, 1.6}) {
    for (const bool behind : {false, true}) {
      model::Model model{
          .file = "m.toml",
          .effects = {{.kind = Kind::kBandwidthSecondOrder, .parameters = {4.0, damping}}}};
      const std::complex<double> x(0.0, 3.0 / 4.0);
      std::complex<double> gain = 1.0 / (1.0 + 2.0 * damping * x + x * x);
      if (behind) {
        model.effects.push_back({.kind = Kind::kBandwidth, .parameters = {9.0}});
        gain /= std::complex<double>(1.0, 3.0 / 9.0);
      }
      const auto simulator = Simulator::make(model, sine, {});
      ASSERT_TRUE(simulator) << simulator.error().message();
      const std::vector<GyroSample> samples = simulator->gyro(0);
      // Equal poles are moved apart by a thousandth.
      const double tolerance = damping == 1.0 ? 1e-5 : 1e-8;
      for (std::size_t i = 700; i < 1190; ++i) {
        const auto answer = std::exp(std::complex<double>(0.0, kW * samples[i].t_s)) * gain;
        ASSERT_NEAR(samples[i].reading_dps, answer.imag(), tolerance) << "damping " << damping;
      }
    }
  }
}

TEST(Simulator, RefusesMoreLowPassesThanCanBeToldApart) {
  const Effect low_pass{.kind = Kind::kBandwidth, .parameters = {10.0}};
  const Profile rest = sampled([](double) { return 0.0; }, 3);
  model::Model model{.file = "m.toml",
                     .effects = std::vector<Effect>(LowPass::kStagesMax, low_pass)};
  EXPECT_TRUE(Simulator::make(model, rest, {}));
  // One more for the other gyro is within the limit.
  model.effects.push_back(low_pass);
  model.effects.back().gyro = 1;
  EXPECT_TRUE(Simulator::make(model, rest, {}));
  model.effects.back().gyro = 0;
  const auto result = Simulator::make(model, rest, {});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().where, "m.toml");
  EXPECT_NE(result.error().message().find("at most 3"), std::string::npos);
}

// A kind whose input has no column, or whose column does not reach the effects, would add nothing.
// A new kind is included without being named here.
TEST(Simulator, EveryKindThatNeedsAnInputIsMovedByIt) {
  std::string text =
      "t_s,rate_dps,temperature_c,acc_x_g,acc_y_g,acc_z_g,supply_v,rate_x_dps,"
      "rate_y_dps,rate_z_dps\n";
  for (int i = 0; i < 200; ++i) {
    const double t_s = i / kRate_hz;
    text += fmt::format("{},10,{},0.1,0.2,{},{},2,3,4\n", t_s, 20.0 + t_s, 0.5 + 0.1 * (i % 2),
                        4.5 + 0.1 * t_s);
  }
  const auto profile = parse_profile(text, "p.csv");
  ASSERT_TRUE(profile) << profile.error().message();
  for (const model::KindInfo& row : model::catalogue()) {
    if (row.needs == model::kNeedsNothing) continue;
    Effect effect{.kind = row.kind, .parameters = {1.0, 1.0}};
    const auto simulator = Simulator::make({.file = "m.toml", .effects = {effect}}, *profile, {});
    ASSERT_TRUE(simulator) << row.name << ": " << simulator.error().message();
    EXPECT_GT(std::abs(simulator->gyro(0)[150].reading_dps - 10.0), 1e-4) << row.name;
    const auto lacking = Simulator::make({.file = "m.toml", .effects = {effect}},
                                         sampled([](double) { return 10.0; }, 200), {});
    EXPECT_FALSE(lacking) << row.name;
  }
}

}  // namespace
}  // namespace vgyro::simulation
