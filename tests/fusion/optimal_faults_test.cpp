// The optimal corrector when gyros jump, fall silent or grow noisy, when it is stopped and
// restarted, and on uneven streams.

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "tests/fusion/optimal_run.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using Gyros = std::array<world::Gyro, 2>;
using Use = OptimalRun::Use;

constexpr double kRate_hz = 20.0;

const Gyros kGyros{world::Gyro{1e-3, 2e-5, 0.05}, world::Gyro{2e-3, 5e-5, -0.1}};

/// A motion too small for scale factors to matter.
double swaying(double t_s) {
  return 0.2 * std::sin(3.0 * t_s);
}
double at_rest(double /*t_s*/) {
  return 0.0;
}

/// Results of a stretch of a run.
struct Stretch {
  Step last;
  double bias_square = 0.0;    ///< mean of the bias's (error/σ)²
  double rate_square = 0.0;    ///< mean of the rate's (error/σ)²
  double rate_rms_dps = 0.0;   ///< rms of the rate's error
  double greatest_step = 0.0;  ///< of the subtracted drift, from sample to sample, in σ
};

Stretch drive(OptimalRun& run, double seconds, const world::World::Rate& rate, Use use = Use::kBoth,
              const Step* before = nullptr) {
  Stretch stretch;
  double count = 0.0;
  if (before != nullptr) stretch.last = *before;
  bool has_last = before != nullptr;
  for (const double until = run.world.now_s() + seconds; run.world.now_s() < until; count += 1.0) {
    const Step step = run.step(rate, false, use);
    if (use == Use::kNone) continue;
    const double bias = step.bias_error_dps / step.bias_sigma_dps;
    const double away = step.rate_error_dps / step.virtual_rate.sigma_dps;
    stretch.bias_square += bias * bias;
    stretch.rate_square += away * away;
    stretch.rate_rms_dps += step.rate_error_dps * step.rate_error_dps;
    if (has_last) {
      const double sigma = std::max(step.bias_sigma_dps, stretch.last.bias_sigma_dps);
      stretch.greatest_step =
          std::max(stretch.greatest_step,
                   std::abs(step.bias_error_dps - stretch.last.bias_error_dps) / sigma);
    }
    stretch.last = step;
    has_last = true;
  }
  stretch.bias_square /= count;
  stretch.rate_square /= count;
  stretch.rate_rms_dps = std::sqrt(stretch.rate_rms_dps / count);
  return stretch;
}

// --- a jump of one gyro --------------------------------------------------------------------------

// It does not show which gyro jumped: this is reported, σ covers both cases, the rate does not
// step, and the next stop decides.
TEST(OptimalFaults, SayThatTheGyrosDisagreeUntilAStopTells) {
  constexpr std::uint64_t kRuns = 10;
  // Σ of error² over σ²; each gyro jumps as often as its drift makes it likely.
  double bias_square = 0.0;
  double rate_square = 0.0;
  const double drift = std::hypot(kGyros[0].walk, kGyros[1].walk);
  for (std::size_t bad = 0; bad < 2; ++bad) {
    const double share = std::pow(kGyros[bad].walk / drift, 2.0) / kRuns;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      SCOPED_TRACE(::testing::Message() << "gyro " << bad + 1 << ", seed " << seed);
      OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
      run.calibrate();
      const Step before = drive(run, 300.0, swaying).last;
      EXPECT_EQ(run.corrector->condition().disagreements, 0U);
      run.world.jump(bad, 0.05);
      drive(run, 3.0, swaying, Use::kBoth, &before);
      EXPECT_TRUE(run.corrector->condition().disagree);
      EXPECT_EQ(run.corrector->condition().disagreements, 1U);
      const Stretch after = drive(run, 300.0, swaying);
      bias_square += share * after.bias_square;
      rate_square += share * after.rate_square;
      EXPECT_LT(after.greatest_step, 3.0);
      EXPECT_TRUE(run.corrector->condition().disagree) << "nothing has told yet";
      const Stretch stop = drive(run, 30.0, at_rest);
      EXPECT_FALSE(run.corrector->condition().disagree);
      EXPECT_LT(std::abs(stop.last.bias_error_dps), 4.0 * stop.last.bias_sigma_dps);
      // Not 0: a turn of exactly the size of the jump is not quite excluded.
      EXPECT_LT(stop.last.bias_sigma_dps, 2e-3);
    }
  }
  EXPECT_GT(bias_square, 0.7);
  EXPECT_LT(bias_square, 1.3);
  EXPECT_GT(rate_square, 0.7);
  EXPECT_LT(rate_square, 1.3);
}

