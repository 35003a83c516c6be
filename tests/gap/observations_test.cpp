#include "gap/observations.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

constexpr double kSigmas = 4.0;
// What interpolation of the motion and of what else moves leaves, as a share of the greatest value.
constexpr double kInterpolation = 2e-4;

Making making_of(std::uint64_t seed, double seconds = 60.0) {
  Making making;
  making.seconds = seconds;
  making.rest_s = 10.0;
  making.seed = seed;
  return making;
}

Making without_noise_of(const Making& noisy) {
  Making making = noisy;
  making.white_dps_rthz.fill(0.0);
  making.walk_dps_rts.fill(0.0);
  return making;
}

// What gyro 1 is seen with: signals in closed form, all sampled finely enough to be exact here.
Signals full_signals(const Making& making) {
  Signals signals = *signals_of(making);
  std::vector<double> t_s;
  std::array<std::vector<double>, 6> value;
  for (double t = 0.0; t <= making.seconds; t += making.interval_s) {
    t_s.push_back(t);
    value[0].push_back(true_temperature_c(t));
    value[1].push_back(true_temperature_slope_c_s(t));
    for (std::size_t axis = 0; axis < 3; ++axis)
      value[2 + axis].push_back(true_acceleration_g(axis, t));
    value[5].push_back(1e-3 * (1.0 + std::sin(0.3 * t)));
  }
  signals.temperature_c = SampledCurve(t_s, value[0]);
  signals.temperature_slope_c_s = SampledCurve(t_s, value[1]);
  for (std::size_t axis = 0; axis < 3; ++axis)
    signals.acceleration_g[axis] = SampledCurve(t_s, value[2 + axis]);
  signals.vibration_g2 = SampledCurve(t_s, value[5]);
  return signals;
}

Observations full_observations(const Making& making) {
  const auto signals = std::make_shared<const Signals>(full_signals(making));
  const Circumstances about{
      making.seconds, true, {making.interval_s, making.interval_s}, {}, {signals, signals}};
  std::vector<Observation> samples;
  for (double t_s = 0.0; t_s < making.seconds - 0.5 * making.interval_s; t_s += making.interval_s)
    samples.push_back({t_s, Channel::kGyro1, 0.0, true_rate_dps(making, t_s)});
  return make_observations(std::move(samples), about, {true, false}, {nullptr, 2}, 0.0, {});
}

// reading = late + Σ added(late), late = rate(t/(1 + skew) − delay): what is added to the rate.
struct Equation {
  Effect effect;
  std::function<double(double t_s, double late_dps)> added_dps;
};
std::vector<Equation> equations(const Making& making) {
  const auto excess_c = [](double t_s) { return true_temperature_c(t_s) - 20.0; };
  const std::vector<double> angle_rad = true_angle_rad(making);
  const double interval_s = making.interval_s;
  const auto angle = [angle_rad, interval_s](double t_s) {
    return angle_rad[static_cast<std::size_t>(std::lround(t_s / interval_s))];
  };
  return {
      {{0, Kind::kBias, {0.3}, 0}, [](double, double) { return 0.3; }},
      {{0, Kind::kBiasRamp, {-0.02}, 0}, [](double t, double) { return -0.02 * t; }},
      {{0, Kind::kBiasStep, {0.5, 31.415}, 0},
       [](double t, double) { return t < 31.415 ? 0.0 : 0.5; }},
      {{0, Kind::kWarmUp, {2.0, 9.0}, 0},
       [](double t, double) { return 2.0 * std::exp(-t / 9.0); }},
      {{0, Kind::kTemperatureBias, {0.1, 20.0}, 0},
       [=](double t, double) { return 0.1 * excess_c(t); }},
      {{0, Kind::kTemperatureBiasQuadratic, {0.01, 20.0}, 0},
       [=](double t, double) { return 0.01 * std::pow(excess_c(t), 2); }},
      {{0, Kind::kTemperatureRateBias, {3.0}, 0},
       [](double t, double) { return 3.0 * true_temperature_slope_c_s(t); }},
      {{0, Kind::kScaleFactor, {0.02}, 0}, [](double, double late) { return 0.02 * late; }},
      {{0, Kind::kScaleFactorAsymmetry, {-0.03}, 0},
       [](double, double late) { return late < 0.0 ? 0.03 * late : -0.03 * late; }},
      {{0, Kind::kScaleFactorQuadratic, {1e-3}, 0},
       [](double, double late) { return 1e-3 * late * late; }},
      {{0, Kind::kScaleFactorCubic, {1e-5}, 0},
       [](double, double late) { return 1e-5 * late * late * late; }},
      {{0, Kind::kScaleFactorTemperature, {1e-3, 20.0}, 0},
       [=](double t, double late) { return 1e-3 * excess_c(t) * late; }},
      {{0, Kind::kGSensitivity, {1.0, 2.0}, 0},
       [](double t, double) { return 2.0 * true_acceleration_g(1, t); }},
      {{0, Kind::kVibrationRectification, {5.0}, 0},
       [](double t, double) { return 5e-3 * (1.0 + std::sin(0.3 * t)); }},
      {{0, Kind::kAngleHarmonic, {3.0, 0.2, 0.4}, 0},
       [=](double t, double) { return 0.2 * std::cos(3.0 * angle(t) + 0.4); }},
      {{0, Kind::kLine, {7.3, 0.1, 0.9}, 0},
       [](double t, double) { return 0.1 * std::sin(2.0 * kPi * 7.3 * t + 0.9); }},
  };
}

