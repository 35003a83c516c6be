// The algebra of the paper's method, on random data: the drifts that it follows, and those that it
// cannot.

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "fusion/corrector.h"
#include "tests/fusion/paper_steps.h"
#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

VirtualRate alone(Corrector& corrector, std::size_t gyro, double t_s, double rate_dps) {
  RatePair pair{.t_s = t_s};
  pair.rate_dps[gyro] = rate_dps;
  return corrector.update_alone(gyro, pair);
}

constexpr double kStart_s = 60.0;

Polynomial constant(double value) {
  return {.centre_s = 0.0, .half_width_s = 1.0, .coefficient = {value, 0.0, 0.0, 0.0}};
}

Calibration calibration_of(Polynomial sum, Polynomial difference) {
  Calibration calibration;
  calibration.end_s = kStart_s;
  calibration.sum = sum;
  calibration.difference = difference;
  return calibration;
}

Polynomial random_drift(Random& random, int order) {
  Polynomial p{.centre_s = 0.5 * kStart_s, .half_width_s = 0.5 * kStart_s};
  double size = 1.0;
  for (int i = 0; i <= order; ++i, size *= 0.1)
    p.coefficient[static_cast<std::size_t>(i)] = random.uniform(-size, size);
  return p;
}

std::unique_ptr<Corrector> started(int order, double window_s, const Calibration& calibration) {
  auto corrector = make_mutual_corrector(order, window_s);
  corrector->start(calibration);
  return corrector;
}

/// Noisy gyros on a turning platform, at 100 Hz with uneven stamps.
class RandomDrive {
 public:
  explicit RandomDrive(std::uint64_t seed) : random_(seed) {
    bias_dps_ = {random_.uniform(-1.0, 1.0), random_.uniform(-1.0, 1.0)};
    slope_dps_s_ = {random_.normal(1e-3), random_.normal(1e-3)};
  }
  RatePair at(double t_s) {
    const double turn_dps = 30.0 * std::sin(0.3 * t_s);
    RatePair pair{t_s, {}};
    for (const std::size_t k : {0U, 1U})
      pair.rate_dps[k] = turn_dps + bias_dps_[k] + slope_dps_s_[k] * t_s + random_.normal(0.05);
    return pair;
  }
  double jitter_s() { return random_.uniform(0.0, 0.008); }

 private:
  Random random_;
  std::array<double, 2> bias_dps_{};
  std::array<double, 2> slope_dps_s_{};
};

// Averaging cancels the cross drifts: the virtual gyro subtracts the calibration's own sum,
// extrapolated for ever, whatever happens later.
TEST(MutualCorrector, TakesOffTheExtrapolatedSumOfTheCalibrationAndNothingElse) {
  for (int order = 0; order <= kOrderMax; ++order) {
    for (const double window_s : {1.0, 7.3, 10.0}) {
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        SCOPED_TRACE(::testing::Message()
                     << "order " << order << " window " << window_s << " seed " << seed);
        Random random(seed);
        const Calibration calibration =
            calibration_of(random_drift(random, order), random_drift(random, order));
        const auto corrector = started(order, window_s, calibration);
        RandomDrive drive(seed);
        for (int i = 0; i < 10'000; ++i) {
          const RatePair pair = drive.at(kStart_s + i * 0.01 + drive.jitter_s());
          const double p1 = calibration.bias_dps(0, pair.t_s);
          const double p2 = calibration.bias_dps(1, pair.t_s);
          const double expected = 0.5 * (pair.rate_dps[0] + pair.rate_dps[1]) - 0.5 * (p1 + p2);
          const double largest = std::max(
              {std::abs(pair.rate_dps[0]), std::abs(pair.rate_dps[1]), std::abs(p1), std::abs(p2)});
          ASSERT_NEAR(corrector->update(pair).rate_dps, expected, 2e-15 * largest) << pair.t_s;
        }
        EXPECT_GE(corrector->windows().completed, 9U);
      }
    }
  }
}

