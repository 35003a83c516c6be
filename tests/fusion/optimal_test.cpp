// Compares the optimal corrector with the truth, with the filter at full rate that knows all
// parameters, and with its own σ.

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/fusion/optimal_run.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using Gyros = std::array<world::Gyro, 2>;
using Use = OptimalRun::Use;

constexpr double kRate_hz = 20.0;
constexpr double kStep_s = 1.0 / kRate_hz;

double at_rest(double /*t_s*/) {
  return 0.0;
}

// --- weights -------------------------------------------------------------------------------------

// Without drift the weights are those of the noise alone, and N_v² = N₁²N₂²/(N₁² + N₂²).
TEST(OptimalWeights, GiveTheLeastNoiseThatTwoGyrosCanHave) {
  for (const double ratio : {1.0, 3.0, 10.0}) {
    constexpr std::uint64_t kSeed = 21;
    SCOPED_TRACE(::testing::Message() << "noise 1 : " << ratio << ", seed " << kSeed);
    const Gyros gyros{world::Gyro{1e-3, 0.0, 0.05}, world::Gyro{1e-3 * ratio, 0.0, -0.02}};
    OptimalRun run(gyros, kRate_hz, kSeed, told(gyros));
    run.calibrate(300.0);
    constexpr int kSamples = 40'000;
    Rms rate;
    for (int i = 0; i < kSamples; ++i) {
      const Step step = run.step(at_rest);
      // The rate's error less the bias's error is the white noise.
      rate.add(step.rate_error_dps - step.bias_error_dps);
    }
    const double least = 1e-6 * ratio * ratio / (1.0 + ratio * ratio);
    const double density = rate.value() * rate.value() * kStep_s;
    EXPECT_NEAR(density / least, 1.0, kSigmas * std::sqrt(2.0 / kSamples));
  }
}

// R⁻¹1/(1ᵀR⁻¹1): a gyro that has the other one's noise and more gets no weight.
TEST(OptimalWeights, KnowNoiseThatTheGyrosShare) {
  constexpr std::uint64_t kSeed = 22;
  constexpr double kOwn1 = 1e-3;
  constexpr double kOwn2 = 2e-3;
  constexpr double kShared = 2e-3;
  Random random(kSeed);
  const auto corrector = make_optimal_corrector({});
  Calibrator calibrator(0, 1200.0);
  const double root = std::sqrt(kRate_hz);
  const auto next = [&](int i) -> RatePair {
    const double shared = random.normal(kShared * root);
    return {i * kStep_s,
            {shared + random.normal(kOwn1 * root), shared + random.normal(kOwn2 * root)}};
  };
  int i = 0;
  for (RatePair pair = next(i); calibrator.add(pair.t_s, pair.rate_dps, 0.0); pair = next(++i))
    corrector->calibrate(pair, 0.0);
  corrector->start(calibrator.result());
  // R = shared² + own²: the shared part cancels in the weights, w ∝ own⁻².
  const double expected = kOwn2 * kOwn2 / (kOwn1 * kOwn1 + kOwn2 * kOwn2);
  for (int n = 0; n < 100; ++n) {
    const VirtualRate rate = corrector->update(next(++i));
    const double weight =
        (rate.rate_dps - rate.corrected_dps[1]) / (rate.corrected_dps[0] - rate.corrected_dps[1]);
    ASSERT_NEAR(weight, expected, 0.1) << "seed " << kSeed;
  }
}

// --- the bound -----------------------------------------------------------------------------------

struct Drive {
  std::string name;
  std::function<double(double)> rate;
  std::function<bool(double)> stopped;
};

std::vector<Drive> drives() {
  const auto never = [](double /*t_s*/) { return false; };
  const auto always = [](double /*t_s*/) { return true; };
  const Stops stops;
  return {{"rest", at_rest, always},
          {"turning", winding, never},
          {"stops", [stops](double t_s) { return stops.rate(t_s); },
           [stops](double t_s) { return stops.stopped(t_s); }}};
}

