#include "gateway/pipeline.h"

#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "gateway/config.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::Collector;
using rig::constant;
using rig::merge;
using rig::ms;
using rig::RateOf;
using rig::RateSeen;
using rig::Recording;
using rig::stream_a;
using rig::stream_b;

constexpr double kTrue_dps = 2.0;
constexpr double kBiasA_dps = 0.5;
constexpr double kBiasB_dps = -0.3;

// At rest for the calibration, then turning.
RateOf gyro_with(double bias_dps, Duration begin = Duration{0}) {
  const double from_s = to_seconds(begin) + 1.2;
  return [=](double t_s) { return bias_dps + (t_s < from_s ? 0.0 : kTrue_dps); };
}
Recording a(Duration from, Duration to) {
  return stream_a(from, to, gyro_with(kBiasA_dps));
}
Recording b(Duration from, Duration to) {
  return stream_b(from, to, gyro_with(kBiasB_dps));
}
Recording both(Duration to) {
  return merge({a(ms(0), to), b(ms(0), to)});
}
Recording shifted(Recording recording, Duration by) {
  for (rig::Event& event : recording)
    event.stamp += by;
  return recording;
}

struct Bench {
  explicit Bench(const Plan& plan = rig::two_gyros()) : pipeline(plan) {}
  void play(const Recording& recording) { rig::play(pipeline, recording, out); }
  /// Uses the daemon's timer, and records the states on the way.
  void play_live(const Recording& recording, TimePoint until) {
    for (const rig::Event& event : recording) {
      step_to(event.stamp);
      pipeline.receive(event.bus, event.frame, event.stamp, out);
      note_state();
    }
    step_to(until);
  }
  void step_to(TimePoint until) {
    while (pipeline.next_deadline() < until) {
      pipeline.advance(std::max(pipeline.next_deadline(), last), out);
      note_state();
      ++wake_ups;
    }
    last = std::max(last, until);
  }
  void note_state() {
    const State state = pipeline.status().state;
    if (states.empty() || states.back() != state) states.push_back(state);
  }
  [[nodiscard]] std::vector<RateSeen> rates() const { return rig::rates_seen(out); }

  Pipeline pipeline;
  Collector out;
  std::vector<State> states;
  TimePoint last;
  int wake_ups = 0;
};

std::uint64_t health_of(const rig::Output& bias) {
  return rig::bits(bias.frame, 59, 5);
}
std::uint64_t mode_of(const rig::Output& bias) {
  return rig::bits(bias.frame, 56, 3);
}

std::vector<std::vector<std::uint8_t>> rate_payloads(const Collector& out) {
  std::vector<std::vector<std::uint8_t>> payloads;
  for (const rig::Output& output : out.with_id(0x610)) {
    payloads.emplace_back(output.frame.payload().begin(), output.frame.payload().end());
  }
  return payloads;
}

// --- states --------------------------------------------------------------------------------------

// A gateway's life: one gyro drops out and returns, then both do, one after the other.
TEST(PipelineStates, WalkAsTheirTableSays) {
  Bench run;
  run.play_live(merge({a(ms(0), ms(6000)), a(ms(8000), ms(10000)),  //
                       b(ms(0), ms(3000)), b(ms(4000), ms(6000)), b(ms(8500), ms(10000))}),
                at_ms(10000));
  const std::vector<State> expected{State::kWaiting,  State::kCalibrating, State::kRunning,
                                    State::kDegraded, State::kRunning,     State::kDegraded,
                                    State::kLost,     State::kDegraded,    State::kRunning};
  EXPECT_EQ(run.states, expected);
  EXPECT_EQ(rig::times(run.pipeline, 0, Fault::kSilent), 1U);
  EXPECT_EQ(rig::times(run.pipeline, 1, Fault::kSilent), 2U);
}

// A gyro drops out during the calibration: too little is known to continue with the other one.
TEST(PipelineStates, WaitAgainWhenAGyroGoesDuringCalibration) {
  Bench run;
  run.play_live(merge({a(ms(0), ms(3000)), b(ms(0), ms(500)), b(ms(1500), ms(3000))}), at_ms(3000));
  EXPECT_EQ(run.states, (std::vector{State::kWaiting, State::kCalibrating, State::kWaiting,
                                     State::kCalibrating, State::kRunning}));
  for (const RateSeen& rate : run.rates()) {
    EXPECT_EQ(rate.valid, rate.state == State::kRunning || rate.state == State::kDegraded);
  }
}

// A change of state appears in VG_Bias at once, not at the next tenth of a second.
TEST(PipelineStates, AreToldByVgBiasAtOnce) {
  Bench run;
  std::vector<TimePoint> changes;
  State before = State::kWaiting;
  for (const rig::Event& event : merge({a(ms(0), ms(3000)), b(ms(0), ms(2007))})) {
    rig::receive_with_timer(run.pipeline, event, run.out);
    if (run.pipeline.status().state == before) continue;
    before = run.pipeline.status().state;
    ASSERT_FALSE(run.out.frames.empty());
    const auto biases = run.out.with_id(0x611);
    ASSERT_FALSE(biases.empty());
    EXPECT_LE(event.stamp - biases.back().stamp, ms(10));
    changes.push_back(biases.back().stamp);
  }
  EXPECT_EQ(changes.size(), 3U);  // calibrating, running, degraded
}

// VB_Mode follows the states: nothing known, calibrating, tracking, hold.
TEST(PipelineStates, AreReflectedInTheBiasMode) {
  Bench run;
  run.play_live(merge({a(ms(0), ms(4000)), b(ms(500), ms(3000))}), at_ms(4000));
  std::vector<std::uint64_t> modes;
  for (const rig::Output& bias : run.out.with_id(0x611)) {
    if (modes.empty() || modes.back() != mode_of(bias)) modes.push_back(mode_of(bias));
  }
  EXPECT_EQ(modes, (std::vector<std::uint64_t>{0, 1, 2, 3}));
}

// --- rates ---------------------------------------------------------------------------------------

// With two gyros every aligned pair gives exactly one VG_Rate, and nothing else causes one.
TEST(PipelineRates, OneVgRatePerPair) {
  Bench run;
  run.play(both(ms(5000)));
  const Status& status = run.pipeline.status();
  EXPECT_GT(status.pairs, 490U);
  EXPECT_EQ(run.rates().size(), status.pairs);
  EXPECT_EQ(status.rates_out, status.pairs);
  EXPECT_EQ(status.rates_out_valid,
            static_cast<std::uint64_t>(std::count_if(
                run.out.frames.begin(), run.out.frames.end(), [](const rig::Output& output) {
                  return output.frame.id == 0x610 && rig::rate_seen(output).valid;
                })));
}

