// A gyro whose bias follows its supply, from the recording to the name.

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "gap/workflow.h"
#include "tests/gap/made_recording.h"

namespace vgyro::gap {
namespace {

using model::Kind;

constexpr double kCoefficient_dps_v = 0.05;
constexpr double kSigmas = 5.0;

/// Steps between four levels, in an order that is no ramp.
double supply_v(double t_s) {
  constexpr std::array kLevels_v{5.0, 4.8, 5.2, 4.9, 5.1, 4.8, 5.0};
  return kLevels_v[static_cast<std::size_t>(t_s / 8.0) % kLevels_v.size()];
}

struct Supplied {
  Making making{.seconds = 150.0, .interval_s = 0.02, .rest_s = 40.0};
  Recording recording;
  model::Model model{.file = "m.toml", .effects = noise_effects(making)};

  explicit Supplied(double coefficient_dps_v) {
    making.error = [=](std::size_t gyro, double t_s, double) {
      return gyro == 1 ? coefficient_dps_v * (supply_v(t_s) - 5.0) : 0.0;
    };
    recording = make_recording(making);
  }
};

std::vector<std::string> said_of_supply(const Result& result) {
  std::vector<std::string> said;
  for (const NotIdentifiable& lack : result.not_identifiable) {
    if (lack.kind == Kind::kSupplyVoltageBias) said.push_back(lack.why);
  }
  return said;
}

TEST(SupplyVoltageBias, IsNamedWhereTheSupplyMoves) {
  Supplied supplied(kCoefficient_dps_v);
  for (const double t_s : supplied.recording.gyros[1].t_s)
    supplied.recording.gyros[1].supply_v.push_back(supply_v(t_s));
  const auto result = find_gap({supplied.recording}, supplied.model, {});
  ASSERT_TRUE(result) << result.error().message();
  ASSERT_EQ(result->effects.size(), 1U);
  const NamedEffect& named = result->effects[0];
  EXPECT_EQ(named.effect.kind, Kind::kSupplyVoltageBias);
  EXPECT_EQ(named.effect.gyro, 1U);
  EXPECT_NEAR(named.effect.parameters[0], kCoefficient_dps_v, kSigmas * named.sigma[0]);
  EXPECT_EQ(named.effect.parameters[1], 5.0);
  EXPECT_NE(named.evidence.find("the residual of b follows its supply voltage"), std::string::npos)
      << named.evidence;
  EXPECT_EQ(named.figure.x_label, "supply voltage / V");
  EXPECT_TRUE(said_of_supply(*result).empty());
}

// Who names no such signal is not told of it; who does is told when it says nothing.
TEST(SupplyVoltageBias, IsAskedForOnlyWhereTheSupplyIsToldAndStandsStill) {
  Supplied supplied(0.0);
  const auto without = find_gap({supplied.recording}, supplied.model, {});
  ASSERT_TRUE(without) << without.error().message();
  EXPECT_TRUE(said_of_supply(*without).empty());
  supplied.recording.gyros[0].supply_v.assign(supplied.recording.gyros[0].t_s.size(), 5.0);
  const auto with = find_gap({supplied.recording}, supplied.model, {});
  ASSERT_TRUE(with) << with.error().message();
  ASSERT_EQ(said_of_supply(*with).size(), 1U);
  EXPECT_EQ(said_of_supply(*with)[0],
            "the supply voltage is constant in this recording, within 0 V");
}

}  // namespace
}  // namespace vgyro::gap
