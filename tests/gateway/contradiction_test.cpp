// Two gyros that cannot be on one platform as configured: no rate is valid from then on, frames,
// status and state file show it, and motion that fits withdraws it. Healthy pairs, and pairs with
// one failing gyro, never get this verdict.

#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "gateway/condition_text.h"
#include "gateway/config.h"
#include "gateway/pipeline.h"
#include "gateway/saved_state.h"
#include "rig.h"

namespace vgyro::gateway {
namespace {

using fusion::Contradiction;
using rig::at_ms;
using rig::ms;

constexpr double kRest_s = 5.0;
constexpr std::int64_t kTurnsFrom_ms = 8'000;
constexpr std::int64_t kEnd_ms = 40'000;

/// At rest, then moving to and fro.
double truth_dps(double t_s) {
  return t_s < 8.0 ? 0.0 : 15.0 * std::sin(0.9 * (t_s - 8.0));
}

Plan plan_of(Method method = Method::kOptimal) {
  Plan plan = rig::two_gyros();
  plan.corrector.method = method;
  plan.calibration.rest_s = kRest_s;
  return plan;
}

class Noise {
 public:
  explicit Noise(std::uint32_t seed) : rng_(seed) {}
  double operator()(double sigma) { return std::normal_distribution<double>(0.0, sigma)(rng_); }