// --- drop-out ------------------------------------------------------------------------------------

TEST(OptimalFaults, BridgeADropOutOfEitherGyro) {
  constexpr std::uint64_t kRuns = 40;
  for (const Use use : {Use::kGyro1, Use::kGyro2}) {
    double square = 0.0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      SCOPED_TRACE(::testing::Message()
                   << "gyro " << static_cast<int>(use) + 1 << " left, seed " << seed);
      OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
      run.calibrate();
      const Step both = drive(run, 60.0, swaying).last;
      const Stretch alone = drive(run, 300.0, swaying, use, &both);
      EXPECT_GT(alone.last.bias_sigma_dps, both.bias_sigma_dps) << "σ grows";
      EXPECT_LT(alone.greatest_step, 3.0);
      const Stretch again = drive(run, 60.0, swaying, Use::kBoth, &alone.last);
      EXPECT_LT(again.greatest_step, 3.0) << "no jump at the return";
      EXPECT_FALSE(run.corrector->condition().disagree);
      square += std::pow(alone.last.bias_error_dps / alone.last.bias_sigma_dps, 2.0) / kRuns;
    }
    // σ also covers slopes, which these gyros do not have.
    EXPECT_GT(square, 0.4) << "seeds 1 to " << kRuns;
    EXPECT_LT(square, 1.0 + kSigmas * std::sqrt(2.0 / kRuns)) << "seeds 1 to " << kRuns;
  }
}

// --- a blind gyro --------------------------------------------------------------------------------

// One gyro no longer feels rotation: it is named, the other one carries the rate, and the reported
// σ of the drift is that gyro's. If the blind gyro is the only one left, no rate is usable.
TEST(OptimalFaults, NameABlindGyroAndDoWithoutIt) {
  for (std::size_t bad = 0; bad < 2; ++bad) {
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SCOPED_TRACE(::testing::Message() << "gyro " << bad + 1 << ", seed " << seed);
      OptimalRun run(kGyros, 50.0, seed, {});
      run.calibrate();
      drive(run, 120.0, winding);
      EXPECT_FALSE(run.corrector->condition().blind[0] || run.corrector->condition().blind[1]);
      run.world.gyros_[bad].blind = true;
      drive(run, 15.0, winding);
      EXPECT_TRUE(run.corrector->condition().blind[bad]);
      EXPECT_FALSE(run.corrector->condition().blind[1 - bad]);
      EXPECT_TRUE(run.corrector->condition().disagree);
      const Stretch after = drive(run, 60.0, winding);
      EXPECT_LT(after.rate_square, 1.3);
      // One gyro alone at 50 Hz, and 0.05 % of the blind one's error at up to 25 deg/s.
      EXPECT_LT(after.rate_rms_dps,
                1.2 * std::hypot(kGyros[1 - bad].white * std::sqrt(50.0), 0.0125));
      const Use only = bad == 0 ? Use::kGyro1 : Use::kGyro2;
      EXPECT_FALSE(run.step(winding, false, only).virtual_rate.usable);
      const Use other = bad == 0 ? Use::kGyro2 : Use::kGyro1;
      EXPECT_TRUE(run.step(winding, false, other).virtual_rate.usable);
    }
  }
}

// The subtracted drift is that of the gyro that carries the rate, and so is its σ: with the noisier
// and faster drifting gyro left, its σ.
TEST(OptimalFaults, SayTheDriftsSigmaOfTheGyroThatTheRateRestsOn) {
  constexpr std::uint64_t kSeed = 4;
  const Gyros gyros{world::Gyro{1e-3, 1e-5, 0.05}, world::Gyro{2e-3, 3e-4, -0.1}};
  OptimalRun run(gyros, 50.0, kSeed, told(gyros));
  run.calibrate();
  drive(run, 120.0, winding);
  run.world.gyros_[0].blind = true;
  const Step step = drive(run, 60.0, winding).last;
  ASSERT_TRUE(run.corrector->condition().blind[0]);
  // In the minute that gyro 2 has been alone, its walk contributes at least half of this.
  EXPECT_GT(step.bias_sigma_dps, 0.5 * gyros[1].walk * std::sqrt(60.0)) << "seed " << kSeed;
}