std::string name(const Effect& effect) {
  return std::string(model::info(effect.kind).name);
}

void expect_near(const Eigen::VectorXd& ours, const Eigen::VectorXd& truth, double tolerance,
                 const std::string& what) {
  ASSERT_EQ(ours.size(), truth.size());
  Eigen::Index worst = 0;
  EXPECT_LT((ours - truth).cwiseAbs().maxCoeff(&worst), tolerance)
      << what << ", sample " << worst << ": " << ours[worst] << " instead of " << truth[worst];
}

TEST(Observations, EveryKindAddsWhatItsEquationSays) {
  const Making making = making_of(91);
  const Observations data = full_observations(making);
  for (const Equation& equation : equations(making)) {
    Eigen::VectorXd truth(data.size());
    for (Eigen::Index i = 0; i < data.size(); ++i) {
      const double t_s = data.t_s[static_cast<std::size_t>(i)];
      truth[i] = equation.added_dps(t_s, true_rate_dps(making, t_s));
    }
    const double tolerance = kInterpolation * truth.cwiseAbs().maxCoeff();
    expect_near(data.contribution(0, {equation.effect}), truth, tolerance, name(equation.effect));
    // The residual of a reading that is nothing else.
    expect_near(data.residual({equation.effect}), -truth, tolerance, name(equation.effect));
    // Another gyro's effect is none of this one's.
    Effect other = equation.effect;
    other.gyro = 1;
    EXPECT_EQ(data.contribution(1, {other}).norm(), 0.0) << name(other);
    EXPECT_EQ(data.residual({other}).norm(), 0.0) << name(other);
  }
}

TEST(Observations, WhatIsLateReadsAnEarlierRate) {
  const Making making = making_of(92);
  const Observations data = full_observations(making);
  constexpr double kDelay_s = 0.0123;
  constexpr double kSkew_ppm = 250.0;
  const std::vector<double> slow_dps = low_passed_rate_dps(making, 3.0);
  const Effect delay{0, Kind::kDelay, {kDelay_s}, 0};
  const Effect skew{0, Kind::kClockSkew, {kSkew_ppm}, 0};
  const Effect low_pass{0, Kind::kBandwidth, {3.0}, 0};
  Eigen::VectorXd of_delay(data.size());
  Eigen::VectorXd of_skew(data.size());
  Eigen::VectorXd of_both(data.size());
  Eigen::VectorXd of_low_pass(data.size());
  for (Eigen::Index i = 0; i < data.size(); ++i) {
    const double t_s = data.t_s[static_cast<std::size_t>(i)];
    const double rate_dps = true_rate_dps(making, t_s);
    const double true_s = t_s / (1.0 + 1e-6 * kSkew_ppm);
    of_delay[i] = true_rate_dps(making, t_s - kDelay_s) - rate_dps;
    of_skew[i] = true_rate_dps(making, true_s) - rate_dps;
    of_both[i] = true_rate_dps(making, true_s - kDelay_s) - rate_dps;
    of_low_pass[i] = slow_dps[static_cast<std::size_t>(i)] - rate_dps;
  }
  const auto check = [&](const Effects& effects, const Eigen::VectorXd& truth) {
    expect_near(data.contribution(0, effects), truth, kInterpolation * truth.cwiseAbs().maxCoeff(),
                name(effects.front()));
  };
  check({delay}, of_delay);
  check({skew}, of_skew);
  check({skew, delay}, of_both);
  check({low_pass}, of_low_pass);
}