// Heading error relative to the best possible filter, run by run: the common part cancels, so a few
// runs reveal a wrong gain.
TEST(Optimal, LosesLittleHeadingToTheBound) {
  const std::vector<Gyros> pairs{
      {world::Gyro{1e-3, 1e-5, 0.05}, world::Gyro{3e-3, 1e-4, -0.1}},
      {world::Gyro{2e-3, 3e-5, 0.05}, world::Gyro{2e-3, 3e-5, -0.1}},
  };
  constexpr std::uint64_t kRuns = 30;
  for (const Drive& drive : drives()) {
    for (const Gyros& gyros : pairs) {
      double extra = 0.0;
      double bound_square = 0.0;
      for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
        OptimalRun run(gyros, kRate_hz, seed, told(gyros));
        world::Bound bound(gyros, kStep_s);
        run.calibrate(60.0, &bound);
        double heading = 0.0;
        double bound_heading = 0.0;
        while (run.world.now_s() < 660.0) {
          const double t = run.world.now_s();
          const Step step = run.step(drive.rate, drive.stopped(t));
          heading += step.rate_error_dps * kStep_s;
          bound_heading += (bound.update(step.now, 0.0) - step.now.rate_dps) * kStep_s;
        }
        extra += (heading - bound_heading) * (heading - bound_heading) / kRuns;
        bound_square += bound_heading * bound_heading / kRuns;
      }
      EXPECT_LT(extra, 0.12 * bound_square)
          << drive.name << ", seeds 1 to " << kRuns << ", the bound's own "
          << std::sqrt(bound_square) << " deg rms";
    }
  }
}

// --- the truth of σ ------------------------------------------------------------------------------

struct Sureness {
  double rate = 0.0;  ///< mean of (error/σ)²
  double bias = 0.0;
  double rate_squares = 0.0;  ///< Σ error² / Σ σ²
};

struct Case {
  std::string name;
  Drive drive;
  Use use = Use::kBoth;
  double scale_sigma = 0.0;  ///< σ of each gyro's scale factor, drawn for each run
  double delay_s = 0.0;      ///< delay of gyro 2
  double noisier = 1.0;      ///< factor on gyro 2's noise, from half of the time on
  double seconds = 600.0;
  double rate_hz = kRate_hz;
  double least = 0.8;  ///< least mean of error² over σ²
};

Sureness sureness(const Case& which, const Gyros& usual, bool is_told, std::uint64_t runs) {
  Sureness sum;
  double count = 0.0;
  double errors = 0.0;
  double sigmas = 0.0;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    Gyros gyros = usual;
    Random random(seed);
    for (world::Gyro& gyro : gyros)
      gyro.scale = random.normal(which.scale_sigma);
    gyros[1].delay_s = which.delay_s;
    OptimalRun run(gyros, which.rate_hz, seed, is_told ? told(gyros) : OptimalSettings{});
    run.calibrate();
    const double louder_from_s = 60.0 + 0.5 * which.seconds;
    while (run.world.now_s() < 60.0 + which.seconds) {
      const double t = run.world.now_s();
      run.world.gyros_[1].white = gyros[1].white * (t > louder_from_s ? which.noisier : 1.0);
      const Step step = run.step(which.drive.rate, false, which.use);
      const double rate = step.rate_error_dps / step.virtual_rate.sigma_dps;
      const double bias = step.bias_error_dps / step.bias_sigma_dps;
      sum.rate += rate * rate;
      sum.bias += bias * bias;
      errors += step.rate_error_dps * step.rate_error_dps;
      sigmas += step.virtual_rate.sigma_dps * step.virtual_rate.sigma_dps;
      count += 1.0;
    }
  }
  return {sum.rate / count, sum.bias / count, errors / sigmas};
}

/// A motion too small for scale factors to matter.
double swaying(double t_s) {
  return 0.2 * std::sin(3.0 * t_s);
}