// --- noise ---------------------------------------------------------------------------------------

// Ten times the noise of the better gyro: it is named, and the other one carries the rate.
TEST(OptimalFaults, TakeTheWeightOffAGyroThatGrowsNoisy) {
  for (std::size_t bad = 0; bad < 2; ++bad) {
    constexpr std::uint64_t kSeed = 51;
    SCOPED_TRACE(::testing::Message() << "gyro " << bad + 1 << ", seed " << kSeed);
    OptimalRun run(kGyros, 100.0, kSeed, {});
    run.calibrate();
    drive(run, 60.0, swaying);
    EXPECT_FALSE(run.corrector->condition().noisy[0] || run.corrector->condition().noisy[1]);
    run.world.gyros_[bad].white *= 10.0;
    drive(run, 20.0, swaying);
    EXPECT_TRUE(run.corrector->condition().noisy[bad]);
    EXPECT_FALSE(run.corrector->condition().noisy[1 - bad]);
    const Stretch after = drive(run, 60.0, swaying);
    const double other_alone = kGyros[1 - bad].white * std::sqrt(100.0);
    EXPECT_LT(after.rate_rms_dps, 1.1 * other_alone);
    EXPECT_GT(after.rate_square, 0.5);
    EXPECT_LT(after.rate_square, 1.2);
  }
}

// --- memory --------------------------------------------------------------------------------------

TEST(OptimalMemory, GoesOnWhereItEnded) {
  constexpr std::uint64_t kSeed = 61;
  OptimalRun run(kGyros, kRate_hz, kSeed, told(kGyros));
  run.calibrate();
  drive(run, 300.2, swaying);  // no window ends with the next sample
  const double now = run.world.now_s();
  const auto memory = run.corrector->memory(now);
  ASSERT_TRUE(memory);
  const auto resumed = make_optimal_corrector(told(kGyros));
  ASSERT_TRUE(resumed->resume(*memory, 0.0, now));
  const Drift was = run.corrector->drift(now);
  const Drift is = resumed->drift(now);
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_NEAR(is.bias_dps[k], was.bias_dps[k], 1e-12);
  const RatePair pair{now, {0.3, 0.1}};
  const VirtualRate on = run.corrector->update(pair);
  const VirtualRate again = resumed->update(pair);
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_NEAR(again.corrected_dps[k], on.corrected_dps[k], 1e-12);
  // The last window ended a while ago: weights and σ must be the present ones.
  EXPECT_NEAR(is.bias_sigma_dps / was.bias_sigma_dps, 1.0, 0.02) << "seed " << kSeed;
}