// Compares the product's closed form with the paper's steps one by one.
TEST(MutualCorrector, DoesWhatThePapersStepsDo) {
  constexpr int kWindows = 50;
  constexpr double kWindow_s = 10.0;
  for (int order = 0; order <= kOrderMax; ++order) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(::testing::Message() << "order " << order << " seed " << seed);
      Random random(seed);
      const Calibration calibration =
          calibration_of(random_drift(random, order), random_drift(random, order));
      std::array<PaperSteps::Drift, 2> drifts;
      for (const std::size_t k : {0U, 1U}) {
        drifts[k] = {calibration.sum.centre_s, calibration.sum.half_width_s, {}};
        for (std::size_t i = 0; i <= static_cast<std::size_t>(order); ++i) {
          const PaperSteps::Real s = calibration.sum.coefficient[i];
          const PaperSteps::Real d = calibration.difference.coefficient[i];
          drifts[k].coefficient.push_back(k == 0 ? (s + d) / 2 : (s - d) / 2);
        }
      }
      PaperSteps paper(order, drifts);
      const auto corrector = started(order, kWindow_s, calibration);
      RandomDrive drive(seed);
      std::vector<PaperSteps::PaperSample> samples;
      std::vector<VirtualRate> ours;
      const auto take = [&](double t_s) {
        const RatePair pair = drive.at(t_s);
        samples.push_back({pair.t_s, pair.rate_dps});
        ours.push_back(corrector->update(pair));
      };
      for (int w = 0; w < kWindows; ++w) {
        const double from_s = kStart_s + w * kWindow_s;
        for (int i = 1; i < 300; ++i)
          take(from_s + (i + drive.jitter_s()) * kWindow_s / 300);
        const PaperSteps::Window theirs = paper.window(from_s, kWindow_s, samples);
        const double tolerance = 1e-12 * static_cast<double>(theirs.largest_dps);
        for (std::size_t i = 0; i < ours.size(); ++i) {
          ASSERT_NEAR(ours[i].rate_dps, static_cast<double>(theirs.virtual_dps[i]), tolerance)
              << "window " << w;
        }
        // The first pair after the window closes it. From then on the published drifts are the
        // paper's c_k = ½(p_k + P_k), extrapolated.
        samples.clear();
        ours.clear();
        take(from_s + kWindow_s);
        const double t_s = from_s + 1.25 * kWindow_s;
        for (const std::size_t k : {0U, 1U}) {
          const PaperSteps::Real c = (theirs.predicted[k].at(t_s) + theirs.renewed[k].at(t_s)) / 2;
          ASSERT_NEAR(corrector->drift(t_s).bias_dps[k], static_cast<double>(c), tolerance)
              << "window " << w;
        }
      }
      EXPECT_EQ(corrector->windows().completed, kWindows);
      EXPECT_EQ(corrector->windows().skipped, 0U);
    }
  }
}

// Common drift after the calibration is not in the difference: it enters the virtual rate in full,
// and no window corrects it.
TEST(MutualCorrector, NeverCorrectsTheMeanDrift) {
  for (int order = 0; order <= kOrderMax; ++order) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      SCOPED_TRACE(::testing::Message() << "order " << order << " seed " << seed);
      Random random(seed);
      const Calibration calibration =
          calibration_of(random_drift(random, order), random_drift(random, order));
      const auto steady = started(order, 5.0, calibration);
      const auto drifting = started(order, 5.0, calibration);
      RandomDrive drive(seed);
      for (int i = 0; i < 20'000; ++i) {
        RatePair pair = drive.at(kStart_s + i * 0.01);
        const VirtualRate without = steady->update(pair);
        const double common = 1e-3 * i * 0.01 + 0.2 * std::sin(0.01 * i * 0.01);
        const double largest = std::abs(pair.rate_dps[0]) + std::abs(pair.rate_dps[1]) + 1.0;
        for (double& rate_dps : pair.rate_dps)
          rate_dps += common;
        const VirtualRate with = drifting->update(pair);
        const double tolerance = 4.0 * std::numeric_limits<double>::epsilon() * largest;
        ASSERT_NEAR(with.rate_dps - without.rate_dps, common, tolerance) << i;
      }
      const double end_s = kStart_s + 200.0;
      for (const std::size_t k : {0U, 1U}) {
        EXPECT_NEAR(steady->drift(end_s).bias_dps[k], drifting->drift(end_s).bias_dps[k], 1e-11)
            << "nor do the published drifts know of it";
      }
    }
  }
}

// A difference that changes as the order allows is followed perfectly: from the second window on it
// is known at every instant, even if the calibration had none of it.
TEST(MutualCorrector, FollowsADifferenceThatChangesAsItsOrderAllows) {
  for (int order = 0; order <= kOrderMax; ++order) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      SCOPED_TRACE(::testing::Message() << "order " << order << " seed " << seed);
      Random random(seed);
      const Polynomial difference = random_drift(random, order);
      const auto corrector = started(order, 10.0, calibration_of(constant(0.0), constant(0.0)));
      for (int i = 0; i < 5000; ++i) {
        const double t_s = kStart_s + i * 0.01;
        const double half = 0.5 * difference.at(t_s);
        const VirtualRate out = corrector->update({t_s, {20.0 + half, 20.0 - half}});
        if (i < 1000) continue;
        const Drift drift = corrector->drift(t_s);
        ASSERT_NEAR(drift.bias_dps[0] - drift.bias_dps[1], 2.0 * half, 1e-11) << t_s;
        ASSERT_NEAR(out.corrected_dps[0], 20.0, 1e-11) << t_s;
        ASSERT_NEAR(out.corrected_dps[1], 20.0, 1e-11) << t_s;
      }
    }
  }
}

