// Across a restart: what the pipeline keeps, when it takes it up, and what its status says. A stub
// corrector records exactly what it receives.

#include <cmath>
#include <memory>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "fusion/corrector.h"
#include "rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::ms;

constexpr double kBias_dps = 0.25;

struct Seen {
  std::optional<fusion::DriftMemory> resumed;
  double age_s = -1.0;
  double resume_t_s = -1.0;
  bool started = false;
  bool accepts = true;
  std::uint64_t stops = 0;
  double memory_t_s = -1.0;
};

class Stub final : public fusion::Corrector {
 public:
  explicit Stub(Seen& seen) : seen_(seen) {}
  [[nodiscard]] bool needs_calibration() const override { return true; }
  void start(const fusion::Calibration&) override { seen_.started = true; }
  bool resume(const fusion::DriftMemory& memory, double age_s, double t_s) override {
    seen_.resumed = memory;
    seen_.age_s = age_s;
    seen_.resume_t_s = t_s;
    if (seen_.accepts) bias_dps_ = memory.bias_dps[0];
    return seen_.accepts;
  }
  fusion::VirtualRate update(const fusion::RatePair& pair) override {
    return {pair.rate_dps[0] - bias_dps_, 0.01, pair.rate_dps};
  }
  fusion::VirtualRate update_alone(std::size_t gyro, const fusion::RatePair& pair) override {
    return {pair.rate_dps[gyro] - bias_dps_, 0.01, pair.rate_dps};
  }
  [[nodiscard]] fusion::Drift drift(double) const override {
    return {{bias_dps_, bias_dps_}, 0.0, 0.002, 0.0};
  }
  [[nodiscard]] fusion::WindowCounts windows() const override { return {}; }
  [[nodiscard]] fusion::Condition condition() const override {
    fusion::Condition condition;
    condition.stops = seen_.stops;
    return condition;
  }
  [[nodiscard]] std::uint64_t condition_edition() const override { return 1 + seen_.stops; }
  [[nodiscard]] std::optional<fusion::DriftMemory> memory(double t_s) const override {
    seen_.memory_t_s = t_s;
    fusion::DriftMemory memory;
    memory.bias_dps = {bias_dps_, bias_dps_};
    return memory;
  }

 private:
  Seen& seen_;
  double bias_dps_ = 0.0;
};

class PipelineMemory : public testing::Test {
 protected:
  Pipeline make(const Plan& the_plan) { return {the_plan, std::make_unique<Stub>(seen)}; }

  /// A state of the plan's gyros, saved at `ms_count`.
  [[nodiscard]] SavedState state_at(std::int64_t ms_count) const {
    SavedState state;
    state.drift.bias_dps = {kBias_dps, kBias_dps};
    state.rate_stamp = at_ms(ms_count);
    state.devices = {device_of(plan.gyros[0]), device_of(plan.gyros[1])};
    state.rest_rate_dps = plan.calibration.rate_dps;
    return state;
  }

  /// Both gyros from `from_s` on, for this many seconds, at rest.
  static rig::Recording both(std::int64_t from_s, std::int64_t for_s) {
    const Duration from = std::chrono::seconds(from_s);
    const Duration to = from + std::chrono::seconds(for_s);
    return rig::merge({rig::stream_a(from, to, rig::constant(kBias_dps)),
                       rig::stream_b(from, to, rig::constant(kBias_dps))});
  }

  Plan plan = rig::two_gyros();
  Seen seen;
  rig::Collector out;
};

TEST_F(PipelineMemory, FirstPairIsValidAndSaysRestored) {
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(1000)));
  EXPECT_EQ(pipeline.status().restored, Restored::kOffered);
  rig::play(pipeline, both(3601, 2), out);
  const std::vector<rig::RateSeen> rates = rig::rates_seen(out);
  ASSERT_GT(rates.size(), 150U);
  for (const rig::RateSeen& rate : rates) {
    ASSERT_TRUE(rate.valid);
    ASSERT_EQ(rate.state, State::kRunning);
    ASSERT_EQ(rate.quality, 12U);
    ASSERT_NEAR(rate.rate_dps, 0.0, rig::kRateStep_dps);
  }
  EXPECT_FALSE(seen.started);
  EXPECT_EQ(pipeline.status().restored, Restored::kTakenUp);
  EXPECT_EQ(pipeline.status().restored_bias_sigma_dps, 0.002);
  for (const rig::Output& output : out.with_id(0x611))
    EXPECT_NE(rig::bits(output.frame, 56, 3), 1U) << "VB_Mode says calibrating";
}