 private:
  std::mt19937_64 rng_;
};

struct Played {
  std::unique_ptr<Pipeline> pipeline;
  rig::Collector out;
};

/// Gyro b reads `slope` times the platform's rate, plus a bias.
Played play(const Plan& plan, double slope, std::int64_t end_ms = kEnd_ms,
            const SavedState* state = nullptr, std::int64_t begin_ms = 0) {
  Played played{std::make_unique<Pipeline>(plan), {}};
  if (state != nullptr) {
    EXPECT_TRUE(played.pipeline->resume(*state));
  }
  Noise noise(7);
  const auto first = [&](double t_s) { return truth_dps(t_s) + 0.5 + noise(0.01); };
  const auto second = [&](double t_s) {
    return slope * truth_dps(t_s) - 0.3 + noise(0.01 * std::min(1.0, std::abs(slope)));
  };
  rig::play(*played.pipeline,
            rig::merge({rig::stream_a(ms(begin_ms), ms(end_ms), first),
                        rig::stream_b(ms(begin_ms), ms(end_ms), second)}),
            played.out);
  return played;
}

TEST(ContradictionTest, OfSignTakesTheRatesValidityInEveryMethod) {
  for (const Method method : {Method::kOptimal, Method::kMutual, Method::kMean}) {
    const Plan plan = plan_of(method);
    const Played played = play(plan, -1.0);
    const Status& status = played.pipeline->status();
    EXPECT_EQ(status.state, State::kContradicted);
    EXPECT_EQ(status.pair.contradiction, Contradiction::kSign);
    EXPECT_NEAR(status.pair.slope, -1.0, 0.01);
    EXPECT_GT(status.pair.probability, 0.99);
    EXPECT_EQ(status.contradictions, 1);
    EXPECT_TRUE(status.disagree);
    EXPECT_EQ(contradiction_text(status.pair, {"fog", "mems"}),
              "mems moves -1.00 times fog: sign = -1?");
    const auto rates = rig::rates_seen(played.out);
    // Three seconds of motion are enough.
    for (const rig::RateSeen& rate : rates) {
      if (rate.stamp < at_ms(kTurnsFrom_ms + 10'000)) continue;
      ASSERT_FALSE(rate.valid) << to_string(method);
      EXPECT_EQ(rate.raw, -(1 << 23));
      EXPECT_EQ(rate.state, State::kContradicted);
      EXPECT_EQ(rate.quality, 0U);
    }
    const auto biases = played.out.with_id(0x611);
    EXPECT_EQ(rig::bits(biases.back().frame, 59, 5), 16U) << "the gyros disagree";
  }
}

TEST(ContradictionTest, IsToldOfUnitsToo) {
  for (const double factor : {57.29577951308232, 1.0 / 57.29577951308232, 1.0 / 3600.0}) {
    const Played played = play(plan_of(), factor);
    const Status& status = played.pipeline->status();
    EXPECT_EQ(status.pair.contradiction, Contradiction::kScale) << factor;
    EXPECT_NEAR(status.pair.slope / factor, 1.0, 0.1) << factor;
    const std::string text = contradiction_text(status.pair, {"fog", "mems"});
    const bool radians = factor > 50.0 ? factor < 60.0 : factor > 0.01;
    EXPECT_NE(text.find(radians ? "rad/s and deg/s" : "deg/s and deg/h"), std::string::npos)
        << text;
  }
}

TEST(ContradictionTest, IsNotHeardOfAHealthyPair) {
  for (const double slope : {1.0, 0.8, 1.3}) {
    const Played played = play(plan_of(), slope);
    EXPECT_EQ(played.pipeline->status().state, State::kRunning);
    EXPECT_EQ(played.pipeline->status().contradictions, 0);
    EXPECT_EQ(played.pipeline->status().pair.contradiction, Contradiction::kNone);
  }
}

TEST(ContradictionTest, IsTakenBackByMotionThatFits) {
  Pipeline pipeline(plan_of(Method::kMean));
  rig::Collector out;
  const auto turns = [](double t_s) { return 15.0 * std::sin(0.9 * t_s); };
  const auto turned_about = [&](double t_s) { return (t_s < 30.0 ? -1.0 : 1.0) * turns(t_s); };
  rig::play(pipeline,
            rig::merge({rig::stream_a(ms(0), ms(80'000), turns),
                        rig::stream_b(ms(0), ms(80'000), turned_about)}),
            out);
  const auto rates = rig::rates_seen(out);
  const auto at = [&](std::int64_t t_ms) {
    return *std::find_if(rates.begin(), rates.end(),
                         [&](const rig::RateSeen& rate) { return rate.stamp >= at_ms(t_ms); });
  };
  EXPECT_FALSE(at(29'000).valid);
  EXPECT_TRUE(rates.back().valid);
  EXPECT_EQ(rates.back().state, State::kRunning);
  EXPECT_EQ(pipeline.status().contradictions, 1);
}

TEST(ContradictionTest, OutlivesARestartUntilThePairHasMoved) {
  const Plan plan = plan_of();
  const Played before = play(plan, -1.0);
  const std::string text = to_text(before.pipeline->memory().value());
  EXPECT_NE(text.find("contradiction = \"sign\"\ncontradiction_slope = -"), std::string::npos)
      << text;
  const auto state = saved_state_from(text, "state.toml");
  ASSERT_TRUE(state) << state.error().what;
  EXPECT_EQ(to_text(*state), text);

  const auto first_valid = [&](const Played& played) -> std::optional<double> {
    for (const rig::RateSeen& rate : rig::rates_seen(played.out))
      if (rate.valid) return to_seconds(rate.stamp - TimePoint{});
    return std::nullopt;
  };
  // The frames of the second run continue on the same clock; it begins with a rest.
  const Played still = play(plan, 1.0, kTurnsFrom_ms, &*state);
  EXPECT_EQ(still.pipeline->status().state, State::kContradicted);
  EXPECT_FALSE(first_valid(still));
  const Played wrong = play(plan, -1.0, kEnd_ms, &*state);
  EXPECT_FALSE(first_valid(wrong));
  const Played right = play(plan, 1.0, kEnd_ms, &*state);
  EXPECT_EQ(right.pipeline->status().state, State::kRunning);
  ASSERT_TRUE(first_valid(right));
  EXPECT_GT(*first_valid(right), 8.0);
}

TEST(ContradictionTest, LeavesTheStateFileOfASoundPairAsItWas) {
  const Played played = play(plan_of(), 1.0);
  EXPECT_EQ(to_text(played.pipeline->memory().value()).find("contradiction"), std::string::npos);
}

TEST(ContradictionTest, IsNoReasonToBelieveOneGyroAlone) {
  const Plan plan = plan_of();
  Pipeline pipeline(plan);
  rig::Collector out;
  const auto second = [](double t_s) { return -truth_dps(t_s); };
  rig::play(pipeline,
            rig::merge({rig::stream_a(ms(0), ms(50'000), truth_dps),
                        rig::stream_b(ms(0), ms(kEnd_ms), second)}),
            out);
  EXPECT_EQ(pipeline.status().state, State::kDegraded);
  EXPECT_EQ(pipeline.status().pair.contradiction, Contradiction::kSign);
  EXPECT_FALSE(rig::rates_seen(out).back().valid) << "nothing says that it is the right one";
}

// --- one gyro fails ------------------------------------------------------------------------------

struct Sickness {
  const char* name;
  /// The reading of gyro b at this rate of the platform and this time, after its reading before.
  std::function<double(double rate_dps, double t_s, double before_dps, Noise& noise)> reads;
};

const Sickness kSicknesses[] = {
    {"stuck", [](double, double, double before_dps, Noise&) { return before_dps; }},
    {"zero", [](double, double, double, Noise&) { return 0.0; }},
    {"blind", [](double, double, double, Noise& noise) { return -0.3 + noise(0.01); }},
    {"clipped",
     [](double rate_dps, double, double, Noise&) { return std::clamp(rate_dps, -4.0, 4.0); }},
    {"noisy", [](double rate_dps, double, double, Noise& noise) { return rate_dps + noise(15.0); }},
    {"stepped", [](double rate_dps, double, double, Noise&) { return rate_dps + 20.0; }},
    {"drifting",
     [](double rate_dps, double t_s, double, Noise&) { return rate_dps + 0.1 * (t_s - 15.0); }},
    {"with outliers", [](double rate_dps, double t_s, double,
                         Noise&) { return rate_dps + (std::fmod(t_s, 0.7) < 0.01 ? 200.0 : 0.0); }},
    {"trembling", [](double rate_dps, double t_s, double, Noise&) {
       return rate_dps + 3.0 * std::sin(2.0 * 3.14159265 * 17.3 * t_s);
     }}};

TEST(ContradictionTest, IsNotHeardWhereOneFallsSick) {
  for (const Sickness& sickness : kSicknesses) {
    for (std::uint32_t seed = 0; seed < 8; ++seed) {
      Pipeline pipeline(plan_of());
      rig::Collector out;
      Noise noise(seed);
      const double size = 5.0 * std::pow(1.7, seed % 4);
      const double pace = 0.4 + 0.3 * seed;
      const auto rate = [&](double t_s) {
        return t_s < 8.0 ? 0.0 : size * std::sin(pace * (t_s - 8.0));
      };
      double before_dps = 0.0;
      const auto first = [&](double t_s) { return rate(t_s) + 0.5 + noise(0.01); };
      const auto second = [&](double t_s) {
        const double well_dps = rate(t_s) - 0.3 + noise(0.01);
        const bool sick = t_s > 15.0 && t_s < 45.0 && (seed % 2 == 0 || std::fmod(t_s, 6.0) < 3.0);
        before_dps = sick ? sickness.reads(well_dps, t_s, before_dps, noise) : well_dps;
        return before_dps;
      };
      rig::play(pipeline,
                rig::merge({rig::stream_a(ms(0), ms(60'000), first),
                            rig::stream_b(ms(0), ms(60'000), second)}),
                out);
      EXPECT_EQ(pipeline.status().contradictions, 0)
          << sickness.name << ", seed " << seed << ": "
          << contradiction_text(pipeline.status().pair, {"a", "b"});
    }
  }
}

}  // namespace
}  // namespace vgyro::gateway