// The sensor distorts the rate that reaches it, which is the late one; offsets know no rate.
TEST(Observations, EveryKindBesideADelaySeesTheLateRate) {
  const Making making = making_of(93);
  const Observations data = full_observations(making);
  const Effect delay{0, Kind::kDelay, {0.08}, 0};
  for (const Equation& equation : equations(making)) {
    Eigen::VectorXd truth(data.size());
    Eigen::VectorXd lateness(data.size());
    for (Eigen::Index i = 0; i < data.size(); ++i) {
      const double t_s = data.t_s[static_cast<std::size_t>(i)];
      const double late_dps = true_rate_dps(making, t_s - 0.08);
      truth[i] = equation.added_dps(t_s, late_dps);
      lateness[i] = late_dps - true_rate_dps(making, t_s);
    }
    const double tolerance = kInterpolation * truth.cwiseAbs().maxCoeff();
    expect_near(data.contribution_beside({delay}, equation.effect), truth, tolerance,
                name(equation.effect));
    const double both = tolerance + kInterpolation * lateness.cwiseAbs().maxCoeff();
    expect_near(data.contribution(0, {equation.effect, delay}), truth + lateness, both,
                name(equation.effect));
    // The other way round: a delay beside a response moves what responds.
    const Eigen::VectorXd alone = data.contribution(0, {equation.effect});
    expect_near(data.contribution_beside({equation.effect}, delay), truth + lateness - alone, both,
                name(equation.effect));
  }
}

// Against a difference that is wide enough to owe nothing to rounding: by Taylor the two differ by
// the square of its half width times a third derivative.
TEST(Observations, DerivativeIsThatOfTheContribution) {
  const Making making = making_of(94, 30.0);
  const Observations data = full_observations(making);
  const Effects others{{0, Kind::kScaleFactor, {0.01}, 0}, {0, Kind::kDelay, {0.01}, 0}};
  struct Asked {
    Effect effect;
    std::array<double, 3> half_width;
  };
  const std::vector<Asked> asked{
      {{0, Kind::kDelay, {0.02}, 0}, {2e-3}},
      {{0, Kind::kClockSkew, {100.0}, 0}, {20.0}},
      {{0, Kind::kBandwidth, {4.0}, 0}, {0.04}},
      {{0, Kind::kWarmUp, {0.5, 8.0}, 0}, {0.1, 0.08}},
      {{0, Kind::kLine, {1.7, 0.3, 0.8}, 0}, {1e-4, 0.1, 0.01}},
      {{0, Kind::kAngleHarmonic, {4.0, 0.3, 0.8}, 0}, {0.0, 0.1, 0.01}},
      {{0, Kind::kScaleFactorCubic, {1e-5}, 0}, {1e-6}},
      {{0, Kind::kTemperatureBias, {0.1, 25.0}, 0}, {0.01}},
      {{0, Kind::kGSensitivity, {1.0, 0.1}, 0}, {0.0, 0.01}},
  };
  for (const Asked& one : asked) {
    for (const Free& free : *row(one.effect.kind).free) {
      const double half = one.half_width[free.parameter];
      ASSERT_GT(half, 0.0) << name(one.effect);
      Effect above = one.effect;
      Effect below = one.effect;
      above.parameters[free.parameter] += half;
      below.parameters[free.parameter] -= half;
      const auto all = [&](const Effect& effect) {
        Effects with = others;
        with.push_back(effect);
        return data.contribution(0, with);
      };
      const Eigen::VectorXd wide = (all(above) - all(below)) / (2.0 * half);
      expect_near(data.derivative(others, one.effect, free), wide,
                  1e-3 * wide.cwiseAbs().maxCoeff(),
                  name(one.effect) + ", parameter " + std::to_string(free.parameter));
    }
  }
}

