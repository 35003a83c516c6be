// Faults of one gyro, and of both: a value that is not a measurement is not used, from the first
// one on, and the status says why; a gyro that recovers is used again without a step.

#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "gateway/gyro_health.h"
#include "gateway/pipeline.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::merge;
using rig::ms;
using rig::RateOf;
using rig::RateSeen;
using rig::Recording;

constexpr double kSigma_dps = 0.01;
constexpr double kBiasA_dps = 0.5;
constexpr double kBiasB_dps = -0.3;

enum HealthSeen : std::uint64_t {
  kMissingA = 1,
  kMissingB = 2,
  kSuspectA = 4,
  kSuspectB = 8,
};

/// Payload byte 4 is a status, 0 when the rate is valid; byte 6 an alive counter.
Plan plan_of_gyros() {
  Plan plan = rig::two_gyros();
  plan.corrector.method = Method::kMutual;
  plan.calibration.rest_s = 5.0;
  plan.corrector.order = 0;
  for (GyroPlan& gyro : plan.gyros) {
    gyro.valid =
        ValidCondition{rig::codec_of(rig::signal_of(32, 8, 1.0, 0.0, dbc::ValueType::kUnsigned)),
                       Comparison::kEqual, 0.0, "S == 0"};
    gyro.e2e.counter = AliveCounter{
        "C", rig::codec_of(rig::signal_of(48, 8, 1.0, 0.0, dbc::ValueType::kUnsigned)), 256};
  }
  return plan;
}

/// Each call draws new noise.
RateOf noisy(const RateOf& truth, double bias_dps, std::uint32_t seed) {
  auto rng = std::make_shared<std::mt19937>(seed);
  return [truth, bias_dps, rng](double t_s) {
    std::normal_distribution<double> noise(bias_dps, kSigma_dps);
    return truth(t_s) + noise(*rng);
  };
}

Recording counted(Recording recording) {
  for (std::size_t i = 0; i < recording.size(); ++i)
    recording[i].frame.data[6] = static_cast<std::uint8_t>(i);
  return recording;
}
Recording a(Duration to, const RateOf& rate) {
  return counted(rig::stream_a(ms(0), to, rate));
}
Recording b(Duration to, const RateOf& rate) {
  return counted(rig::stream_b(ms(0), to, rate));
}
Recording without(Recording recording, Duration from, Duration to) {
  std::erase_if(recording, [&](const rig::Event& event) {
    return event.stamp >= TimePoint{from} && event.stamp < TimePoint{to};
  });
  return recording;
}
template <class Change>
void change(Recording& recording, Duration from, Duration to, const Change& change_one) {
  for (rig::Event& event : recording) {
    if (event.stamp >= TimePoint{from} && event.stamp < TimePoint{to}) change_one(event.frame);
  }
}
void put_rate(can::Frame& frame, double rate_dps) {
  const can::Frame other = rig::rate_frame(frame.id, rate_dps);
  std::copy_n(other.data.begin(), 4, frame.data.begin());
}

/// The instants of the rates; VG_Age holds at most 7.5 ms.
struct Instants final : RateObserver {
  void on_rate(TimePoint t, const std::array<double, 2>& /*raw_dps*/,
               double /*virtual_dps*/) override {
    all.push_back(t);
  }
  std::vector<TimePoint> all;
};

struct Seen : RateSeen {
  TimePoint instant;
};