// σ² grows by K² a second, and by the change of a sensor that was switched off and on. That holds
// for a memory that is certain of a walk; with possible slopes it grows faster, never slower.
TEST(OptimalMemory, AgesWithTheDrift) {
  OptimalRun run(kGyros, kRate_hz, 62, told(kGyros));
  run.calibrate();
  const auto memory = run.corrector->memory(run.world.now_s());
  ASSERT_TRUE(memory);
  const auto variances = [&](double age_s, bool only_walks) -> std::array<double, 3> {
    DriftMemory kept = *memory;
    if (only_walks) kept.kind_weight = {1.0, 0.0, 0.0, 0.0, 0.0};
    const auto resumed = make_optimal_corrector(told(kGyros));
    EXPECT_TRUE(resumed->resume(kept, age_s, 0.0));
    return resumed->memory(0.0)->bias_covariance;
  };
  const auto fresh = variances(0.0, true);
  const auto hour = variances(3600.0, true);
  const auto day = variances(86'400.0, true);
  const auto day_of_any = variances(86'400.0, false);
  for (std::size_t k = 0; k < 2; ++k) {
    const double walk = kGyros[k].walk * kGyros[k].walk;
    EXPECT_NEAR(fresh[2 * k], memory->bias_covariance[2 * k], 1e-9 * fresh[2 * k]);
    EXPECT_NEAR((day[2 * k] - hour[2 * k]) / (walk * 82'800.0), 1.0, 1e-6);
    EXPECT_GT(day_of_any[2 * k], day[2 * k]);
    const double run_to_run = hour[2 * k] - fresh[2 * k] - walk * 3600.0;
    EXPECT_GT(run_to_run, kGyros[k].white * kGyros[k].white) << "off is more than waiting";
  }
}

OptimalSettings learning_temperature() {
  OptimalSettings settings;
  settings.gyros[0].learns_temperature = settings.gyros[1].learns_temperature = true;
  return settings;
}
/// The memory of a pair with a ramp, with unknown parameters, after some stops.
DriftMemory learned_memory(std::uint64_t seed, double ramp_dps_s, Drift& was, double& now_s) {
  Gyros gyros = kGyros;
  gyros[0].ramp_dps_s = ramp_dps_s;
  OptimalRun run(gyros, kRate_hz, seed, learning_temperature());
  run.corrector->set_temperature({20.0, 25.0});
  run.calibrate(120.0);
  for (int stop = 0; stop < 3; ++stop) {
    run.corrector->set_temperature({21.0 + stop, 25.0 - stop});
    drive(run, 60.0, swaying);
    drive(run, 30.2, at_rest);
  }
  drive(run, 5.2, swaying);
  now_s = run.world.now_s();
  was = run.corrector->drift(now_s);
  return *run.corrector->memory(now_s);
}

// Everything learned is restored, slopes and temperature coefficients too.
TEST(OptimalMemory, KeepsSlopesAndTemperatureCoefficients) {
  for (const double ramp_dps_s : {0.0, 5e-5, 3e-4}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      SCOPED_TRACE(::testing::Message() << ramp_dps_s << " deg/s², seed " << seed);
      Drift was;
      double now_s = 0.0;
      const DriftMemory memory = learned_memory(seed, ramp_dps_s, was, now_s);
      const auto resumed = make_optimal_corrector(learning_temperature());
      resumed->set_temperature(memory.temperature_c);
      ASSERT_TRUE(resumed->resume(memory, 0.0, now_s));
      const DriftMemory again = *resumed->memory(now_s);
      for (std::size_t k = 0; k < 2; ++k) {
        EXPECT_NEAR(again.bias_dps[k], memory.bias_dps[k], 1e-9) << k;
        EXPECT_NEAR(std::sqrt(again.bias_covariance[2 * k] / memory.bias_covariance[2 * k]), 1.0,
                    0.05)
            << k;
        EXPECT_NEAR(again.slope_dps_s[k], memory.slope_dps_s[k], 0.1 * memory.slope_sigma_dps_s[k])
            << k;
        EXPECT_NEAR(again.slope_sigma_dps_s[k] / memory.slope_sigma_dps_s[k], 1.0, 0.1) << k;
        EXPECT_NEAR(again.coefficient_dps_k[k], memory.coefficient_dps_k[k],
                    1e-9 + 0.05 * memory.coefficient_sigma_dps_k[k])
            << k;
        EXPECT_NEAR(again.coefficient_sigma_dps_k[k] / memory.coefficient_sigma_dps_k[k], 1.0, 0.05)
            << k;
        EXPECT_NEAR(again.temperature_c[k], memory.temperature_c[k], 1e-9) << k;
      }
      for (std::size_t kind = 0; kind < kDriftKinds; ++kind)
        EXPECT_NEAR(again.kind_weight[kind], memory.kind_weight[kind], 1e-6) << kind;
      EXPECT_NEAR(resumed->drift(now_s).bias_sigma_dps / was.bias_sigma_dps, 1.0, 0.05);
    }
  }
}

// A memory from an older program has no slopes and temperatures; the rest of it is used.
TEST(OptimalMemory, ReadsWhatOlderProgramsHaveKept) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    Drift was;
    double now_s = 0.0;
    DriftMemory memory = learned_memory(seed, 0.0, was, now_s);
    const DriftMemory none;
    memory.kind_weight = none.kind_weight;
    memory.slope_dps_s = none.slope_dps_s;
    memory.slope_sigma_dps_s = none.slope_sigma_dps_s;
    memory.coefficient_dps_k = none.coefficient_dps_k;
    memory.coefficient_sigma_dps_k = none.coefficient_sigma_dps_k;
    memory.temperature_c = none.temperature_c;
    memory.has_temperature = none.has_temperature;
    const auto resumed = make_optimal_corrector(learning_temperature());
    ASSERT_TRUE(resumed->resume(memory, 0.0, now_s));
    const DriftMemory again = *resumed->memory(now_s);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR(again.bias_dps[k], memory.bias_dps[k], 1e-9) << k;
      EXPECT_NEAR(std::sqrt(again.bias_covariance[2 * k] / memory.bias_covariance[2 * k]), 1.0,
                  1e-6)
          << k;
    }
    const VirtualRate rate = resumed->update({now_s + 0.05, {0.3, 0.1}});
    EXPECT_TRUE(std::isfinite(rate.rate_dps) && rate.sigma_dps > 0.0);
  }
}