// A change that the order does not allow is followed one window late: a ramp, held as a constant,
// lags by one window on average.
TEST(MutualCorrector, LagsOneWindowBehindARampThatItHoldsAsConstant) {
  constexpr double kSlope_dps_s = 1e-3;
  constexpr double kWindow_s = 10.0;
  const auto corrector = started(0, kWindow_s, calibration_of(constant(0.0), constant(0.0)));
  double lag_s = 0.0;
  for (int i = 0; i < 5000; ++i) {
    const double t_s = kStart_s + i * 0.01;
    const double difference = kSlope_dps_s * (t_s - kStart_s);
    corrector->update({t_s, {difference, 0.0}});
    const Drift drift = corrector->drift(t_s);
    const double behind = difference - (drift.bias_dps[0] - drift.bias_dps[1]);
    if (i >= 4000) lag_s += behind / kSlope_dps_s / 1000.0;
  }
  EXPECT_NEAR(lag_s, kWindow_s, 1e-9);
}

// A gyro that overstates a turn seems to drift while the platform turns. The virtual rate is wrong
// only while turning, but the drifts learned in the turn are wrong after it, and so is a gyro that
// continues alone with them.
TEST(MutualCorrector, TakesAScaleFactorMismatchForDriftAndIsWrongWhenTheTurnEnds) {
  constexpr double kError = 1e-3;
  constexpr double kTurn_dps = 50.0;
  constexpr double kTurnEnd_s = kStart_s + 20.0;
  const auto corrector = started(1, 10.0, calibration_of(constant(0.0), constant(0.0)));
  for (int i = 0; i < 5000; ++i) {
    const double t_s = kStart_s + i * 0.01;
    const double turn_dps = t_s < kTurnEnd_s ? kTurn_dps : 0.0;
    const VirtualRate out = corrector->update({t_s, {turn_dps * (1.0 + kError), turn_dps}});
    EXPECT_NEAR(out.rate_dps - turn_dps, 0.5 * kError * turn_dps, 1e-12) << t_s;
    const double looks_like = 0.5 * kError * kTurn_dps;
    if (t_s >= kTurnEnd_s && t_s < kTurnEnd_s + 10.0) {
      EXPECT_NEAR(out.corrected_dps[0], -looks_like, 1e-12) << t_s;
      EXPECT_NEAR(out.corrected_dps[1], looks_like, 1e-12) << t_s;
      EXPECT_NEAR(alone(*corrector, 1, t_s, turn_dps).rate_dps, looks_like, 1e-12) << t_s;
    }
    if (t_s >= kTurnEnd_s + 10.0) {
      EXPECT_NEAR(out.corrected_dps[0], 0.0, 1e-12) << "a window at rest unlearns it, " << t_s;
    }
  }
}

// A gyro whose frames come late by τ reads Ω(t − τ): while the rate grows, that is τ·dΩ/dt of
// apparent drift, which remains when the rate is constant again.
TEST(MutualCorrector, TakesATimeSkewForDriftWhileTheRateGrows) {
  constexpr double kSkew_s = 0.01;
  constexpr double kGrowth_dps_s = 2.0;
  constexpr double kEnd_s = kStart_s + 20.0;
  const auto corrector = started(0, 10.0, calibration_of(constant(0.0), constant(0.0)));
  const auto rate_dps = [=](double t_s) {
    return kGrowth_dps_s * (std::clamp(t_s, kStart_s - 1.0, kEnd_s) - kStart_s);
  };
  for (int i = 0; i < 2500; ++i) {
    const double t_s = kStart_s + i * 0.01;
    const VirtualRate out = corrector->update({t_s, {rate_dps(t_s), rate_dps(t_s - kSkew_s)}});
    if (t_s < kEnd_s + 2 * kSkew_s) continue;
    const double learnt = 0.5 * kSkew_s * kGrowth_dps_s;
    EXPECT_NEAR(out.corrected_dps[1] - rate_dps(t_s), learnt, 1e-12) << t_s;
    EXPECT_NEAR(out.rate_dps, rate_dps(t_s), 1e-12) << t_s;
  }
}