struct Played {
  explicit Played(const Plan& plan, const Recording& recording) : pipeline(plan) {
    pipeline.observe(&instants);
    for (const rig::Event& event : recording) {
      rig::receive_with_timer(pipeline, event, out);
      const State state = pipeline.status().state;
      if (states.empty() || states.back() != state) states.push_back(state);
    }
    pipeline.observe(nullptr);
    for (const RateSeen& rate : rig::rates_seen(out))
      rates.push_back({rate, instants.all[rates.size()]});
  }
  /// All bits that VB_Health showed within the time.
  [[nodiscard]] std::uint64_t health(Duration from, Duration to) const {
    std::uint64_t bits = 0;
    for (const rig::Output& bias : out.with_id(0x611)) {
      if (bias.stamp >= TimePoint{from} && bias.stamp < TimePoint{to})
        bits |= rig::bits(bias.frame, 59, 5);
    }
    return bits;
  }
  [[nodiscard]] std::size_t rates_in(State state, Duration from, Duration to) const {
    return static_cast<std::size_t>(std::count_if(rates.begin(), rates.end(), [&](const auto& r) {
      return r.state == state && r.stamp >= TimePoint{from} && r.stamp < TimePoint{to};
    }));
  }
  [[nodiscard]] Duration longest_hole(Duration from, Duration to) const {
    Duration longest{0};
    TimePoint before = TimePoint{from};
    for (const Seen& rate : rates) {
      const TimePoint instant = rate.instant;
      if (!rate.valid || instant < before || instant > TimePoint{to}) continue;
      longest = std::max(longest, instant - before);
      before = instant;
    }
    return std::max(longest, TimePoint{to} - before);
  }
  [[nodiscard]] double worst_error(const RateOf& truth, Duration from, Duration to) const {
    double worst = 0.0;
    for (const Seen& rate : rates) {
      const TimePoint t = rate.instant;
      if (!rate.valid || t < TimePoint{from} || t >= TimePoint{to}) continue;
      worst = std::max(worst, std::abs(rate.rate_dps - truth(to_seconds(t - TimePoint{}))));
    }
    return worst;
  }
  /// Integrates with trapezoids over the instants, as a receiver that computes the heading does.
  [[nodiscard]] double heading_error(const RateOf& truth, Duration from, Duration to) const {
    double error = 0.0;
    double before = 0.0;
    TimePoint last = TimePoint::max();
    for (const Seen& rate : rates) {
      const TimePoint t = rate.instant;
      if (!rate.valid || t < TimePoint{from} || t >= TimePoint{to}) continue;
      const double now = rate.rate_dps - truth(to_seconds(t - TimePoint{}));
      if (last < t) error += 0.5 * (before + now) * to_seconds(t - last);
      before = now;
      last = t;
    }
    return error;
  }
  void expect_instants_to_grow() const {
    TimePoint before = TimePoint::min();
    for (const Seen& rate : rates) {
      if (rate.state == State::kWaiting || rate.state == State::kCalibrating) continue;
      ASSERT_GT(rate.instant, before);
      before = rate.instant;
    }
  }
  void expect_books_to_balance() const {
    for (const GyroStatus& gyro : pipeline.status().gyros)
      EXPECT_EQ(gyro.frames, gyro.samples + rig::rejected_total(gyro));
  }

  Pipeline pipeline;
  rig::Collector out;
  Instants instants;
  std::vector<Seen> rates;
  std::vector<State> states;
};

// Rest for the calibration, then turns as in a town.
double drive(double t_s) {
  return t_s < 6.0 ? 0.0 : 20.0 * std::sin(0.5 * (t_s - 6.0));
}
// One turn whose peak is beyond the range of gyro b.
double fast_turn(double t_s) {
  const double u = (t_s - 20.0) / 4.0;
  return u < 0.0 || u > 1.0 ? 0.0 : 350.0 * std::pow(std::sin(u * std::numbers::pi), 2.0);
}

// Six σ of one gyro alone, and the error of its bias from five seconds.
constexpr double kErrorMax_dps = 6.0 * kSigma_dps + 4.0 * kSigma_dps / 22.0 + rig::kRateStep_dps;

// --- resolution ----------------------------------------------------------------------------------