TEST(OptimalMemory, RefusesWhatCannotBe) {
  OptimalRun run(kGyros, kRate_hz, 63, {});
  run.calibrate();
  drive(run, 60.0, swaying);
  const auto good = run.corrector->memory(run.world.now_s());
  ASSERT_TRUE(good);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  using Spoil = void (*)(DriftMemory&);
  const std::vector<std::pair<const char*, Spoil>> spoils{
      {"bias NaN", [](DriftMemory& m) { m.bias_dps[1] = kNan; }},
      {"bias infinite", [](DriftMemory& m) { m.bias_dps[0] = kInfinity; }},
      {"variance negative", [](DriftMemory& m) { m.bias_covariance[0] = -1e-6; }},
      {"variance 0", [](DriftMemory& m) { m.bias_covariance[2] = 0.0; }},
      {"variance NaN", [](DriftMemory& m) { m.bias_covariance[2] = kNan; }},
      {"variance infinite", [](DriftMemory& m) { m.bias_covariance[2] = kInfinity; }},
      {"correlation above 1",
       [](DriftMemory& m) {
         m.bias_covariance[1] = 1.001 * std::sqrt(m.bias_covariance[0] * m.bias_covariance[2]);
       }},
      {"density negative", [](DriftMemory& m) { m.white_density[0] = -1e-6; }},
      {"density NaN", [](DriftMemory& m) { m.white_density[2] = kNan; }},
      {"sample variance 0", [](DriftMemory& m) { m.sample_variance[0] = 0.0; }},
      {"scale NaN", [](DriftMemory& m) { m.scale_difference = kNan; }},
      {"scale sigma negative", [](DriftMemory& m) { m.scale_difference_sigma = -0.01; }},
      {"skew NaN", [](DriftMemory& m) { m.skew_s = kNan; }},
      {"skew sigma NaN", [](DriftMemory& m) { m.skew_sigma_s = kNan; }},
      {"weight NaN", [](DriftMemory& m) { m.walk_weight[5] = kNan; }},
      {"weight negative", [](DriftMemory& m) { m.walk_weight[5] = -1.0; }},
      {"kind NaN", [](DriftMemory& m) { m.kind_weight[1] = kNan; }},
      {"kind negative", [](DriftMemory& m) { m.kind_weight[1] = -0.5; }},
      {"slope NaN", [](DriftMemory& m) { m.slope_dps_s[0] = kNan; }},
      {"slope sigma infinite", [](DriftMemory& m) { m.slope_sigma_dps_s[1] = kInfinity; }},
      {"slope sigma negative", [](DriftMemory& m) { m.slope_sigma_dps_s[1] = -1e-6; }},
      {"coefficient NaN", [](DriftMemory& m) { m.coefficient_dps_k[0] = kNan; }},
      {"coefficient sigma negative", [](DriftMemory& m) { m.coefficient_sigma_dps_k[0] = -1e-3; }},
      {"temperature infinite", [](DriftMemory& m) { m.temperature_c[0] = kInfinity; }},
  };
  for (const auto& [name, spoil] : spoils) {
    DriftMemory memory = *good;
    spoil(memory);
    const auto corrector = make_optimal_corrector({});
    EXPECT_FALSE(corrector->resume(memory, 1.0, 0.0)) << name;
    EXPECT_FALSE(corrector->memory(0.0)) << name << ": nothing has changed";
  }
  const auto corrector = make_optimal_corrector({});
  EXPECT_FALSE(corrector->resume(*good, -1.0, 0.0));
  EXPECT_FALSE(corrector->resume(*good, kNan, 0.0));
  EXPECT_TRUE(corrector->resume(*good, 1.0, 0.0));
}