// Windows emptied by a gap are skipped: the drift is held, and the grid stays aligned to the
// calibration's end.
TEST(MutualCorrector, SkipsTheWindowsOfAGapAndKeepsTheGrid) {
  const auto corrector = started(0, 10.0, calibration_of(constant(0.0), constant(7.0)));
  const auto feed = [&corrector](double from_s, double to_s, double difference) {
    for (int i = 0; from_s + i * 0.125 < to_s; ++i)
      corrector->update({from_s + i * 0.125, {difference, 0.0}});
  };
  const auto difference_at = [&corrector](double t_s) {
    const Drift drift = corrector->drift(t_s);
    return drift.bias_dps[0] - drift.bias_dps[1];
  };
  feed(60.0, 70.0, 1.0);
  EXPECT_EQ(difference_at(69.9), 7.0) << "the calibration's, until a window is complete";
  feed(70.0, 74.0, 2.0);
  EXPECT_EQ(difference_at(74.0), 1.0);
  EXPECT_EQ(corrector->windows().completed, 1U);
  feed(103.0, 110.0, 3.0);
  EXPECT_EQ(difference_at(109.9), 1.0)
      << "four seconds of a window and two empty ones teach nothing";
  EXPECT_EQ(corrector->windows().completed, 1U);
  EXPECT_EQ(corrector->windows().skipped, 3U);
  feed(110.0, 110.1, 4.0);
  EXPECT_EQ(difference_at(110.0), 3.0) << "the window that began at 100 s ends at 110 s";
  EXPECT_EQ(corrector->windows().completed, 2U);
}

// More windows than any integer can count.
TEST(MutualCorrector, PassesOverASilenceInWindowsOfNoLength) {
  const auto corrector = started(1, 1e-30, calibration_of(constant(0.5), constant(0.25)));
  corrector->update({kStart_s, {1.0, 1.0}});
  EXPECT_EQ(corrector->update({kStart_s + 1e9, {1.0, 1.0}}).rate_dps, 0.75);
  EXPECT_GE(static_cast<double>(corrector->windows().skipped), 1e15);
}

// A bus that was silent for thirty years in windows of a millisecond: the next pair costs no more
// than any other. A loop over the windows would run for hours here.
TEST(MutualCorrector, PassesOverASilenceOfAnyLengthInOneStep) {
  const auto corrector = started(1, 0.001, calibration_of(constant(0.5), constant(0.25)));
  corrector->update({kStart_s, {1.0, 1.0}});
  const VirtualRate out = corrector->update({kStart_s + 1e9, {1.0, 1.0}});
  EXPECT_EQ(out.rate_dps, 0.75);
  EXPECT_EQ(corrector->windows().completed, 0U);
  EXPECT_NEAR(static_cast<double>(corrector->windows().skipped), 1e12, 1e12 * 1e-9);
}

// --- lines are held across a leap of time --------------------------------------------------------

Polynomial line(double at_s, double value, double slope) {
  return {.centre_s = at_s, .half_width_s = 1.0, .coefficient = {value, slope, 0.0, 0.0}};
}

/// Feeds pairs every eighth of a second, from gyros whose difference is that of the calibration.
void feed(Corrector& corrector, double from_s, double to_s, const Polynomial& difference) {
  for (int i = 0; from_s + i * 0.125 < to_s; ++i) {
    const double t_s = from_s + i * 0.125;
    corrector.update({t_s, {0.5 * difference.at(t_s), -0.5 * difference.at(t_s)}});
  }
}

// The clock was set, or the bus was silent: the change of the drifts is unknown, and a slope
// learned in some seconds does not show it. Every line continues from where it was.
TEST(MutualCorrector, ExtendsNoLineOverALeapOfTime) {
  for (const double leap_s : {11.0, 3600.0, 72e3, 1e9}) {
    for (const double first_s : {kStart_s, 70.0, 75.0, 83.0}) {
      SCOPED_TRACE(::testing::Message() << leap_s << " s at " << first_s << " s");
      const auto corrector =
          started(1, 10.0, calibration_of(line(kStart_s, 0.5, 1e-3), line(kStart_s, 0.25, 2e-3)));
      feed(*corrector, kStart_s, first_s, line(kStart_s, 0.25, 2e-3));
      const double last_s = std::max(first_s - 0.125, kStart_s);
      const Drift before = corrector->drift(last_s);
      const double later_s = last_s + leap_s;
      const double change_dps = 1e-3 * leap_s;
      // Within the change that one window can bring: the sum's and the difference's slope over ten
      // seconds.
      const double most_dps = std::min(change_dps, 0.05);
      EXPECT_NEAR(corrector->drift(later_s).bias_dps[0], before.bias_dps[0], most_dps);
      const double rate_dps = corrector->update({later_s, {0.0, 0.0}}).rate_dps;
      EXPECT_NEAR(rate_dps, -0.5 * (before.bias_dps[0] + before.bias_dps[1]), 1e-12);
      const Drift after = corrector->drift(later_s);
      for (const std::size_t gyro : {0U, 1U})
        EXPECT_NEAR(after.bias_dps[gyro], before.bias_dps[gyro], 1e-9);
      // From there on the method works as usual.
      EXPECT_NEAR(corrector->update({later_s + 1.0, {0.0, 0.0}}).rate_dps, rate_dps - 5e-4, 1e-6);
      EXPECT_DOUBLE_EQ(corrector->drift(later_s).slope_dps_s, 5e-4);
    }
  }
}