// The sensor's own step decides; the frame's only if it is coarser.
TEST(GyroHealthStep, IsTheSensorsOwnAndNotThatOfTheFrame) {
  GyroPlan plan = rig::gyro_plan(0, rig::kIdA, "a");
  plan.rate.step = rig::kInputStep_dps;
  GyroHealth health(plan);
  const auto judge = [&](std::int64_t i, double rate_dps) {
    health.judge(at_ms(10 * i), rate_dps, nullptr, false);
  };
  for (std::int64_t i = 0; i < 100; ++i)
    judge(i, 0.0);
  EXPECT_FALSE(health.ever_changed());
  EXPECT_NEAR(health.step_dps(), 0.5, 1e-9);
  for (std::int64_t i = 100; i < 200; ++i)
    judge(i, 0.244 * static_cast<double>(i % 5));
  EXPECT_TRUE(health.ever_changed());
  EXPECT_NEAR(health.step_dps(), 0.244, 1e-9);
  plan.rate.step = 1.0;
  EXPECT_EQ(GyroHealth(plan).step_dps(), 1.0);
}

// --- saturated -----------------------------------------------------------------------------------

// A gyro that clips at 200 deg/s in a turn of 350: using both gyros would lose half of the clipped
// angle, 98 deg, of the heading; without the clipped one the turn is as good as from the other gyro
// alone.
TEST(GyroHealthSaturated, FastTurnKeepsItsHeading) {
  const auto clipped = [](double t_s) { return std::min(fast_turn(t_s), 200.0); };
  const Recording recording =
      merge({a(ms(30'000), noisy(fast_turn, kBiasA_dps, 1)),
             b(ms(30'000), [&, rate = noisy(fast_turn, kBiasB_dps, 2)](double t_s) {
               return std::min(rate(t_s), 200.0);
             })});
  double lost_deg = 0.0;
  for (double t_s = 20.0; t_s < 24.0; t_s += 1e-3)
    lost_deg += 0.5 * (fast_turn(t_s) - clipped(t_s)) * 1e-3;
  ASSERT_GT(lost_deg, 50.0);
  Plan plan = plan_of_gyros();
  plan.gyros[1].saturation_dps = 200.0;
  const Played known(plan, recording);
  // Noise over 4 s, and the error of the bias.
  const double noise_deg = kSigma_dps * std::sqrt(4.0 / 100.0) + 4.0 * kSigma_dps / 22.0;
  EXPECT_NEAR(known.heading_error(fast_turn, ms(19'000), ms(25'000)), 0.0, 4.0 * noise_deg);
  EXPECT_EQ(known.health(ms(20'000), ms(24'000)), kSuspectB);
  EXPECT_EQ(known.health(ms(24'000), ms(30'000)), 0U);
  EXPECT_LE(known.longest_hole(ms(19'000), ms(25'000)), ms(20));
  EXPECT_LT(known.worst_error(fast_turn, ms(6'000), ms(30'000)), kErrorMax_dps);
  EXPECT_EQ(rig::times(known.pipeline, 1, Fault::kSaturated), 1U);
  EXPECT_GT(rig::rejected(known.pipeline, 1, Reject::kSaturated), 150U);
  known.expect_instants_to_grow();
  known.expect_books_to_balance();
  // The clip is not configured: it is detected, eight samples late.
  const Played found(plan_of_gyros(), recording);
  EXPECT_LT(std::abs(found.heading_error(fast_turn, ms(19'000), ms(25'000))), 0.05 * lost_deg);
  EXPECT_EQ(found.health(ms(20'000), ms(24'000)), kSuspectB);
}

// Both gyros clip: no rate is valid.
TEST(GyroHealthSaturated, NothingIsValidWhereBothClip) {
  Plan plan = plan_of_gyros();
  for (GyroPlan& gyro : plan.gyros)
    gyro.saturation_dps = 200.0;
  const auto turn = [](double t_s) { return std::min(fast_turn(t_s), 200.0); };
  const Played run(plan, merge({a(ms(30'000), turn), b(ms(30'000), turn)}));
  EXPECT_LT(run.worst_error(fast_turn, ms(6'000), ms(30'000)), 0.5);
  EXPECT_EQ(run.health(ms(20'000), ms(24'000)), kSuspectA | kSuspectB);
  EXPECT_EQ(run.states.back(), State::kRunning);
  EXPECT_EQ(std::count(run.states.begin(), run.states.end(), State::kLost), 1);
}

// --- stuck ---------------------------------------------------------------------------------------

// A gyro that freezes in a turn causes an error until it is detected, then none.
TEST(GyroHealthStuck, IsSetAsideInMotionAndAtRest) {
  for (const std::size_t stuck : {0U, 1U}) {
    for (const std::int64_t at : {40'000, 70'000}) {  // in motion, at rest
      const auto truth = [](double t_s) { return t_s < 60.0 ? drive(t_s) : 0.0; };
      Recording recording_a = a(ms(80'000), noisy(truth, kBiasA_dps, 3));
      Recording recording_b = b(ms(80'000), noisy(truth, kBiasB_dps, 4));
      Recording& sick = stuck == 0 ? recording_a : recording_b;
      const double value =
          (stuck == 0 ? kBiasA_dps : kBiasB_dps) + truth(1e-3 * static_cast<double>(at));
      change(sick, ms(at), ms(at + 5'000), [&](can::Frame& f) { put_rate(f, value); });
      const Played run(plan_of_gyros(), merge({recording_a, recording_b}));
      const std::uint64_t bit = stuck == 0 ? kSuspectA : kSuspectB;
      EXPECT_EQ(run.health(ms(at + 1'000), ms(at + 5'000)), bit);
      EXPECT_EQ(run.health(ms(6'000), ms(at)), 0U);
      EXPECT_EQ(run.health(ms(at + 6'500), ms(80'000)), 0U);
      EXPECT_LT(run.worst_error(truth, ms(at + 1'000), ms(at + 5'000)), 2.0 * kErrorMax_dps)
          << stuck << " " << at;
      EXPECT_EQ(rig::times(run.pipeline, stuck, Fault::kStuck), 1U);
      EXPECT_GT(rig::rejected(run.pipeline, stuck, Reject::kStuck), 400U);
      EXPECT_GT(rig::rejected(run.pipeline, stuck, Reject::kRecovering), 40U);
      EXPECT_EQ(run.states.back(), State::kRunning);
      EXPECT_LE(run.longest_hole(ms(6'000), ms(79'900)), ms(20));
      run.expect_instants_to_grow();
      run.expect_books_to_balance();
    }
  }
}

/// Counts valid rates with a larger error than two healthy gyros can cause.
std::size_t wrong_rates(const Played& run, const RateOf& truth, Duration from, Duration to) {
  return static_cast<std::size_t>(
      std::count_if(run.rates.begin(), run.rates.end(), [&](const auto& r) {
        const bool inside = r.instant >= TimePoint{from} && r.instant < TimePoint{to};
        const double error_dps = r.rate_dps - truth(to_seconds(r.instant - TimePoint{}));
        return inside && r.valid && std::abs(error_dps) > 2.0 * kErrorMax_dps;
      }));
}

// A gyro falls to 0, or freezes, during a turn: a handful of samples detects it, and no more than
// these enter rates that are valid.
TEST(GyroHealthStuck, IsHeldAsideAfterAHandfulOfSamplesInATurn) {
  for (const std::size_t stuck : {0U, 1U}) {
    for (const bool to_zero : {false, true}) {
      SCOPED_TRACE(::testing::Message() << "gyro " << stuck << ", to zero " << to_zero);
      const RateOf truth = drive;
      Recording recording_a = a(ms(60'000), noisy(truth, kBiasA_dps, 3));
      Recording recording_b = b(ms(60'000), noisy(truth, kBiasB_dps, 4));
      Recording& sick = stuck == 0 ? recording_a : recording_b;
      const double value = to_zero ? 0.0 : drive(41.0) + (stuck == 0 ? kBiasA_dps : kBiasB_dps);
      change(sick, ms(41'000), ms(41'150), [&](can::Frame& f) { put_rate(f, value); });
      const Played run(plan_of_gyros(), merge({recording_a, recording_b}));
      EXPECT_LE(wrong_rates(run, truth, ms(6'000), ms(60'000)), 6U);
      EXPECT_EQ(wrong_rates(run, truth, ms(41'070), ms(60'000)), 0U);
      EXPECT_EQ(rig::times(run.pipeline, stuck, Fault::kStuck), 1U);
      EXPECT_EQ(rig::times(run.pipeline, 1 - stuck, Fault::kStuck), 0U);
      // A short fault has a short recovery.
      EXPECT_EQ(run.rates_in(State::kDegraded, ms(41'300), ms(60'000)), 0U);
      EXPECT_LE(run.longest_hole(ms(6'000), ms(59'900)), ms(20));
      run.expect_instants_to_grow();
      run.expect_books_to_balance();
    }
  }
}

// The frames arrive and the counter runs, but the rate is 0 from the start: in the first turn the
// other gyro is used alone, until this one has moved with it.
TEST(GyroHealthStuck, IsSetAsideInItsFirstTurnWhenItWasDeadFromTheStart) {
  for (const std::size_t dead : {0U, 1U}) {
    SCOPED_TRACE(::testing::Message() << "gyro " << dead);
    const auto truth = [](double t_s) {
      return t_s < 15.0 ? 0.0 : 20.0 * std::sin(0.5 * (t_s - 15.0));
    };
    Recording recording_a = a(ms(60'000), noisy(truth, dead == 0 ? 0.0 : kBiasA_dps, 3));
    Recording recording_b = b(ms(60'000), noisy(truth, dead == 1 ? 0.0 : kBiasB_dps, 4));
    Recording& sick = dead == 0 ? recording_a : recording_b;
    change(sick, ms(0), ms(40'000), [&](can::Frame& f) { put_rate(f, 0.0); });
    // Then noise without the turn, and at last sound values.
    const RateOf noise = noisy([](double) { return 0.0; }, 0.0, 5);
    change(sick, ms(40'000), ms(45'000), [&](can::Frame& f) { put_rate(f, noise(0.0)); });
    const Played run(plan_of_gyros(), merge({recording_a, recording_b}));
    EXPECT_EQ(run.rates_in(State::kRunning, ms(15'500), ms(45'000)), 0U);
    EXPECT_GT(run.rates_in(State::kRunning, ms(50'000), ms(60'000)), 990U);
    EXPECT_EQ(wrong_rates(run, truth, ms(15'500), ms(60'000)), 0U);
    EXPECT_EQ(wrong_rates(run, truth, ms(0), ms(15'000)), 0U);
    EXPECT_LE(run.longest_hole(ms(6'000), ms(59'900)), ms(20));
    EXPECT_EQ(rig::times(run.pipeline, 1 - dead, Fault::kStuck), 0U);
    run.expect_instants_to_grow();
    run.expect_books_to_balance();
  }
}

// --- flags and counters --------------------------------------------------------------------------

// The frame is flagged "invalid": the very next rate is from the other gyro, without a gap.
TEST(GyroHealthFlags, InvalidGyroIsSetAsideWithItsFirstFrame) {
  for (const std::size_t sick : {0U, 1U}) {
    Recording recording_a = a(ms(12'000), noisy(drive, kBiasA_dps, 5));
    Recording recording_b = b(ms(12'000), noisy(drive, kBiasB_dps, 6));
    change(sick == 0 ? recording_a : recording_b, ms(8'000), ms(9'000), [](can::Frame& f) {
      f.data[4] = 3;
      put_rate(f, 77.0);
    });
    const Played run(plan_of_gyros(), merge({recording_a, recording_b}));
    EXPECT_EQ(run.states, (std::vector{State::kWaiting, State::kCalibrating, State::kRunning,
                                       State::kDegraded, State::kRunning}));
    EXPECT_EQ(run.health(ms(8'005), ms(9'000)), sick == 0 ? kSuspectA : kSuspectB);
    EXPECT_EQ(run.health(ms(9'200), ms(12'000)), 0U);
    EXPECT_EQ(run.rates_in(State::kRunning, ms(8'010), ms(9'040)), 0U);
    EXPECT_GT(run.rates_in(State::kDegraded, ms(8'000), ms(9'000)), 98U);
    EXPECT_LE(run.longest_hole(ms(6'000), ms(11'900)), ms(17));  // the phase between the gyros
    EXPECT_LT(run.worst_error(drive, ms(6'020), ms(12'000)), kErrorMax_dps);
    EXPECT_EQ(rig::rejected(run.pipeline, sick, Reject::kFlaggedInvalid), 100U);
    EXPECT_EQ(rig::times(run.pipeline, sick, Fault::kFlaggedInvalid), 1U);
    run.expect_instants_to_grow();
    run.expect_books_to_balance();
  }
}

// A flag that toggles with every frame is one long fault, not a hundred short ones.
TEST(GyroHealthFlags, TogglingFlagDoesNotToggleTheState) {
  Recording recording_b = b(ms(12'000), noisy(drive, kBiasB_dps, 6));
  for (std::size_t i = 700; i < 1000; i += 3)
    recording_b[i].frame.data[4] = 1;
  const Played run(plan_of_gyros(),
                   merge({a(ms(12'000), noisy(drive, kBiasA_dps, 5)), recording_b}));
  EXPECT_EQ(rig::times(run.pipeline, 1, Fault::kFlaggedInvalid), 1U);
  EXPECT_EQ(run.states.size(), 5U);
  EXPECT_EQ(rig::rejected(run.pipeline, 1, Reject::kFlaggedInvalid), 100U);
  EXPECT_GT(rig::rejected(run.pipeline, 1, Reject::kRecovering), 200U);
  run.expect_books_to_balance();
}

// One corrupted frame is a hole like any other: no gyro is set aside.
TEST(GyroHealthFlags, SingleUnreadableFrameIsNoFault) {
  Recording recording_b = b(ms(12'000), noisy(drive, kBiasB_dps, 6));
  for (std::size_t i = 600; i < 1100; i += 20)
    put_rate(recording_b[i].frame, -2147.0);
  Plan plan = plan_of_gyros();
  plan.gyros[1].rate.minimum = -1000.0;
  const Played run(plan, merge({a(ms(12'000), noisy(drive, kBiasA_dps, 5)), recording_b}));
  EXPECT_EQ(rig::rejected(run.pipeline, 1, Reject::kOutOfRange), 25U);
  EXPECT_EQ(run.states.size(), 3U);
  EXPECT_EQ(run.health(ms(6'000), ms(12'000)), 0U);
}

// A sender that repeats its last frame: detected with the third repetition.
TEST(GyroHealthFlags, RepeatedCounterIsAFault) {
  Recording recording_b = b(ms(12'000), noisy(drive, kBiasB_dps, 6));
  for (std::size_t i = 801; i < 900; ++i)
    recording_b[i].frame = recording_b[800].frame;
  const Played run(plan_of_gyros(),
                   merge({a(ms(12'000), noisy(drive, kBiasA_dps, 5)), recording_b}));
  EXPECT_EQ(rig::rejected(run.pipeline, 1, Reject::kCounterRepeated), 99U);
  EXPECT_EQ(rig::times(run.pipeline, 1, Fault::kCounterStuck), 1U);
  EXPECT_EQ(run.health(ms(8'040), ms(8'900)), kSuspectB);
  EXPECT_EQ(run.rates_in(State::kRunning, ms(8'040), ms(9'400)), 0U);
  EXPECT_EQ(run.states.back(), State::kRunning);
  run.expect_books_to_balance();
}

// Some gateways send every frame twice: that is no fault, and does not keep a gyro from coming
// back.
TEST(GyroHealthFlags, FramesSaidTwiceAreNoFault) {
  Recording recording_b = b(ms(12'000), noisy(drive, kBiasB_dps, 6));
  recording_b[800].frame.data[4] = 1;
  Recording again = recording_b;
  for (rig::Event& event : again)
    event.stamp += ms(1);
  const Played run(plan_of_gyros(),
                   merge({a(ms(12'000), noisy(drive, kBiasA_dps, 5)), recording_b, again}));
  EXPECT_EQ(rig::times(run.pipeline, 1, Fault::kCounterStuck), 0U);
  EXPECT_EQ(rig::rejected(run.pipeline, 1, Reject::kRecovering), 5U);
  EXPECT_EQ(run.health(ms(8'200), ms(12'000)), 0U);
  EXPECT_EQ(run.states.back(), State::kRunning);
}

// The frames end while the gyro is suspect: then it is missing, not both.
TEST(GyroHealthFlags, SuspectThatFallsSilentIsMissing) {
  Recording recording_b = b(ms(9'000), noisy(drive, kBiasB_dps, 6));
  change(recording_b, ms(8'000), ms(9'000), [](can::Frame& f) { f.data[4] = 3; });
  const Played run(plan_of_gyros(),
                   merge({a(ms(12'000), noisy(drive, kBiasA_dps, 5)), recording_b}));
  EXPECT_EQ(run.health(ms(8'005), ms(9'000)), kSuspectB);
  EXPECT_EQ(run.health(ms(9'200), ms(12'000)), kMissingB);
  EXPECT_EQ(rig::times(run.pipeline, 1, Fault::kSilent), 1U);
}

// --- dead band -----------------------------------------------------------------------------------

// Zeros of a dead band are used in the calibration, where nothing better is available. They are not
// used while the other gyro continues, and are no defect.
TEST(GyroHealthDeadBand, ZeroIsNotUsedWhileTheOtherCarriesOn) {
  Plan plan = plan_of_gyros();
  plan.gyros[1].dead_band_dps = 2.0;
  const auto banded = [](double t_s) { return std::abs(drive(t_s)) < 2.0 ? 0.0 : drive(t_s); };
  const Played run(plan, merge({a(ms(30'000), noisy(drive, 0.0, 5)), b(ms(30'000), banded)}));
  EXPECT_EQ(run.states[2], State::kRunning);
  EXPECT_GT(rig::rejected(run.pipeline, 1, Reject::kDeadBand), 80U);
  EXPECT_GT(run.rates_in(State::kRunning, ms(6'000), ms(30'000)), 1'800U);
  EXPECT_EQ(run.health(ms(6'000), ms(30'000)), 0U);
  EXPECT_LT(run.worst_error(drive, ms(6'000), ms(30'000)), kErrorMax_dps);
  run.expect_instants_to_grow();
  // Without the other gyro, zeros are better than nothing.
  const Played alone(plan,
                     merge({without(a(ms(30'000), noisy(drive, 0.0, 5)), ms(10'000), ms(30'000)),
                            b(ms(30'000), banded)}));
  EXPECT_GT(alone.rates_in(State::kDegraded, ms(10'200), ms(30'000)), 1'970U);
  EXPECT_LT(alone.worst_error(drive, ms(6'000), ms(30'000)), 2.0 + kErrorMax_dps);
}

// --- a gyro goes and comes back ------------------------------------------------------------------

// A gyro returns after five minutes: the rate does not step by more than the noise.
TEST(GyroHealthReturn, AfterMinutesTheRateDoesNotStep) {
  for (const std::size_t gone : {0U, 1U}) {
    Recording recording_a = a(ms(330'000), noisy(drive, kBiasA_dps, 7));
    Recording recording_b = b(ms(330'000), noisy(drive, kBiasB_dps, 8));
    Recording& away = gone == 0 ? recording_a : recording_b;
    away = without(away, ms(20'000), ms(320'000));
    const Played run(plan_of_gyros(), merge({recording_a, recording_b}));
    EXPECT_EQ(run.health(ms(20'200), ms(320'000)), gone == 0 ? kMissingA : kMissingB);
    EXPECT_EQ(run.health(ms(320'100), ms(330'000)), 0U);
    EXPECT_LT(run.worst_error(drive, ms(6'000), ms(330'000)), 1.5 * kErrorMax_dps);
    EXPECT_GT(run.rates_in(State::kRunning, ms(320'000), ms(330'000)), 990U);
    EXPECT_LE(run.longest_hole(ms(6'000), ms(329'900)), ms(130));
    EXPECT_EQ(rig::times(run.pipeline, gone, Fault::kSilent), 1U);
    run.expect_instants_to_grow();
  }
}

// Both gyros come and go at different times, now and then both at once.
TEST(GyroHealthReturn, FlickeringGyrosGiveOneRisingLineOfInstants) {
  Recording recording_a = a(ms(60'000), noisy(drive, kBiasA_dps, 9));
  Recording recording_b = b(ms(60'000), noisy(drive, kBiasB_dps, 10));
  for (std::int64_t t = 7'000; t < 57'000; t += 2'000)
    recording_b = without(recording_b, ms(t), ms(t + 1'000));
  for (std::int64_t t = 30'300; t < 57'000; t += 1'700)
    recording_a = without(recording_a, ms(t), ms(t + 800));
  const Played run(plan_of_gyros(), merge({recording_a, recording_b}));
  run.expect_instants_to_grow();
  run.expect_books_to_balance();
  EXPECT_EQ(run.states.back(), State::kRunning);
  EXPECT_LT(run.worst_error(drive, ms(6'000), ms(60'000)), 2.0 * kErrorMax_dps);
  // Alone, a gyro is used from the time-out on; at the return of the other there is no wait.
  EXPECT_LE(run.longest_hole(ms(6'000), ms(30'000)), ms(130));
  EXPECT_EQ(rig::times(run.pipeline, 1, Fault::kSilent), 25U);
}

// --- everything at once --------------------------------------------------------------------------

class Mischief {
 public:
  explicit Mischief(std::uint32_t seed) : dice_(seed) {}

  /// One kind of fault after another, for up to two seconds each, with healthy stretches between
  /// them.
  void spoil(Recording& recording) {
    for (std::size_t at = 800; at < recording.size();) {
      const std::size_t end = std::min<std::size_t>(recording.size(), at + 1 + dice_.below(200));
      const std::uint32_t kind = dice_.below(8);
      for (std::size_t i = at; i < end; ++i)
        spoil_one(recording, at, i, kind);
      at = end + 100 + dice_.below(400);
    }
    std::erase_if(recording, [](const rig::Event& event) { return event.bus == kDropped; });
  }

 private:
  static constexpr can::BusIndex kDropped = 9;
  void spoil_one(Recording& recording, std::size_t first, std::size_t i, std::uint32_t kind) {
    can::Frame& frame = recording[i].frame;
    if (kind == 0) recording[i].bus = kDropped;
    if (kind == 1) frame.data[4] = 1;
    if (kind == 2 && dice_.one_in(2)) frame.data[4] = 1;
    if (kind == 3) frame = recording[first].frame;
    if (kind == 4) put_rate(frame, 200.0);
    if (kind == 5) frame.length = static_cast<std::uint8_t>(dice_.below(8));
    if (kind == 6) put_rate(frame, 1'900.0 * (dice_.one_in(2) ? 1.0 : -1.0));
    if (kind == 7 && dice_.one_in(3)) recording[i].bus = kDropped;
  }
  rig::Dice dice_;
};

// Random mixtures of all faults that frames reveal, on both gyros: every valid rate is right,
// instants increase, every frame is counted under its cause.
TEST(GyroHealthHostile, NoMixtureOfToldFaultsMakesAWrongRate) {
  for (std::uint32_t seed = 0; seed < 25; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Plan plan = plan_of_gyros();
    for (GyroPlan& gyro : plan.gyros) {
      gyro.saturation_dps = 200.0;
      gyro.rate.minimum = -1'000.0;
      gyro.rate.maximum = 1'000.0;
    }
    Recording recording_a = a(ms(60'000), noisy(drive, kBiasA_dps, 2 * seed));
    Recording recording_b = b(ms(60'000), noisy(drive, kBiasB_dps, 2 * seed + 1));
    Mischief(seed).spoil(recording_a);
    Mischief(seed + 1'000).spoil(recording_b);
    const Played run(plan, merge({recording_a, recording_b}));
    EXPECT_LT(run.worst_error(drive, ms(6'020), ms(60'000)), 2.0 * kErrorMax_dps);
    EXPECT_GT(run.rates.size(), 4'000U);
    run.expect_instants_to_grow();
    run.expect_books_to_balance();
  }
}

}  // namespace
}  // namespace vgyro::gateway