// Without known biases no rate may be valid.
TEST(PipelineRates, AreInvalidWhileCalibrating) {
  Bench run;
  run.play(both(ms(900)));
  ASSERT_GT(run.rates().size(), 80U);
  for (const RateSeen& rate : run.rates()) {
    EXPECT_EQ(rate.raw, -0x800000);
    EXPECT_FALSE(rate.valid);
    EXPECT_EQ(rate.state, State::kCalibrating);
    EXPECT_EQ(rate.quality, 0U);
  }
}

// Without noise the corrected rate is the true one to the step of the frame, from the first on.
// Uses `mutual`, because `optimal` is not made for a world without any noise.
TEST(PipelineRates, AreTheTrueRateOnceCalibrated) {
  Plan plan = rig::two_gyros();
  plan.corrector.method = Method::kMutual;
  Bench run(plan);
  run.play(both(ms(6000)));
  std::size_t valid = 0;
  for (const RateSeen& rate : run.rates()) {
    if (!rate.valid) continue;
    ++valid;
    const TimePoint instant = rate.stamp - from_seconds(rate.age_ms * 1e-3);
    if (std::abs(to_seconds(instant - at_ms(1200))) < 0.02) continue;  // between rest and turning
    const double expected = instant < at_ms(1200) ? 0.0 : kTrue_dps;
    ASSERT_NEAR(rate.rate_dps, expected, rig::kRateStep_dps) << to_seconds(instant - TimePoint{});
    ASSERT_EQ(rate.quality, 15U);
  }
  EXPECT_GT(valid, 480U);
  EXPECT_NEAR(run.pipeline.status().gyros[0].bias_dps, kBiasA_dps, 1e-9);
  EXPECT_NEAR(run.pipeline.status().gyros[1].bias_dps, kBiasB_dps, 1e-9);
}

// The Earth turns under a platform at rest: the configured rate is taken as the truth.
TEST(PipelineRates, KeepTheRateThatTheCalibrationWasTold) {
  Plan plan = rig::two_gyros();
  plan.calibration.rate_dps = 0.25;
  Bench run(plan);
  run.play(merge({stream_a(ms(0), ms(2000), constant(0.25 + kBiasA_dps)),
                  stream_b(ms(0), ms(2000), constant(0.25 + kBiasB_dps))}));
  EXPECT_NEAR(run.rates().back().rate_dps, 0.25, rig::kRateStep_dps);
}

// The rate refers to stamp − age; here gyro b completes each pair of gyro a 3 ms later, or gyro a
// each one of gyro b 7 ms later.
TEST(PipelineRates, TellTheirAge) {
  Bench run;
  run.play(both(ms(3000)));
  const std::vector<RateSeen> rates = run.rates();
  for (std::size_t i = 20; i < rates.size(); ++i) {
    ASSERT_EQ(rates[i].age_ms, 3.0) << i;
    ASSERT_EQ((rates[i].stamp - ms(3)).time_since_epoch() % ms(10), Duration{0});
  }
}

struct WorstError final : RateObserver {
  explicit WorstError(RateOf the_truth) : truth(std::move(the_truth)) {}
  void on_rate(TimePoint t, const std::array<double, 2>& /*raw_dps*/, double rate_dps) override {
    if (std::isnan(rate_dps)) return;
    worst_dps = std::max(worst_dps, std::abs(rate_dps - truth(to_seconds(t - at_ms(0)))));
  }
  RateOf truth;
  double worst_dps = 0.0;
};