TEST(MutualCorrector, ExtendsNoLineOverALeapWhileOneGyroIsAlone) {
  const auto corrector =
      started(1, 10.0, calibration_of(line(kStart_s, 0.5, 1e-3), line(kStart_s, 0.25, 2e-3)));
  const double before_dps = alone(*corrector, 0, kStart_s, 0.0).rate_dps;
  EXPECT_NEAR(alone(*corrector, 0, kStart_s + 1e6, 0.0).rate_dps, before_dps, 1e-12);
}

// One gyro is missing for an hour: the line of the difference is extended over one window, as the
// method uses it, and no further. The sum stays the calibration's.
TEST(MutualCorrector, ExtendsTheDifferenceOverNoMoreThanOneWindowWithoutAFit) {
  const auto corrector = started(1, 10.0, calibration_of(constant(0.0), line(kStart_s, 0.0, 2e-3)));
  for (int i = 0; i < 3600; ++i)
    alone(*corrector, 0, kStart_s + i, 0.0);
  EXPECT_NEAR(alone(*corrector, 0, kStart_s + 3600.0, 0.0).rate_dps, -0.5 * 2e-3 * 10.0, 1e-12);
  const Drift drift = corrector->drift(kStart_s + 3600.0);
  EXPECT_NEAR(drift.bias_dps[0] - drift.bias_dps[1], 2e-3 * 10.0, 1e-12);
}

// When one gyro falls silent, the other continues less its own last drift.
TEST(MutualCorrector, CarriesOnWithOneGyroLessItsOwnDrift) {
  const auto corrector = started(1, 10.0, calibration_of(constant(0.5), constant(0.1)));
  const VirtualRate first = alone(*corrector, 0, 61.0, 10.0);
  EXPECT_DOUBLE_EQ(first.rate_dps, 10.0 - 0.3);
  EXPECT_DOUBLE_EQ(first.corrected_dps[0], 10.0 - 0.3);
  EXPECT_TRUE(std::isnan(first.corrected_dps[1]));
  EXPECT_DOUBLE_EQ(alone(*corrector, 1, 61.0, 10.0).rate_dps, 10.0 - 0.2);
}

// The published slope is the one that is subtracted: half of the sum's.
TEST(MutualCorrector, PublishesTheSlopeThatItTakesOff) {
  Polynomial sum{.centre_s = 0.0, .half_width_s = 1.0, .coefficient = {0.0, 4e-5, 0.0, 0.0}};
  const auto corrector = started(1, 10.0, calibration_of(sum, constant(0.0)));
  EXPECT_DOUBLE_EQ(corrector->drift(100.0).slope_dps_s, 2e-5);
  const double at_60_s = corrector->update({60.0, {1.0, 1.0}}).rate_dps;
  const double at_61_s = corrector->update({61.0, {1.0, 1.0}}).rate_dps;
  EXPECT_NEAR(at_60_s - at_61_s, 2e-5, 1e-15);
}

// The plain mean averages its input, and has no drift to report.
TEST(MeanCorrector, AveragesAndKnowsNothing) {
  const auto mean = make_mean_corrector();
  EXPECT_FALSE(mean->needs_calibration());
  const VirtualRate out = mean->update({0.0, {1.0, 4.0}});
  EXPECT_EQ(out.rate_dps, 2.5);
  EXPECT_EQ(out.corrected_dps, (std::array<double, 2>{1.0, 4.0}));
  EXPECT_TRUE(std::isnan(out.sigma_dps));
  EXPECT_EQ(alone(*mean, 1, 0.0, 4.0).rate_dps, 4.0);
  EXPECT_TRUE(std::isnan(mean->drift(0.0).bias_dps[0]));
  EXPECT_EQ(mean->windows().completed, 0U);
}

}  // namespace
}  // namespace vgyro::fusion