// Samples wait until the aligner has chosen the pacing gyro. A silence in between must not turn
// them into present rates, because VG_Age could not hold their age.
TEST_F(PipelineMemory, WhatWaitedThroughASilenceIsNotSentAsANewRate) {
  constexpr double kBefore_dps = 5.0;
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(1000)));
  const auto from = std::chrono::seconds(3601);
  rig::play(pipeline,
            rig::merge({rig::stream_a(from, from + ms(30), rig::constant(kBefore_dps)),
                        rig::stream_b(from, from + ms(30), rig::constant(kBefore_dps))}),
            out);
  for (int i = 1; i < 300; ++i)
    pipeline.advance(TimePoint{from + ms(30 + 10 * i)}, out);
  rig::play(pipeline, both(3604, 1), out);
  const std::vector<rig::RateSeen> rates = rig::rates_seen(out);
  ASSERT_GT(rates.size(), 80U);
  for (const rig::RateSeen& rate : rates) {
    ASSERT_TRUE(rate.valid);
    ASSERT_NEAR(rate.rate_dps, 0.0, rig::kRateStep_dps);
  }
}

// The age runs from the stamp of the last rate to that of the first pair.
TEST_F(PipelineMemory, AgeIsTakenFromTheStamps) {
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(1000)));
  rig::play(pipeline, both(3601, 1), out);
  EXPECT_NEAR(seen.age_s, 3600.0, 0.011);
  EXPECT_EQ(seen.resume_t_s, 0.0);
  EXPECT_EQ(pipeline.status().restored_age_s, seen.age_s);
}

TEST_F(PipelineMemory, ClockThatStandsBeforeTheStateMakesItOld) {
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(10'000'000)));
  rig::play(pipeline, both(3601, 1), out);
  EXPECT_EQ(seen.age_s, 30.0 * 86400.0);
  EXPECT_TRUE(std::isnan(pipeline.status().restored_age_s));
  EXPECT_EQ(pipeline.status().restored, Restored::kTakenUp);
}

TEST_F(PipelineMemory, FirstStopConfirmsIt) {
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(0)));
  rig::play(pipeline, both(10, 1), out);
  ASSERT_EQ(rig::rates_seen(out).back().quality, 12U);
  seen.stops = 1;
  rig::play(pipeline, both(11, 1), out);
  EXPECT_EQ(rig::rates_seen(out).back().quality, 15U);
  EXPECT_EQ(pipeline.status().restored, Restored::kConfirmed);
}

TEST_F(PipelineMemory, OneGyroAloneIsStillOneGyro) {
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(0)));
  rig::play(pipeline, both(10, 1), out);
  rig::play(pipeline, rig::stream_a(ms(11'000), ms(13'000), rig::constant(kBias_dps)), out);
  EXPECT_EQ(rig::rates_seen(out).back().quality, 4U);
  EXPECT_TRUE(rig::rates_seen(out).back().valid);
}

TEST_F(PipelineMemory, CalibratesWhenTheCorrectorRefuses) {
  seen.accepts = false;
  Pipeline pipeline = make(plan);
  ASSERT_TRUE(pipeline.resume(state_at(0)));
  rig::play(pipeline, both(10, 2), out);
  const std::vector<rig::RateSeen> rates = rig::rates_seen(out);
  EXPECT_FALSE(rates.front().valid);
  EXPECT_EQ(rates.front().state, State::kCalibrating);
  EXPECT_TRUE(seen.started);
  EXPECT_EQ(rates.back().quality, 15U);
  EXPECT_EQ(pipeline.status().restored, Restored::kRefused);
}

TEST_F(PipelineMemory, OtherGyrosAreRefusedWithAReason) {
  SavedState state = state_at(0);
  state.devices[1] = "fog: can1 0x333";
  Pipeline pipeline = make(plan);
  const Expected<void> taken = pipeline.resume(state);
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().what.find("fog: can1 0x333"), std::string::npos);
  EXPECT_NE(taken.error().what.find(device_of(plan.gyros[1])), std::string::npos);
  rig::play(pipeline, both(10, 1), out);
  EXPECT_FALSE(seen.resumed);
  EXPECT_FALSE(rig::rates_seen(out).front().valid);
}

TEST_F(PipelineMemory, MethodsWithoutMemoryRefuse) {
  for (const Method method : {Method::kMean, Method::kMutual}) {
    plan.corrector.method = method;
    Pipeline pipeline(plan);
    const Expected<void> taken = pipeline.resume(state_at(0));
    ASSERT_FALSE(taken);
    EXPECT_FALSE(taken.error().remedy.empty());
    rig::play(pipeline, both(10, 3), out);
    EXPECT_FALSE(pipeline.memory());
  }
}

TEST_F(PipelineMemory, NothingIsKeptBeforeTheCalibration) {
  Pipeline pipeline = make(plan);
  EXPECT_FALSE(pipeline.memory());
  rig::play(pipeline, both(10, 1), out);
  EXPECT_FALSE(pipeline.memory());
  rig::play(pipeline, both(11, 1), out);
  EXPECT_TRUE(pipeline.memory());
}