// A lag in the model file is no reason to withhold the rate.
TEST(PipelineRates, OfGyrosThatAreKnownToBeLateAreRightAndComplete) {
  const std::array<double, 2> none{};
  for (const std::array<double, 2> lag_s :
       {none, {0.06, 0.0}, {0.0, 0.15}, {0.25, 0.25}, {0.25, 0.0}, {0.12, 0.25}}) {
    SCOPED_TRACE(::testing::Message() << lag_s[0] << " and " << lag_s[1] << " s");
    Plan plan = rig::two_gyros();
    plan.corrector.method = Method::kMutual;
    plan.corrector.order = 0;
    plan.model = model::Model{"m.toml", {}};
    for (const std::size_t gyro : {0U, 1U}) {
      plan.model->effects.push_back(
          {.gyro = gyro, .kind = model::Kind::kDelay, .parameters = {lag_s[gyro]}});
    }
    const auto truth = [](double t_s) {
      return t_s < 2.0 ? 0.0 : 10.0 * (1.0 - std::cos(t_s - 2.0));
    };
    const auto late = [&](std::size_t gyro, double bias_dps) {
      return [=](double t_s) { return truth(t_s - lag_s[gyro]) + bias_dps; };
    };
    Bench run(plan);
    WorstError error(truth);
    run.pipeline.observe(&error);
    run.play_live(merge({stream_a(ms(0), ms(10'000), late(0, kBiasA_dps)),
                         stream_b(ms(0), ms(10'000), late(1, kBiasB_dps))}),
                  at_ms(10'000));
    const Duration longest = from_seconds(std::max(lag_s[0], lag_s[1]));
    const Duration shortest = from_seconds(std::min(lag_s[0], lag_s[1]));
    EXPECT_GE(run.pipeline.status().rates_out_valid + 6,
              static_cast<std::uint64_t>((ms(9'000) - longest - (longest - shortest)) / ms(10)));
    EXPECT_EQ(run.pipeline.status().state, State::kRunning);
    EXPECT_LT(error.worst_dps, 1e-2);
  }
}

struct Opinions final : RateObserver {
  void on_rate(TimePoint t, const std::array<double, 2>& /*raw_dps*/, double rate_dps) override {
    if (std::isfinite(rate_dps)) rates.push_back(t);
  }
  void on_condition(TimePoint t, const fusion::Condition& condition) override {
    told.push_back(t);
    last = condition;
  }
  std::vector<TimePoint> rates, told;
  fusion::Condition last;
};

// An observer gets the corrector's findings at each instant of a rate.
TEST(PipelineRates, ComeWithWhatTheCorrectorThinksToWhoeverObserves) {
  Bench run;
  Opinions opinions;
  run.pipeline.observe(&opinions);
  run.play(both(ms(6000)));
  EXPECT_GT(opinions.rates.size(), 400U);
  EXPECT_EQ(opinions.told, opinions.rates);
  EXPECT_EQ(opinions.last.stops, run.pipeline.status().stops);
  EXPECT_EQ(opinions.last.probability, run.pipeline.status().probability);
}

// `mean` needs no calibration and has no biases, but it also needs both gyros at the beginning.
TEST(PipelineRates, OfTheMeanAreValidFromTheFirstPairOn) {
  Plan plan = rig::two_gyros();
  plan.corrector.method = Method::kMean;
  Bench run(plan);
  run.play(both(ms(1000)));
  ASSERT_FALSE(run.rates().empty());
  for (const RateSeen& rate : run.rates()) {
    EXPECT_TRUE(rate.valid);
    EXPECT_EQ(rate.state, State::kRunning);
    EXPECT_NEAR(rate.rate_dps, 0.5 * (kBiasA_dps + kBiasB_dps), rig::kRateStep_dps);
  }
  EXPECT_TRUE(std::isnan(run.pipeline.status().gyros[0].bias_dps));
}

// Beyond ± 419 deg/s VG_Rate cannot carry the rate: the frame is invalid and the summary counts it.
TEST(PipelineRates, BeyondTheFrameAreSentInvalidAndCounted) {
  Bench run;
  const auto fast = [](double t_s) { return t_s < 2.0 ? 0.0 : 500.0; };
  run.play(merge({stream_a(ms(0), ms(3000), fast), stream_b(ms(0), ms(3000), fast)}));
  const Status& status = run.pipeline.status();
  std::uint64_t invalid = 0;
  for (const RateSeen& rate : run.rates()) {
    if (rate.state == State::kRunning && !rate.valid) ++invalid;
    EXPECT_EQ(rate.valid, rate.raw != -0x800000);
    EXPECT_LT(std::abs(rate.rate_dps), 420.0);
  }
  EXPECT_GT(invalid, 90U);
  EXPECT_EQ(status.rates_out_of_range, invalid);
  EXPECT_TRUE(std::isnan(status.rate_dps));
}

// Rest until 2 s, then swaying, then rest from 5 s on.
Recording swaying_platform(std::uint32_t seed) {
  auto rng = std::make_shared<std::mt19937>(seed);
  const auto rate = [rng](double bias_dps) {
    return [rng, bias_dps](double t_s) {
      std::normal_distribution<double> noise(bias_dps, 0.01);
      return noise(*rng) + (t_s > 2.0 && t_s < 5.0 ? 3.0 * std::sin(t_s - 2.0) : 0.0);
    };
  };
  return merge({stream_a(ms(0), ms(11'000), rate(kBiasA_dps)),
                stream_b(ms(0), ms(11'000), rate(kBiasB_dps))});
}

// Motion learned as drift would stay in every rate: the calibration starts again and waits.
TEST(PipelineRates, WaitForRestWhenThePlatformMoves) {
  Plan plan = rig::two_gyros();
  plan.calibration.rest_s = 4.0;
  Bench run(plan);
  run.play(swaying_platform(3));
  const Status& status = run.pipeline.status();
  EXPECT_EQ(status.state, State::kRunning);
  EXPECT_GE(status.calibration_restarts, 1U);
  EXPECT_FALSE(status.moved_in_calibration);
  EXPECT_EQ(run.rates().back().quality, 15U);
  for (const RateSeen& rate : run.rates()) {
    if (rate.valid) {
      EXPECT_GE(rate.stamp, at_ms(9000)) << "seed 3";
    }
  }
  // 0.01 deg/s over 400 samples, at the end of a fitted line: 0.001 deg/s.
  EXPECT_NEAR(status.gyros[0].bias_dps, kBiasA_dps, 0.006);
}

// Motion that the user accepts is reported: quality 8, and a flag.
TEST(PipelineRates, SayWhenMotionWasAccepted) {
  Plan plan = rig::two_gyros();
  plan.calibration.rest_s = 4.0;
  plan.calibration.when_moving = fusion::WhenMoving::kAccept;
  Bench run(plan);
  run.play(swaying_platform(3));
  EXPECT_TRUE(run.pipeline.status().moved_in_calibration);
  const std::vector<RateSeen> rates = run.rates();
  const auto first =
      std::find_if(rates.begin(), rates.end(), [](const auto& r) { return r.valid; });
  ASSERT_NE(first, rates.end());
  EXPECT_LE(first->stamp, at_ms(4100));
  EXPECT_EQ(first->quality, 8U);
  EXPECT_EQ(rates.back().quality, 8U);
}

// --- bias frames ---------------------------------------------------------------------------------

// Ten VG_Bias and ten VG_Model a second, on the grid of the bus's time.
TEST(PipelineBias, ComesTenTimesASecond) {
  Bench run;
  run.play(both(ms(10'000)));
  std::size_t steady = 0;
  TimePoint last;
  for (const rig::Output& bias : run.out.with_id(0x611)) {
    if (bias.stamp < at_ms(2000)) continue;
    if (steady++ > 0) {
      EXPECT_EQ(bias.stamp - last, ms(100));
    }
    last = bias.stamp;
  }
  EXPECT_EQ(steady, 80U);
  EXPECT_EQ(run.out.with_id(0x611).size(), run.out.with_id(0x612).size());
  EXPECT_EQ(run.pipeline.status().biases_out, run.out.with_id(0x611).size());
}

// The frame and the status agree.
TEST(PipelineBias, CarriesTheBiasesOfTheStatus) {
  Bench run;
  run.play(both(ms(4000)));
  const rig::Output bias = run.out.with_id(0x611).back();
  EXPECT_NEAR(static_cast<double>(rig::signed_bits(bias.frame, 16, 20)) * 1e-5, kBiasA_dps, 5.1e-6);
  EXPECT_NEAR(static_cast<double>(rig::signed_bits(bias.frame, 36, 20)) * 1e-5, kBiasB_dps, 5.1e-6);
  EXPECT_EQ(health_of(bias), 0U);
}

// Without any gyro the gateway still sends its state and health every tenth of a second.
TEST(PipelineBias, IsAHeartbeatOnASilentBus) {
  Bench run;
  run.play_live(both(ms(2000)), at_ms(2000));
  const std::size_t before = run.out.with_id(0x611).size();
  run.step_to(at_ms(12'000));
  const auto biases = run.out.with_id(0x611);
  EXPECT_GE(biases.size() - before, 95U);
  EXPECT_LE(biases.size() - before, 105U);
  EXPECT_EQ(health_of(biases.back()), 3U);
  EXPECT_EQ(run.pipeline.status().state, State::kLost);
}

// Before the first frame it sends that alone.
TEST(PipelineBias, IsAHeartbeatBeforeTheFirstFrame) {
  Bench run;
  run.pipeline.advance(TimePoint{std::chrono::hours(480'000)}, run.out);
  ASSERT_EQ(run.out.with_id(0x611).size(), 1U);
  EXPECT_EQ(health_of(run.out.frames.front()), 3U);
  EXPECT_EQ(rig::signed_bits(run.out.frames.front().frame, 16, 20), -0x80000);
}

// --- one gyro ------------------------------------------------------------------------------------

// The remaining gyro's rate less its own last bias, with matching quality and health.
TEST(PipelineDegraded, RateIsTheSurvivorsLessItsBias) {
  Plan plan = rig::two_gyros();
  plan.calibration.rate_dps = kTrue_dps;
  for (const std::size_t gone : {0U, 1U}) {
    Bench run(plan);
    run.play(
        merge({stream_a(ms(0), ms(gone == 0 ? 3000 : 5000), constant(kTrue_dps + kBiasA_dps)),
               stream_b(ms(0), ms(gone == 1 ? 3000 : 5000), constant(kTrue_dps + kBiasB_dps))}));
    EXPECT_EQ(run.pipeline.status().state, State::kDegraded);
    std::size_t degraded = 0;
    for (const RateSeen& rate : run.rates()) {
      if (rate.state != State::kDegraded) continue;
      ++degraded;
      ASSERT_TRUE(rate.valid);
      ASSERT_EQ(rate.quality, 4U);
      ASSERT_NEAR(rate.rate_dps, kTrue_dps, rig::kRateStep_dps);
    }
    EXPECT_GT(degraded, 180U);
    EXPECT_EQ(health_of(run.out.with_id(0x611).back()), gone == 0 ? 1U : 2U);
    EXPECT_FALSE(run.pipeline.status().gyros[gone].heard);
    EXPECT_TRUE(run.pipeline.status().gyros[1 - gone].heard);
  }
}

// The rate must not step when a gyro drops out or returns, noise apart.
TEST(PipelineDegraded, RateDoesNotStepOnTheWayInOrOut) {
  constexpr double kSigma_dps = 0.01;
  std::mt19937 rng(11);
  std::normal_distribution<double> noise(0.0, kSigma_dps);
  const auto noisy = [&](double bias_dps) {
    return [&, bias_dps](double) { return bias_dps + noise(rng); };
  };
  Bench run;
  run.play(merge({stream_a(ms(0), ms(9000), noisy(kBiasA_dps)),
                  stream_b(ms(0), ms(3000), noisy(kBiasB_dps)),
                  stream_b(ms(5000), ms(9000), noisy(kBiasB_dps))}));
  std::size_t degraded = 0;
  for (const RateSeen& rate : run.rates()) {
    if (!rate.valid) continue;
    degraded += rate.state == State::kDegraded ? 1U : 0U;
    // Six σ of one gyro's sample, and of its bias, which is known from 100 samples and
    // extrapolated.
    ASSERT_NEAR(rate.rate_dps, 0.0, 6.0 * kSigma_dps * 1.5) << "seed 11";
  }
  EXPECT_GT(degraded, 150U);
  EXPECT_EQ(run.pipeline.status().state, State::kRunning);
}

// Every instant is sent once, in order, from one gyro or two.
TEST(PipelineDegraded, InstantsGrowThroughEveryChange) {
  Bench run;
  run.play(merge({a(ms(0), ms(4000)), a(ms(5500), ms(9000)), b(ms(0), ms(3000)),
                  b(ms(3500), ms(6500)), b(ms(7000), ms(9000))}));
  TimePoint before = TimePoint::min();
  for (const RateSeen& rate : run.rates()) {
    const TimePoint instant = rate.stamp - from_seconds(rate.age_ms * 1e-3);
    if (rate.age_ms < 7.5) {
      EXPECT_GT(instant, before);
    }
    before = std::max(before, instant);
  }
  EXPECT_GE(before, at_ms(8980));
}

// One gyro alone from the start was never compared: after a second of waiting invalid frames are
// sent, so that receivers see a live gateway, and never a valid one. `mean` behaves the same.
TEST(PipelineDegraded, OneGyroFromTheStartIsNeverValid) {
  for (const Method method : {Method::kMutual, Method::kMean}) {
    Plan plan = rig::two_gyros();
    plan.corrector.method = method;
    Bench run(plan);
    run.play(a(ms(0), ms(5000)));
    const std::vector<RateSeen> rates = run.rates();
    ASSERT_GT(rates.size(), 380U);
    EXPECT_GT(rates.front().stamp, at_ms(1000));
    EXPECT_LE(rates.front().stamp, at_ms(1020));
    for (const RateSeen& rate : rates) {
      ASSERT_FALSE(rate.valid);
      ASSERT_EQ(rate.raw, -0x800000);
      ASSERT_EQ(rate.state, State::kWaiting);
    }
  }
}

// Two gyros that are never active at the same time give no pair and no valid rate.
TEST(PipelineDegraded, GyrosThatNeverMeetAreNeverPaired) {
  Bench run;
  run.play(merge(
      {a(ms(0), ms(2000)), b(ms(2500), ms(4500)), a(ms(5000), ms(7000)), b(ms(7500), ms(9500))}));
  EXPECT_EQ(run.pipeline.status().pairs, 0U);
  EXPECT_EQ(run.pipeline.status().rates_out_valid, 0U);
  EXPECT_EQ(run.pipeline.status().state, State::kWaiting);
}

// --- time ----------------------------------------------------------------------------------------

// A host clock that is set back by seconds is counted and costs a few frames, nothing else.
TEST(PipelineTime, ClockSetBackIsCountedAndSurvived) {
  Bench run;
  Recording recording = both(ms(3000));
  const Recording after = shifted(both(ms(6000)), Duration{0});
  for (const rig::Event& event : after) {
    if (event.stamp < at_ms(3000)) continue;
    recording.push_back(event);
    recording.back().stamp -= ms(2500);
  }
  run.play(recording);
  const Status& status = run.pipeline.status();
  EXPECT_EQ(status.clock_steps, 1U);
  EXPECT_EQ(status.state, State::kRunning);
  for (const GyroStatus& gyro : status.gyros) {
    EXPECT_GE(gyro.samples, gyro.frames - 6);
    EXPECT_EQ(gyro.samples + rig::rejected_total(gyro), gyro.frames);
  }
  const RateSeen last = run.rates().back();
  EXPECT_TRUE(last.valid);
  EXPECT_NEAR(last.rate_dps, kTrue_dps, rig::kRateStep_dps);
  EXPECT_EQ(last.stamp,
            recording.back().stamp - recording.back().stamp.time_since_epoch() % ms(10) + ms(3));
}

// The clock is set while the gyros continue: their drifts stay as they were.
TEST(PipelineTime, ClockSetForthExtendsNoDriftOfMutual) {
  for (const Duration by : {Duration(std::chrono::seconds(20)), Duration(std::chrono::hours(20)),
                            Duration(std::chrono::hours(24 * 3000))}) {
    Plan plan = rig::two_gyros();
    plan.corrector.method = Method::kMutual;
    Bench run(plan);
    // Slopes that a second of rest has shown: 0.2 and -0.1 deg/s each second.
    const auto drifting = [](double bias_dps, double slope_dps_s) {
      return [=](double t_s) { return bias_dps + slope_dps_s * t_s; };
    };
    const Recording first = merge({stream_a(ms(0), ms(4'000), drifting(kBiasA_dps, 0.2)),
                                   stream_b(ms(0), ms(4'000), drifting(kBiasB_dps, -0.1))});
    const Recording second = merge({stream_a(ms(4'000), ms(5'000), drifting(kBiasA_dps, 0.2)),
                                    stream_b(ms(4'000), ms(5'000), drifting(kBiasB_dps, -0.1))});
    run.play(first);
    run.play(shifted(second, by));
    ASSERT_EQ(run.pipeline.status().clock_steps, 0U);
    const std::vector<RateSeen> rates = run.rates();
    EXPECT_GT(std::count_if(rates.begin(), rates.end(), [](const auto& r) { return r.valid; }),
              380);
    for (const RateSeen& rate : rates) {
      if (!rate.valid) continue;
      // No drift is learned from the frames during which the guard waited for confirmation.
      ASSERT_NEAR(rate.rate_dps, 0.0, 0.2 * 0.05 + rig::kRateStep_dps)
          << to_seconds(rate.stamp - at_ms(0)) << " s, set by " << to_seconds(by);
    }
  }
}

// The daemon advances time during a silence, whatever the clock does; when frames return with
// stamps of the clock as it was set, heartbeat and time-outs must not wait until it catches up.
TEST(PipelineTime, ClockSetBackInASilenceStopsNothing) {
  constexpr Duration kStart = std::chrono::hours(100);
  for (const Duration by : {Duration{0}, ms(20'000), ms(3'600'000)}) {
    Bench run;
    run.last = TimePoint{kStart};
    run.play_live(shifted(both(ms(3000)), kStart), at_ms(3000) + kStart);
    run.step_to(at_ms(60'000) + kStart);
    const std::size_t before = run.out.with_id(0x611).size();
    const Recording back = shifted(both(ms(5000)), kStart + ms(60'000) - by);
    run.play(back);
    EXPECT_EQ(run.pipeline.status().state, State::kRunning);
    EXPECT_GE(run.out.with_id(0x611).size() - before, 48U) << to_seconds(by) << " s set back";
    EXPECT_LE(run.pipeline.next_deadline(), back.back().stamp + ms(300))
        << to_seconds(by) << " s set back";
  }
}

// The clock is set back repeatedly, as far as a log's stamps allow: time stays within 64 bits.
TEST(PipelineTime, ClockSetBackByCenturiesTwiceIsSurvived) {
  constexpr TimePoint kLatest = time_from_ns(9'000'000'000'000'000'000 - 3'000'000'000);
  Bench run;
  Recording recording;
  for (int round = 0; round < 3; ++round) {
    for (const Duration by : {kLatest.time_since_epoch(), Duration{0}}) {
      const Recording part = shifted(both(ms(1000)), by);
      recording.insert(recording.end(), part.begin(), part.end());
    }
  }
  run.play(recording);
  for (const GyroStatus& gyro : run.pipeline.status().gyros) {
    EXPECT_EQ(gyro.samples + rig::rejected_total(gyro), gyro.frames);
  }
  EXPECT_GT(run.pipeline.next_deadline(), time_from_ns(-9'000'000'000'000'000'000));
}

// One garbage stamp on a gyro's frame is refused and does not affect the rates.
TEST(PipelineTime, SingleGarbageStampIsRefused) {
  for (const std::int64_t garbage_s : {0L, 1L, 100'000L, 9'000'000'000L}) {
    Bench clean;
    Bench dirty;
    const Recording recording = shifted(both(ms(4000)), std::chrono::seconds(5000));
    clean.play(recording);
    Recording spoilt = recording;
    rig::Event extra = spoilt[500];
    extra.stamp = TimePoint{std::chrono::seconds(garbage_s)};
    spoilt.insert(spoilt.begin() + 500, extra);
    dirty.play(spoilt);
    EXPECT_EQ(dirty.pipeline.status().clock_steps, 0U);
    EXPECT_EQ(rig::rejected(dirty.pipeline, 0, Reject::kStampJump), 1U) << garbage_s;
    EXPECT_EQ(rate_payloads(dirty.out), rate_payloads(clean.out)) << garbage_s;
    EXPECT_EQ(dirty.out.with_id(0x611).size(), clean.out.with_id(0x611).size()) << garbage_s;
  }
}

// A foreign frame with a garbage stamp must stop neither the bias frames nor the time-outs.
TEST(PipelineTime, GarbageStampOfAForeignFrameDoesNotStopTheClockwork) {
  Bench run;
  Recording recording = both(ms(4000));
  recording.insert(recording.begin() + 400,
                   {0, rig::frame_of(0x7FF, {1}), TimePoint{std::chrono::hours(1'000'000)}});
  for (const rig::Event& event : a(ms(4000), ms(6000)))
    recording.push_back(event);
  run.play(recording);
  std::size_t later = 0;
  for (const rig::Output& bias : run.out.with_id(0x611)) {
    if (bias.stamp > at_ms(3000) && bias.stamp <= at_ms(6000)) ++later;
  }
  EXPECT_GE(later, 29U);
  EXPECT_EQ(run.pipeline.status().state, State::kDegraded);
}

// The same for a gyro's own frame that is refused for another cause before its stamp is judged.
TEST(PipelineTime, GarbageStampOfARefusedFrameDoesNotStopTheClockwork) {
  Bench run;
  Recording recording = both(ms(4000));
  recording.insert(recording.begin() + 400,
                   {0, rig::frame_of(rig::kIdA, {1}), TimePoint{std::chrono::hours(1'000'000)}});
  run.play(recording);
  EXPECT_EQ(rig::rejected(run.pipeline, 0, Reject::kTruncated), 1U);
  EXPECT_EQ(run.out.with_id(0x611).back().stamp, at_ms(3903));
  EXPECT_EQ(run.pipeline.status().state, State::kRunning);
}

// Foreign frames only advance time: they are neither counted nor answered.
TEST(PipelineTime, ForeignFramesOnlyAdvanceTime) {
  Bench run;
  run.play(both(ms(2000)));
  const std::uint64_t rates = run.pipeline.status().rates_out;
  for (int t = 2000; t < 4000; ++t) {
    run.pipeline.receive(0, rig::frame_of(0x300, {0xFF, 0xFF}), at_ms(t), run.out);
  }
  EXPECT_EQ(run.pipeline.status().state, State::kLost);
  EXPECT_EQ(run.pipeline.status().rates_out, rates);
  EXPECT_EQ(run.pipeline.status().gyros[0].frames, 200U);
}

// Stamps are used in whole microseconds: digits that candump does not write change nothing.
TEST(PipelineTime, NoiseBelowAMicrosecondChangesNothing) {
  std::mt19937 rng(17);
  std::uniform_int_distribution<std::int64_t> noise_ns(0, 999);
  Bench exact;
  Bench noisy;
  Recording recording = both(ms(5000));
  exact.play(recording);
  for (rig::Event& event : recording)
    event.stamp += Duration(noise_ns(rng));
  noisy.play(recording);
  ASSERT_EQ(exact.out.frames.size(), noisy.out.frames.size());
  for (std::size_t i = 0; i < exact.out.frames.size(); ++i) {
    ASSERT_EQ(exact.out.frames[i].frame, noisy.out.frames[i].frame) << i;
  }
}

// --- the same input gives the same output --------------------------------------------------------

Recording jittery(std::uint32_t seed, Duration period_a, Duration period_b) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> noise(0.0, 0.02);
  std::uniform_int_distribution<std::int64_t> jitter_us(0, 1500);
  const auto rate = [&](double) { return noise(rng); };
  Recording first = rig::stream(0, rig::kIdA, ms(0), ms(4000), period_a, rate);
  Recording second = rig::stream(1, rig::kIdB, ms(3), ms(4000), period_b, rate);
  for (Recording* part : {&first, &second}) {
    for (rig::Event& event : *part)
      event.stamp += std::chrono::microseconds(jitter_us(rng));
  }
  return merge({first, second});
}

// Two sockets are read one after the other: frames of one bus may be up to `slack` later than those
// of the other, while each bus keeps its own order.
Recording reordered(const Recording& recording, std::uint32_t seed, Duration slack) {
  std::mt19937 rng(seed);
  std::array<Recording, 2> by_bus;
  for (const rig::Event& event : recording)
    by_bus[event.bus].push_back(event);
  Recording result;
  std::array<std::size_t, 2> next{};
  while (next[0] < by_bus[0].size() || next[1] < by_bus[1].size()) {
    const auto left = [&](std::size_t bus) { return next[bus] < by_bus[bus].size(); };
    std::size_t bus = left(0) ? 0 : 1;
    if (left(0) && left(1)) {
      const Duration ahead = by_bus[0][next[0]].stamp - by_bus[1][next[1]].stamp;
      bus = ahead > slack ? 1 : ahead < -slack ? 0 : rng() % 2;
    }
    result.push_back(by_bus[bus][next[bus]++]);
  }
  return result;
}

// The same frames twice give the same bytes and stamps.
TEST(PipelineRepeats, ItselfByteForByte) {
  const Recording recording = jittery(1, ms(10), ms(7));
  Bench first;
  Bench second;
  first.play(recording);
  second.play(recording);
  EXPECT_GT(first.out.frames.size(), 300U);
  EXPECT_EQ(first.out.frames, second.out.frames);
}

// The order in which two buses are read, within 20 ms, does not affect VG_Rate.
TEST(PipelineRepeats, ItselfWhenTheBusesAreReadInAnotherOrder) {
  for (const Duration period_b : {ms(10), ms(2), ms(25)}) {
    const Recording recording = jittery(2, ms(10), period_b);
    Bench straight;
    straight.play(recording);
    ASSERT_GT(rate_payloads(straight.out).size(), 100U);
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      Bench mixed;
      mixed.play(reordered(recording, seed, ms(20)));
      ASSERT_EQ(rate_payloads(straight.out), rate_payloads(mixed.out))
          << "seed " << seed << ", period " << to_seconds(period_b);
    }
  }
}

// Other traffic on the same buses does not affect VG_Rate, even when a gyro drops out and returns.
TEST(PipelineRepeats, ItselfAmongForeignFrames) {
  const Recording recording =
      merge({a(ms(0), ms(3000)), a(ms(3700), ms(6000)), b(ms(0), ms(4000)), b(ms(5000), ms(6000))});
  Bench alone;
  alone.play(recording);
  rig::Dice dice(5);
  Recording crowded;
  for (const rig::Event& event : recording) {
    for (std::uint32_t i = dice.below(5); i > 0; --i) {
      crowded.push_back({static_cast<can::BusIndex>(dice.below(3)),
                         rig::frame_of(0x200 + dice.below(0x500), {1, 2, 3}), event.stamp});
    }
    crowded.push_back(event);
  }
  Bench among;
  among.play(crowded);
  EXPECT_EQ(rate_payloads(alone.out), rate_payloads(among.out));
}

// The plan is copied: the pipeline may be moved and may outlive the original plan.
TEST(PipelineRepeats, ItselfAfterAMove) {
  Bench run;
  run.play(both(ms(3000)));
  auto plan = std::make_unique<Plan>(rig::two_gyros());
  Pipeline first(*plan);
  plan.reset();
  Pipeline second(std::move(first));
  Collector out;
  rig::play(second, both(ms(3000)), out);
  EXPECT_EQ(out.frames, run.out.frames);
}

// A reload that changes only where the rates are sent.
TEST(PipelineRepeats, ItselfWhereAnotherOneTakesOverInTheMidst) {
  for (const Method method : {Method::kOptimal, Method::kMutual, Method::kMean}) {
    Plan plan = rig::two_gyros();
    plan.corrector.method = method;
    Bench whole(plan);
    const Recording recording = both(ms(4000));
    whole.play(recording);
    Bench first(plan);
    Plan other = plan;
    other.output.bias_id = 0x711;
    other.buses.emplace_back("can7");
    Bench second(other);
    for (std::size_t i = 0; i < recording.size(); ++i) {
      if (i == recording.size() / 3) second.pipeline.take_over(std::move(first.pipeline));
      const rig::Event& event = recording[i];
      Bench& bench = i < recording.size() / 3 ? first : second;
      bench.pipeline.receive(event.bus, event.frame, event.stamp, bench.out);
    }
    auto payloads = rate_payloads(first.out);
    for (const auto& payload : rate_payloads(second.out))
      payloads.push_back(payload);
    EXPECT_EQ(payloads, rate_payloads(whole.out)) << to_string(method);
    EXPECT_TRUE(second.out.with_id(0x611).empty());
    EXPECT_FALSE(second.out.with_id(0x711).empty());
    EXPECT_EQ(second.pipeline.status().pairs, whole.pipeline.status().pairs);
  }
}

TEST(PlanComparison, SeesEveryChangeButTheOutputs) {
  const Plan plan = rig::with_reference();
  Plan same = rig::with_reference();
  same.output = {.bus = 1, .rate_id = 0x700, .fd = true};
  same.buses.emplace_back("can7");
  EXPECT_TRUE(same_but_output(plan, same));
  const std::function<void(Plan&)> changes[] = {
      [](Plan& p) { p.gyros[1].match.id = 0x1FF; },
      [](Plan& p) { p.gyros[0].bus = "can9"; },
      [](Plan& p) { p.gyros[0].rate.scale = -1.0; },
      [](Plan& p) { p.gyros[0].rate.codec = rig::codec_of(rig::signal_of(0, 31)); },
      [](Plan& p) { p.gyros[1].name = "c"; },
      [](Plan& p) { p.reference.reset(); },
      [](Plan& p) { p.calibration.rest_s = 2.0; },
      [](Plan& p) { p.corrector.window_s = 2.0; },
      [](Plan& p) { p.corrector.gyros[0].white_dps_rthz = 1e-3; },
      [](Plan& p) {
        p.model = model::Model{"m.toml", {{.gyro = 0}}};
      },
  };
  for (const auto& change : changes) {
    Plan changed = rig::with_reference();
    change(changed);
    EXPECT_FALSE(same_but_output(plan, changed)) << &change - std::begin(changes);
  }
}

// After a reload receivers see one continuous stream.
TEST(PipelineRepeats, CountsOnFromAnotherOne) {
  Bench first;
  first.play(both(ms(1234)));
  Plan plan = rig::two_gyros();
  plan.output.bias_id = 0x711;
  Bench second(plan);
  second.pipeline.count_on_from(first.pipeline);
  second.play(both(ms(500)));
  const auto counter = [](const rig::Output& output) { return rig::bits(output.frame, 8, 4); };
  for (const std::uint32_t id : {0x610U, 0x612U}) {
    EXPECT_EQ(counter(second.out.with_id(id).front()),
              (counter(first.out.with_id(id).back()) + 1) % 15);
  }
  EXPECT_EQ(counter(second.out.with_id(0x711).front()), 0U) << "another stream";
}

// --- reference -----------------------------------------------------------------------------------

RateOf rocking(double bias_dps) {
  return [bias_dps](double t_s) { return bias_dps + 30.0 * std::sin(2.0 * t_s); };
}

// With a reference the platform may move: the biases are right although it never rested.
TEST(PipelineReference, CalibratesOnAMovingPlatform) {
  Bench run(rig::with_reference());
  run.play(merge({stream_a(ms(0), ms(4000), rocking(kBiasA_dps)),
                  stream_b(ms(0), ms(4000), rocking(kBiasB_dps)),
                  rig::stream(0, rig::kIdReference, ms(0), ms(4000), ms(10), rocking(0.0))}));
  const Status& status = run.pipeline.status();
  EXPECT_EQ(status.state, State::kRunning);
  EXPECT_FALSE(status.moved_in_calibration);
  // Chords of a sine of 30 deg/s and 2 rad/s over 10 ms deviate from it by at most 1.5e-3 deg/s;
  // the line fitted to a window is extended over the next one.
  EXPECT_NEAR(status.gyros[0].bias_dps, kBiasA_dps, 5e-3);
  EXPECT_NEAR(status.gyros[1].bias_dps, kBiasB_dps, 5e-3);
  EXPECT_EQ(status.reference_frames, 400U);
  EXPECT_EQ(status.reference_rejected, 0U);
}

// The reference was an hour ahead and returns to the gyros' time: it is used again.
TEST(PipelineReference, CalibratesWhenTheReferenceComesBackFromAnotherTime) {
  const auto turning = [](double t_s) { return 5.0 + t_s; };
  const auto with_bias = [&](double bias_dps) {
    return [=](double t_s) { return turning(t_s) + bias_dps; };
  };
  Plan plan = rig::with_reference();
  plan.corrector.method = Method::kMutual;
  plan.corrector.order = 0;
  Bench run(plan);
  Recording reference = rig::stream(0, rig::kIdReference, ms(0), ms(8'000), ms(10), turning);
  for (rig::Event& event : reference) {
    if (event.stamp < at_ms(3'000)) event.stamp += std::chrono::hours(1);
  }
  // In the order of arrival.
  const Recording gyros = merge({stream_a(ms(0), ms(8'000), with_bias(kBiasA_dps)),
                                 stream_b(ms(0), ms(8'000), with_bias(kBiasB_dps))});
  for (std::size_t i = 0; i < reference.size(); ++i)
    run.play({reference[i], gyros[2 * i], gyros[2 * i + 1]});
  EXPECT_EQ(run.pipeline.status().state, State::kRunning);
  EXPECT_EQ(run.pipeline.status().clock_steps, 0U);
  EXPECT_NEAR(run.rates().back().rate_dps, turning(7.99), 0.02);
}

// Without the reference there is no calibration: no rate is better than one against an invented
// truth.
TEST(PipelineReference, WithoutItNothingBecomesValid) {
  Bench run(rig::with_reference());
  run.play(both(ms(5000)));
  EXPECT_EQ(run.pipeline.status().state, State::kCalibrating);
  EXPECT_EQ(run.pipeline.status().rates_out_valid, 0U);
}

// Unusable reference frames are counted and not used.
TEST(PipelineReference, RefusesTruncatedAndRepeatedFrames) {
  Bench run(rig::with_reference());
  Recording reference = rig::stream(0, rig::kIdReference, ms(0), ms(4000), ms(10), rocking(0.0));
  for (std::size_t i = 0; i < reference.size(); i += 10)
    reference[i].frame.length = 2;
  const Recording again(reference.begin() + 1, reference.begin() + 3);
  run.play(merge({stream_a(ms(0), ms(4000), rocking(kBiasA_dps)),
                  stream_b(ms(0), ms(4000), rocking(kBiasB_dps)), reference, again}));
  EXPECT_EQ(run.pipeline.status().reference_rejected, 42U);
  EXPECT_NEAR(run.pipeline.status().gyros[0].bias_dps, kBiasA_dps, 5e-3);
}

// --- deadlines -----------------------------------------------------------------------------------

// advance() does nothing when nothing is due, so it is cheap enough to call for every frame.
TEST(PipelineDeadline, NothingHappensBeforeIt) {
  Bench run;
  run.play(both(ms(2000)));
  const std::size_t frames = run.out.frames.size();
  const TimePoint deadline = run.pipeline.next_deadline();
  ASSERT_GT(deadline, at_ms(1993));
  run.pipeline.advance(deadline - std::chrono::microseconds(1), run.out);
  EXPECT_EQ(run.out.frames.size(), frames);
  EXPECT_EQ(run.pipeline.next_deadline(), deadline);
}

// A deadline that is still due after advance() would make the daemon spin. After any history, with
// gaps, clock steps and garbage, the deadline is in the future.
TEST(PipelineDeadline, IsNeverDueAfterAdvance) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    rig::Dice dice(seed);
    Plan plan = rig::two_gyros();
    plan.calibration.rest_s = 0.2;
    Bench run(plan);
    std::int64_t now_us = dice.one_in(2) ? 0 : 1'700'000'000'000'000;
    for (int i = 0; i < 1500; ++i) {
      const std::uint32_t kind = dice.below(1000);
      now_us += dice.below(20'000);
      if (kind == 0) now_us += dice.below(5'000'000);
      if (kind == 1) now_us = std::max<std::int64_t>(0, now_us - dice.below(5'000'000));
      const TimePoint now{std::chrono::microseconds(now_us) + Duration(dice.below(1000))};
      const auto bus = static_cast<can::BusIndex>(dice.below(2));
      const std::uint32_t id = dice.one_in(10) ? 0x300 : bus == 0 ? rig::kIdA : rig::kIdB;
      run.pipeline.receive(bus, rig::rate_frame(id, 0.001 * dice.below(100)), now, run.out);
      if (!dice.one_in(4)) continue;
      run.pipeline.advance(now, run.out);
      ASSERT_GT(run.pipeline.next_deadline(), now) << "seed " << seed << ", step " << i;
      const TimePoint due = run.pipeline.next_deadline();
      if (!dice.one_in(50)) continue;
      run.pipeline.advance(due, run.out);
      ASSERT_GT(run.pipeline.next_deadline(), due) << "seed " << seed << ", step " << i;
    }
  }
}

// On a silent bus the timer wakes some ten times a second, not a thousand times.
TEST(PipelineDeadline, WakesASilentGatewayAboutTenTimesASecond) {
  Bench run;
  run.play_live(both(ms(2000)), at_ms(2000));
  run.wake_ups = 0;
  run.step_to(at_ms(12'000));
  EXPECT_GE(run.wake_ups, 60);
  EXPECT_LE(run.wake_ups, 220);
}

// A silent gyro is noticed within its time-out, without any frame.
TEST(PipelineDeadline, NoticesASilentGyroInTime) {
  Bench run;
  run.play(both(ms(2000)));
  while (run.pipeline.status().gyros[0].heard || run.pipeline.status().gyros[1].heard) {
    const TimePoint due = run.pipeline.next_deadline();
    ASSERT_LT(due, at_ms(2500));
    run.pipeline.advance(due, run.out);
  }
  EXPECT_EQ(run.pipeline.status().state, State::kLost);
}

// --- calibrations that are refused ---------------------------------------------------------------

// Switched on in a roundabout: a rate that both gyros read is no bias, however steady it is.
TEST(PipelineCalibration, TakesNoSteadyTurnForRest) {
  Plan plan = rig::two_gyros();
  plan.calibration.rest_s = 4.0;
  Bench bench(plan);
  const auto from_turn_to = [](double turn_dps, double bias_dps) -> RateOf {
    return [=](double t_s) { return t_s < 5.5 ? turn_dps : bias_dps; };
  };
  bench.play(merge({stream_a(ms(0), ms(14'000), from_turn_to(20.03, kBiasA_dps)),
                    stream_b(ms(0), ms(14'000), from_turn_to(19.97, kBiasB_dps))}));
  EXPECT_GE(bench.pipeline.status().calibration_restarts, 2U);
  EXPECT_EQ(bench.pipeline.status().state, State::kRunning) << "and the rest behind it is one";
  EXPECT_NEAR(bench.pipeline.status().gyros[0].bias_dps, kBiasA_dps, 0.01);
  EXPECT_NEAR(bench.pipeline.status().gyros[1].bias_dps, kBiasB_dps, 0.01);
}

// One cheap gyro may read 20 deg/s at rest, unless max_bias_dps excludes it.
TEST(PipelineCalibration, BelievesALargeBiasOfOneGyroUnlessToldOtherwise) {
  Plan plan = rig::two_gyros();
  const Recording rest = merge({stream_a(ms(0), ms(4000), [](double /*t_s*/) { return 20.0; }),
                                stream_b(ms(0), ms(4000), [](double /*t_s*/) { return -0.3; })});
  Bench any(plan);
  any.play(rest);
  EXPECT_EQ(any.pipeline.status().state, State::kRunning);
  plan.gyros[0].max_bias_dps = 5.0;
  Bench told(plan);
  told.play(rest);
  EXPECT_EQ(told.pipeline.status().state, State::kCalibrating);
  EXPECT_GE(told.pipeline.status().calibration_restarts, 1U);
}

}  // namespace
}  // namespace vgyro::gateway