TEST(Observations, ResidualOfTheTruthIsNoiseAlone) {
  const std::uint64_t seed = 95;
  Making making = making_of(seed);
  making.walk_dps_rts.fill(0.0);
  making.error = [&](std::size_t, double t_s, double rate_dps) {
    const double late_dps = true_rate_dps(making, t_s - 0.03);
    return late_dps * 1.002 + 0.1 - 0.01 * t_s - rate_dps;
  };
  const auto data = observations_of_one(making);
  const Eigen::VectorXd residual = data->residual({{0, Kind::kDelay, {0.03}, 0},
                                                   {0, Kind::kScaleFactor, {0.002}, 0},
                                                   {0, Kind::kBias, {0.1}, 0},
                                                   {0, Kind::kBiasRamp, {-0.01}, 0}});
  const auto count = static_cast<double>(residual.size());
  const double sigma = making.white_dps_rthz[0] / std::sqrt(making.interval_s);
  EXPECT_NEAR(residual.mean(), 0.0, kSigmas * sigma / std::sqrt(count)) << "seed " << seed;
  EXPECT_NEAR(residual.squaredNorm() / count / (sigma * sigma), 1.0,
              kSigmas * std::sqrt(2.0 / count))
      << "seed " << seed;
  // Neighbours hang together by nothing that was left.
  const Eigen::Index n = residual.size();
  EXPECT_NEAR(residual.head(n - 1).dot(residual.tail(n - 1)) / count / (sigma * sigma), 0.0,
              kSigmas / std::sqrt(count))
      << "seed " << seed;
}

// In a difference the second gyro's errors count with the other sign.
TEST(Observations, DifferenceHoldsTheErrorsOfBoth) {
  const Making making = without_noise_of(making_of(96));
  const auto data = observations_of_two(making);
  const Effects effects{{0, Kind::kBias, {0.3}, 0}, {1, Kind::kBias, {0.1}, 0}};
  const Eigen::VectorXd residual = data->residual(effects);
  for (Eigen::Index i = 0; i < data->size(); ++i) {
    const Channel channel = data->channel[static_cast<std::size_t>(i)];
    const double truth = channel == Channel::kGyro1   ? -0.3
                         : channel == Channel::kGyro2 ? -0.1
                                                      : -0.2;
    ASSERT_NEAR(residual[i], truth, 1e-12) << i;
  }
}

// Blocks: every sample in one, of one channel, within one cell of time; cells rise, and in a cell
// the channels.
TEST(Observations, BlocksHoldEverySampleOnceInOrder) {
  Making making = making_of(97);
  making.interval_s = 0.007;  // fourteen or fifteen in a block
  const auto data = observations_of_two(making);
  std::uint32_t next = 0;
  double last_cell = -1.0;
  int last_channel = -1;
  for (const Block& block : data->layout.blocks) {
    ASSERT_EQ(block.first, next);
    ASSERT_GT(block.count, 0U);
    next += block.count;
    const double cell = std::floor(data->t_s[block.first] / kBlock_s);
    ASSERT_TRUE(cell > last_cell ||
                (cell == last_cell && static_cast<int>(block.channel) > last_channel));
    last_cell = cell;
    last_channel = static_cast<int>(block.channel);
    double sum_s = 0.0;
    double squares = 0.0;
    for (std::uint32_t i = block.first; i < next; ++i) {
      ASSERT_EQ(std::floor(data->t_s[i] / kBlock_s), cell);
      ASSERT_EQ(data->channel[i], block.channel);
      if (i > block.first) {
        ASSERT_GT(data->t_s[i], data->t_s[i - 1]);
      }
      sum_s += data->t_s[i];
      squares += std::pow(true_rate_dps(making, data->t_s[i]), 2);
    }
    ASSERT_NEAR(block.t_s, sum_s / block.count, 1e-9);
    ASSERT_NEAR(block.rate_square, squares / block.count, 1e-9 * (1.0 + squares));
  }
  EXPECT_EQ(next, data->t_s.size());
  EXPECT_EQ(data->layout.samples, data->t_s.size());
}

// Slow gyros have blocks of five samples: fewer would not tell white noise from drift.
TEST(Observations, BlocksOfASlowGyroAreLonger) {
  Making making = making_of(98);
  making.interval_s = 0.05;
  const auto data = observations_of_one(making);
  for (std::size_t b = 0; b + 1 < data->layout.blocks.size(); ++b)
    EXPECT_NEAR(data->layout.blocks[b].count, 5, 1) << b;
}