std::vector<Case> cases() {
  const std::vector<Drive> all = drives();
  const Stops stops;
  const Drive sway{"swaying", swaying, {}};
  const Drive sway_stops{"swaying, with stops",
                         [stops](double t_s) { return stops.stopped(t_s) ? 0.0 : swaying(t_s); },
                         {}};
  std::vector<Case> made;
  made.push_back({.name = "rest", .drive = all[0]});
  made.push_back({.name = "turning", .drive = all[1]});
  made.push_back({.name = "stops", .drive = all[2]});
  made.push_back({.name = "gyro 1 alone", .drive = sway, .use = Use::kGyro1});
  made.push_back({.name = "gyro 2 alone", .drive = sway_stops, .use = Use::kGyro2});
  made.push_back({.name = "long without stops", .drive = sway, .seconds = 1800.0});
  made.push_back({.name = "scale mismatch", .drive = all[2], .scale_sigma = 0.007});
  // It does not show which gyro is late; while the gyros contradict each other, σ is wide.
  made.push_back({.name = "skew", .drive = all[2], .delay_s = 0.01, .least = 0.2});
  made.push_back(
      {.name = "gyro 2 louder", .drive = sway, .noisier = 5.0, .seconds = 100.0, .rate_hz = 100.0});
  return made;
}

void expect_honest(const Case& which, const Sureness& found) {
  // A common scale factor does not show in the difference; σ assumes that the noisier and faster
  // drifting gyro is the likelier cause. Here both are equally bad, and on average over pairs σ is
  // too small by less than √2.
  const bool on_average = which.scale_sigma > 0.0;
  EXPECT_GT(on_average ? found.rate_squares : found.rate, which.least);
  EXPECT_LT(on_average ? found.rate_squares : found.rate, on_average ? 2.0 : 1.2);
}

// N and K are given, and the drift soon exceeds the noise of a sample, so σ must contain it.
TEST(OptimalSigma, IsHonestWhereTheNoiseIsTold) {
  const Gyros gyros{world::Gyro{1e-3, 2e-4, 0.05}, world::Gyro{2e-3, 3e-4, -0.1}};
  for (const Case& which : cases()) {
    constexpr std::uint64_t kRuns = 60;
    SCOPED_TRACE(::testing::Message() << which.name << ", seeds 1 to " << kRuns);
    const Sureness found = sureness(which, gyros, true, kRuns);
    expect_honest(which, found);
    EXPECT_GT(found.bias, 0.7);
    EXPECT_LT(found.bias, 1.3);
  }
}

TEST(OptimalSigma, IsHonestWhereTheNoiseIsEstimated) {
  const Gyros gyros{world::Gyro{1e-3, 2e-5, 0.05}, world::Gyro{2e-3, 6e-5, -0.1}};
  for (const Case& which : cases()) {
    constexpr std::uint64_t kRuns = 12;
    SCOPED_TRACE(::testing::Message() << which.name << ", seeds 1 to " << kRuns);
    expect_honest(which, sureness(which, gyros, false, kRuns));
  }
}

// --- reproducibility -----------------------------------------------------------------------------

TEST(Optimal, GivesTheSameBitsForTheSameInput) {
  const Gyros gyros{world::Gyro{1e-3, 2e-5, 0.05, 0.003}, world::Gyro{2e-3, 6e-5, -0.1}};
  const Stops stops;
  OptimalRun one(gyros, kRate_hz, 31, {});
  OptimalRun other(gyros, kRate_hz, 31, {});
  one.calibrate();
  other.calibrate();
  while (one.world.now_s() < 400.0) {
    const auto rate = [stops](double t_s) { return stops.rate(t_s); };
    const bool alone = std::fmod(one.world.now_s(), 100.0) > 95.0;
    const VirtualRate a = one.step(rate, false, alone ? Use::kGyro1 : Use::kBoth).virtual_rate;
    const VirtualRate b = other.step(rate, false, alone ? Use::kGyro1 : Use::kBoth).virtual_rate;
    ASSERT_EQ(a.rate_dps, b.rate_dps) << one.world.now_s();
    ASSERT_EQ(a.sigma_dps, b.sigma_dps) << one.world.now_s();
  }
  EXPECT_EQ(one.corrector->memory(400.0)->walk_weight, other.corrector->memory(400.0)->walk_weight);
}

}  // namespace
}  // namespace vgyro::fusion