TEST_F(PipelineMemory, KeepsDevicesTemperaturesAndTheStampOfTheLastRate) {
  plan.gyros[0].temperature = rig::quantity_of(rig::signal_of(32, 16, 0.01));
  plan.calibration.rate_dps = 0.0032;
  Pipeline pipeline = make(plan);
  rig::Recording recording = both(10, 3);
  for (rig::Event& event : recording) {
    if (event.frame.id != rig::kIdA) continue;
    event.frame.data[4] = 0xDD;  // 2525 = 25.25 degC
    event.frame.data[5] = 0x09;
  }
  rig::play(pipeline, recording, out);
  const std::optional<SavedState> state = pipeline.memory();
  ASSERT_TRUE(state);
  const rig::RateSeen last = rig::rates_seen(out).back();
  EXPECT_NEAR(to_seconds(last.stamp - state->rate_stamp) * 1e3, last.age_ms, 0.25);
  ASSERT_TRUE(state->temperature_c[0]);
  EXPECT_DOUBLE_EQ(*state->temperature_c[0], 25.25);
  EXPECT_FALSE(state->temperature_c[1]);
  EXPECT_EQ(state->devices[0], device_of(plan.gyros[0]));
  EXPECT_EQ(state->devices[1], device_of(plan.gyros[1]));
  EXPECT_EQ(state->rest_rate_dps, 0.0032);
  EXPECT_TRUE(make(plan).resume(*state));
}

// Motion that was learned as drift must not outlive the run.
TEST_F(PipelineMemory, WhatWasLearnedInMotionIsKeptOnlyAfterAStop) {
  plan.calibration.when_moving = fusion::WhenMoving::kAccept;
  plan.calibration.rest_s = 4.0;
  Pipeline pipeline = make(plan);
  const auto swing = [](double t_s) { return 10.0 * std::sin(t_s); };
  rig::play(
      pipeline,
      rig::merge({rig::stream_a(ms(0), ms(6000), swing), rig::stream_b(ms(0), ms(6000), swing)}),
      out);
  ASSERT_TRUE(pipeline.status().moved_in_calibration);
  ASSERT_EQ(pipeline.status().state, State::kRunning);
  EXPECT_FALSE(pipeline.memory());
  seen.stops = 1;
  EXPECT_TRUE(pipeline.memory());
}

// A clock that is set back while running moves the stamps, not the age.
TEST_F(PipelineMemory, StampFollowsAClockThatWasSetBack) {
  Pipeline pipeline = make(plan);
  rig::play(pipeline, both(1000, 3), out);
  rig::play(pipeline, both(500, 3), out);
  ASSERT_EQ(pipeline.status().clock_steps, 1U);
  const std::optional<SavedState> state = pipeline.memory();
  ASSERT_TRUE(state);
  EXPECT_NEAR(to_seconds(state->rate_stamp - TimePoint{}), 503.0, 0.05);
}

// The product's own corrector from end to end: calibrated, saved as text, resumed after an hour.
TEST_F(PipelineMemory, OptimalGoesOnWithASigmaThatHasGrown) {
  constexpr std::uint32_t kSeed = 11;
  SCOPED_TRACE(kSeed);
  constexpr double kNoise_dps = 0.01;
  std::mt19937 rng(kSeed);
  std::normal_distribution<double> noise(0.0, kNoise_dps);
  const auto noisy = [&](double bias_dps) {
    return [&, bias_dps](double) { return bias_dps + noise(rng); };
  };
  const auto recording = [&](std::int64_t from_s, std::int64_t to_s) {
    return rig::merge({rig::stream_a(ms(from_s * 1000), ms(to_s * 1000), noisy(0.3)),
                       rig::stream_b(ms(from_s * 1000), ms(to_s * 1000), noisy(-0.1))});
  };
  plan.calibration.rest_s = 20.0;
  Pipeline before(plan);
  rig::play(before, recording(0, 30), out);
  const std::optional<SavedState> kept = before.memory();
  ASSERT_TRUE(kept);
  const auto read = saved_state_from(to_text(*kept), "state.toml");
  ASSERT_TRUE(read) << read.error().message();

  std::array<double, 2> sigma_dps{};
  const std::array<std::int64_t, 2> from_s{60, 30 + 30 * 86400};
  for (std::size_t i = 0; i < 2; ++i) {
    Pipeline after(plan);
    ASSERT_TRUE(after.resume(*read));
    rig::Collector seen_after;
    rig::play(after, recording(from_s[i], from_s[i] + 1), seen_after);
    const std::vector<rig::RateSeen> rates = rig::rates_seen(seen_after);
    ASSERT_FALSE(rates.empty());
    EXPECT_TRUE(rates.front().valid);
    EXPECT_EQ(rates.front().quality, 12U);
    sigma_dps[i] = after.status().restored_bias_sigma_dps;
    double mean_dps = 0.0;
    for (const rig::RateSeen& rate : rates)
      mean_dps += rate.rate_dps / static_cast<double>(rates.size());
    EXPECT_NEAR(mean_dps, 0.0, 5.0 * (kNoise_dps / std::sqrt(100.0) + sigma_dps[i]));
  }
  const auto& p = read->drift.bias_covariance;
  const double least_dps = std::sqrt((p[0] * p[2] - p[1] * p[1]) / (p[0] + p[2] - 2.0 * p[1]));
  EXPECT_GT(sigma_dps[0], least_dps);
  EXPECT_GT(sigma_dps[1], 1.5 * sigma_dps[0]);
}

}  // namespace
}  // namespace vgyro::gateway