TEST(Observations, SamplesMayComeInAnyOrder) {
  const Making making = making_of(99, 30.0);
  const auto sorted = observations_of_one(making);
  std::vector<Observation> samples;
  for (std::size_t i = 0; i < sorted->t_s.size(); ++i) {
    samples.push_back({sorted->t_s[i], sorted->channel[i],
                       sorted->observed_dps[static_cast<Eigen::Index>(i)],
                       true_rate_dps(making, sorted->t_s[i])});
  }
  std::mt19937_64 random(99);
  std::shuffle(samples.begin(), samples.end(), random);
  const Observations data = make_observations(std::move(samples), circumstances_of(making, true),
                                              {true, false}, {nullptr, 2}, 0.0, {});
  EXPECT_EQ(data.t_s, sorted->t_s);
  EXPECT_EQ(data.observed_dps, sorted->observed_dps);
}

// A quarter of the seconds is set aside, whole seconds, the same on every run and for every gyro,
// and without a period.
TEST(Observations, AboutAQuarterOfTheSecondsIsSetAside) {
  Making making = making_of(100, 400.0);
  making.interval_s = 0.05;
  const auto data = observations_of_one(making);
  const auto again = observations_of_two(making);
  std::vector<int> held(400, -1);
  for (const Block& block : data->layout.blocks) {
    const auto second = static_cast<std::size_t>(block.t_s);
    if (held[second] >= 0) {
      EXPECT_EQ(held[second] != 0, block.held_out) << second;
    }
    held[second] = block.held_out ? 1 : 0;
  }
  double share = 0.0;
  std::set<std::size_t> lengths;
  std::size_t last = 0;
  for (std::size_t second = 0; second < held.size(); ++second) {
    if (held[second] != 1) continue;
    share += 1.0 / static_cast<double>(held.size());
    lengths.insert(second - last);
    last = second;
  }
  EXPECT_NEAR(share, 0.25, kSigmas * std::sqrt(0.25 * 0.75 / 400.0));
  EXPECT_GT(lengths.size(), 5U);
  for (const Block& block : again->layout.blocks)
    EXPECT_EQ(block.held_out, held[static_cast<std::size_t>(block.t_s)] == 1) << block.t_s;
}

TEST(Observations, SpansForTheFitChangeNothingElse) {
  const Making making = making_of(101);
  const auto before = observations_of_one(making);
  const Span span{20.0, 35.5};
  const Observations after = before->with_for_fit({span});
  ASSERT_EQ(after.layout.blocks.size(), before->layout.blocks.size());
  std::size_t changed = 0;
  for (std::size_t b = 0; b < after.layout.blocks.size(); ++b) {
    const Block& was = before->layout.blocks[b];
    const Block& is = after.layout.blocks[b];
    const bool within = is.t_s >= span.from_s && is.t_s <= span.to_s;
    EXPECT_EQ(is.held_out, within ? false : was.held_out) << is.t_s;
    changed += is.held_out != was.held_out ? 1 : 0;
    EXPECT_EQ(is.t_s, was.t_s);
    EXPECT_EQ(is.count, was.count);
    EXPECT_EQ(is.mean_gain, was.mean_gain);
  }
  EXPECT_GT(changed, 0U);
  EXPECT_EQ(after.observed_dps, before->observed_dps);
  EXPECT_EQ(after.t_s, before->t_s);
  // Nothing is set aside at the instants of several spans, nor is the old one forgotten.
  const Observations more = after.with_for_fit({span, {0.0, 5.0}});
  for (const Block& block : more.layout.blocks) {
    const bool within = block.t_s <= 5.0 || (block.t_s >= 20.0 && block.t_s <= 35.5);
    EXPECT_TRUE(!within || !block.held_out) << block.t_s;
  }
}