// --- uneven streams ------------------------------------------------------------------------------

// Minutes without a sample, samples far apart, slow gyros: σ stays true and finite.
TEST(OptimalStreams, MayHaveGaps) {
  constexpr std::uint64_t kRuns = 30;
  double square = 0.0;
  double count = 0.0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    OptimalRun run(kGyros, kRate_hz, seed, told(kGyros));
    run.calibrate();
    Random random(seed);
    for (int i = 0; i < 40; ++i) {
      drive(run, random.uniform(0.0, 1.0) < 0.5 ? 0.05 : 20.0, swaying);
      const Step step = drive(run, 0.05, swaying).last;
      ASSERT_TRUE(std::isfinite(step.virtual_rate.rate_dps));
      ASSERT_GT(step.virtual_rate.sigma_dps, 0.0);
      square += std::pow(step.bias_error_dps / step.bias_sigma_dps, 2.0);
      count += 1.0;
      drive(run, random.uniform(0.0, 60.0), swaying, Use::kNone);
    }
  }
  EXPECT_GT(square / count, 0.7) << "seeds 1 to " << kRuns;
  EXPECT_LT(square / count, 1.3) << "seeds 1 to " << kRuns;
}

TEST(OptimalStreams, MayBeOfSlowGyros) {
  constexpr std::uint64_t kRuns = 60;
  for (const double rate_hz : {1.0, 5.0}) {
    double bias = 0.0;
    double rate = 0.0;
    std::uint64_t found = 0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      OptimalRun run(kGyros, rate_hz, seed, told(kGyros));
      run.calibrate();
      const Stretch moving = drive(run, 600.0, swaying);
      const Stretch stop = drive(run, 120.0, at_rest);
      found += run.corrector->condition().stops > 0 ? 1U : 0U;
      bias += (moving.bias_square + stop.bias_square) / 2.0 / kRuns;
      rate += moving.rate_square / kRuns;
    }
    // A drift beyond three standard deviations may also be a slow turn at first.
    EXPECT_GE(found + 2, kRuns) << rate_hz << " Hz";
    EXPECT_GT(bias, 0.7) << rate_hz << " Hz, seeds 1 to " << kRuns;
    EXPECT_LT(bias, 1.3) << rate_hz << " Hz, seeds 1 to " << kRuns;
    EXPECT_GT(rate, 0.8) << rate_hz << " Hz, seeds 1 to " << kRuns;
    EXPECT_LT(rate, 1.2) << rate_hz << " Hz, seeds 1 to " << kRuns;
  }
}

// An interpolated sample has less noise than a raw one; σ follows from pair to pair.
TEST(OptimalStreams, MayHaveInterpolatedSamples) {
  constexpr std::uint64_t kSeed = 71;
  Random random(kSeed);
  const auto corrector = make_optimal_corrector({});
  Calibrator calibrator(0, 120.0);
  const auto next = [&](int i) -> RatePair {
    RatePair pair{i / kRate_hz, {}, {1.0, i % 3 == 0 ? 1.0 : 0.3}};
    for (std::size_t k = 0; k < 2; ++k)
      pair.rate_dps[k] = random.normal(kGyros[k].white * std::sqrt(kRate_hz * pair.noise_gain[k]));
    return pair;
  };
  int i = 0;
  for (RatePair pair = next(i); calibrator.add(pair.t_s, pair.rate_dps, 0.0); pair = next(++i))
    corrector->calibrate(pair, 0.0);
  corrector->start(calibrator.result());
  std::array<double, 2> square{};
  std::array<double, 2> count{};
  for (int n = 0; n < 40'000; ++n) {
    const RatePair pair = next(++i);
    const VirtualRate rate = corrector->update(pair);
    const std::size_t kind = pair.noise_gain[1] < 1.0 ? 1 : 0;
    square[kind] += std::pow(rate.rate_dps / rate.sigma_dps, 2.0);
    count[kind] += 1.0;
  }
  for (std::size_t kind = 0; kind < 2; ++kind)
    EXPECT_NEAR(square[kind] / count[kind], 1.0, 0.1) << kind << ", seed " << kSeed;
}

}  // namespace
}  // namespace vgyro::fusion