// Interpolated noise hangs together: a block's gains say by how much, here against noise itself.
TEST(Observations, GainsAreWhatInterpolationMakesOfWhiteNoise) {
  constexpr int kDraws = 4000;
  constexpr double kInterval_s = 0.01;
  constexpr double kOther_s = 0.013;
  Making making = making_of(102, 30.0);
  making.interval_s = kInterval_s;
  std::vector<double> other_s;
  for (double t_s = 0.003; t_s < 0.6; t_s += kOther_s)
    other_s.push_back(t_s);
  std::vector<Observation> samples;
  for (int i = 10; i < 40; ++i)
    samples.push_back({kInterval_s * (i + 0.2), Channel::kDifference, 0.0, 0.0});
  const SampledCurve zero(other_s, std::vector<double>(other_s.size(), 0.0));
  const Observations data = make_observations(samples, circumstances_of(making, false),
                                              {true, true}, {&zero, 1}, 0.0, {});
  std::mt19937_64 random(102);
  std::normal_distribution<double> normal;
  std::vector<double> of_mean(data.layout.blocks.size(), 0.0);
  std::vector<double> within(data.layout.blocks.size(), 0.0);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<double> noise(other_s.size());
    for (double& value : noise)
      value = normal(random);
    const SampledCurve curve(other_s, noise);
    for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
      const Block& block = data.layout.blocks[b];
      Eigen::VectorXd values(block.count);
      for (std::uint32_t i = 0; i < block.count; ++i)
        values[i] = curve.at(data.t_s[block.first + i]).value;
      of_mean[b] += values.mean() * values.mean() / kDraws;
      within[b] += (values.array() - values.mean()).square().sum() / (block.count - 1.0) / kDraws;
    }
  }
  ASSERT_FALSE(data.layout.blocks.empty());
  for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
    const Block& block = data.layout.blocks[b];
    ASSERT_GE(block.count, 9U);
    const double tolerance = kSigmas * std::sqrt(2.0 / kDraws);
    EXPECT_NEAR(of_mean[b] / block.mean_gain[1], 1.0, tolerance) << "block " << b << ", seed 102";
    EXPECT_NEAR(within[b] / block.within_gain[1], 1.0, tolerance) << "block " << b << ", seed 102";
    // The first gyro's own samples are independent.
    EXPECT_EQ(block.within_gain[0], 1.0);
    EXPECT_EQ(block.mean_gain[0], 1.0 / block.count);
    EXPECT_EQ(block.mean_gain[2], 0.0);
  }
}

// Of the rate its magnitude counts, of all else how far it moved; what is not there is not known.
TEST(Observations, ExcitationIsHowFarTheInputsMoved) {
  const Making making = making_of(103);
  const Observations data = full_observations(making);
  const Excitation& excitation = data.excitation[0];
  double rate = 0.0;
  double low_c = 1e9;
  double high_c = -1e9;
  for (const double t_s : data.t_s) {
    rate = std::max(rate, std::abs(true_rate_dps(making, t_s)));
    low_c = std::min(low_c, true_temperature_c(t_s));
    high_c = std::max(high_c, true_temperature_c(t_s));
  }
  EXPECT_NEAR(excitation.of(Input::kRate), rate, 1e-3 * rate);
  EXPECT_NEAR(excitation.of(Input::kTemperature), high_c - low_c, 1e-3);
  EXPECT_NEAR(excitation.of(Input::kAccelerationX), 0.1, 1e-3);
  EXPECT_NEAR(excitation.of(Input::kVibration), 2e-3, 1e-5);
  EXPECT_TRUE(excitation.knows(Input::kTemperature));
  EXPECT_TRUE(excitation.moves(bit(Input::kRate) | bit(Input::kTemperature)));
  const auto bare = observations_of_one(making);
  EXPECT_TRUE(bare->excitation[0].knows(Input::kRate));
  EXPECT_FALSE(bare->excitation[0].knows(Input::kTemperature));
  EXPECT_FALSE(bare->excitation[0].moves(bit(Input::kRate) | bit(Input::kTemperature)));
  EXPECT_TRUE(bare->excitation[0].moves(bit(Input::kRate)));
  EXPECT_TRUE(bare->excitation[0].moves(0));
}

// Asked again and again, in any order, the answers stay what they are: lateness is remembered.
TEST(Observations, RemembersNoWrongAnswer) {
  const Making making = making_of(104, 30.0);
  const Observations data = full_observations(making);
  std::vector<Eigen::VectorXd> first;
  const auto delays = [](int i) {
    return Effects{{0, Kind::kDelay, {1e-3 * (i + 1)}, 0}, {0, Kind::kScaleFactor, {0.01}, 0}};
  };
  constexpr int kMany = 40;
  for (int i = 0; i < kMany; ++i)
    first.push_back(full_observations(making).contribution(0, delays(i)));
  for (int i = 0; i < 2 * kMany; ++i) {
    const int asked = (7 * i) % kMany;
    EXPECT_EQ(data.contribution(0, delays(asked)), first[static_cast<std::size_t>(asked)]) << asked;
  }
}

}  // namespace
}  // namespace vgyro::gap
