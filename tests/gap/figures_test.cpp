#include "gap/figures.h"

#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "gap/describe.h"
#include "gap/differences.h"
#include "gap/study.h"
#include "made_recording.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

// A study must not outlive its recording.
struct Studied {
  explicit Studied(const Making& making) : recording(make_recording(making)) {
    auto begun = Study::begin(recording, noise_effects(making));
    if (begun) study = std::move(*begun);
  }
  Recording recording;
  std::shared_ptr<const Study> study;
};

Result described(const Study& study, const std::vector<Effect>& before, const Effect& effect) {
  Result result;
  NamedEffect named;
  named.effect = effect;
  named.sigma = {std::abs(effect.parameters[0]) / 20.0};
  result.effects.push_back(named);
  describe_effects(study, before, result);
  return result;
}

struct Line {
  double slope = 0.0;
  double sigma = 0.0;
  double chi_square = 0.0;  ///< of what the line leaves
};
Line straight_line(const Curve& curve) {
  double s = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t i = 0; i < curve.x.size(); ++i) {
    const double w = 1.0 / (curve.y_sigma[i] * curve.y_sigma[i]);
    s += w, sx += w * curve.x[i], sy += w * curve.y[i];
    sxx += w * curve.x[i] * curve.x[i], sxy += w * curve.x[i] * curve.y[i];
  }
  const double determinant = s * sxx - sx * sx;
  Line line{(s * sxy - sx * sy) / determinant, std::sqrt(s / determinant), 0.0};
  const double offset = (sy - line.slope * sx) / s;
  for (std::size_t i = 0; i < curve.x.size(); ++i) {
    const double z = (curve.y[i] - offset - line.slope * curve.x[i]) / curve.y_sigma[i];
    line.chi_square += z * z;
  }
  return line;
}

TEST(Figures, ScaleFactorErrorIsAStraightLineOfItsSlope) {
  Making making;
  making.seed = 21;
  constexpr double kError = 4e-4;
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 1 ? kError * rate_dps : 0.0;
  };
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const Result result =
      described(*studied.study, noise_effects(making), {1, Kind::kScaleFactor, {kError}, 0});
  const Figure& figure = result.effects[0].figure;
  ASSERT_EQ(figure.curves.size(), 3U);
  const Line without = straight_line(figure.curves[0]);
  EXPECT_NEAR(without.slope, kError, 4.0 * without.sigma);
  EXPECT_GT(kError, 20.0 * without.sigma);
  const double freedom = static_cast<double>(figure.curves[0].x.size()) - 2.0;
  EXPECT_LT(without.chi_square, freedom + 5.0 * std::sqrt(2.0 * freedom));
  const Line with = straight_line(figure.curves[1]);
  EXPECT_NEAR(with.slope, 0.0, 4.0 * with.sigma);
}

TEST(Figures, EvidenceSaysWhoFollowsWhatByHowMuch) {
  Making making;
  making.seconds = 120.0;
  making.seed = 22;
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const Result result =
      described(*studied.study, noise_effects(making), {1, Kind::kScaleFactor, {-4.2e-4}, 0});
  EXPECT_EQ(result.effects[0].evidence,
            "the residual of b follows the rate: -0.00042 of it, 20 standard errors");
}

TEST(Figures, WhereOfAScaleFactorIsWhereThePlatformTurns) {
  Making making;
  making.seed = 23;
  making.error = [](std::size_t gyro, double, double rate_dps) {
    return gyro == 0 ? 1e-3 * rate_dps : 0.0;
  };
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const Where where =
      described(*studied.study, noise_effects(making), {0, Kind::kScaleFactor, {1e-3}, 0})
          .effects[0]
          .where;
  // Nine tenths of 60 to 240 s, on seconds.
  EXPECT_GE(where.from_s, 59.0);
  EXPECT_NEAR(where.to_s - where.from_s, 0.9 * 180.0, 8.0);
  // The motion holds 0.11 and 0.37 Hz.
  EXPECT_LE(where.low_hz, 0.12);
  EXPECT_GE(where.high_hz, 0.1);
  EXPECT_LE(where.high_hz, 0.5);
}

TEST(Figures, WhereOfAStepBeginsAtTheStep) {
  Making making;
  making.seed = 24;
  constexpr double kAt_s = 100.3;
  making.error = [](std::size_t gyro, double t_s, double) {
    return gyro == 0 && t_s >= kAt_s ? 0.01 : 0.0;
  };
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const Result result =
      described(*studied.study, noise_effects(making), {0, Kind::kBiasStep, {0.01, kAt_s}, 0});
  const NamedEffect& named = result.effects[0];
  EXPECT_NEAR(named.where.from_s, kAt_s, 1.0);
  EXPECT_GT(named.where.to_s, kAt_s + 1.0);
  // Before the step nothing is left, after it the step: within the white noise of a bin's mean and
  // four seconds' walk.
  const Curve& without = named.figure.curves[0];
  for (std::size_t i = 0; i < without.x.size(); ++i) {
    if (std::abs(without.x[i] - kAt_s) < 5.0) continue;
    const double walk_dps = making.walk_dps_rts[0] * std::sqrt(without.x[i]);
    const double truth = without.x[i] < kAt_s ? 0.0 : 0.01;
    EXPECT_NEAR(without.y[i], truth, 5.0 * std::hypot(without.y_sigma[i], walk_dps));
  }
}

TEST(Figures, SimulatedSpectrumLiesAtTheInjectedDensity) {
  Making making;
  making.seed = 25;
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const std::vector<Effect> effects = noise_effects(making);
  const std::array<GyroFigures, 2> figures = gyro_figures(*studied.study, effects, effects, 7);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Figure& spectrum = figures[gyro].spectrum;
    ASSERT_EQ(spectrum.curves.size(), 2U);
    // Measured, then simulated: both are of the injected density above 5 Hz, where drift is gone.
    for (const Curve& curve : spectrum.curves) {
      double power = 0.0;
      double weight = 0.0;
      for (std::size_t i = 0; i < curve.x.size(); ++i) {
        if (curve.x[i] < 5.0 || curve.x[i] > 45.0) continue;
        // Points stand evenly on a logarithm: each speaks for as many hertz as its place.
        power += curve.x[i] * curve.y[i] * curve.y[i];
        weight += curve.x[i];
      }
      const double density = making.white_dps_rthz[gyro];
      // 40 Hz of 240 s are 9600 independent powers; tapered segments keep half of that.
      EXPECT_NEAR(power / weight / (density * density), 1.0, 5.0 / std::sqrt(4800.0))
          << curve.label << " of gyro " << gyro;
    }
    for (const Curve& curve : figures[gyro].time.curves)
      EXPECT_LE(curve.x.size(), 1500U);
    // White noise by far outweighs the walk at one sample.
    const Curve& allan = figures[gyro].allan.curves[1];
    EXPECT_NEAR(allan.y[0] * std::sqrt(allan.x[0]) / making.white_dps_rthz[gyro], 1.0, 0.03);
  }
}

TEST(Differences, CleanRecordingsHaveNone) {
  for (const std::uint64_t seed : {31U, 32U, 33U}) {
    Making making;
    making.seconds = 160.0;
    making.seed = seed;
    const Studied studied(making);
    ASSERT_NE(studied.study, nullptr);
    const std::vector<Difference> list = differences(*studied.study, noise_effects(making));
    EXPECT_TRUE(list.empty()) << "seed " << seed << ": " << list.front().text;
  }
}

TEST(Differences, LargestIsWhatWasInjected) {
  Making making;
  making.seed = 34;
  making.error = [](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 1 ? 1e-3 * rate_dps : 0.002 * std::sin(2.0 * kPi * 17.3 * t_s);
  };
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const std::vector<Difference> list = differences(*studied.study, noise_effects(making));
  ASSERT_EQ(list.size(), 2U);
  for (const Difference& difference : list) {
    if (difference.gyro == 1) {
      EXPECT_EQ(difference.against, "rate");
      EXPECT_GE(difference.where.from_s, 55.0);
    } else {
      EXPECT_EQ(difference.against, "frequency");
      EXPECT_LE(difference.where.low_hz, 17.3 + 0.01);
      EXPECT_GE(difference.where.high_hz, 17.3 - 0.01);
    }
  }
}

TEST(Differences, ClockThatRunsAwayIsOneDifference) {
  Making making;
  making.seed = 36;
  // 300 millionths of 240 s: a lag of 72 ms at the end.
  making.error = [&](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 1 ? true_rate_dps(making, t_s / (1.0 + 300e-6)) - rate_dps : 0.0;
  };
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  const std::vector<Difference> list = differences(*studied.study, noise_effects(making));
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0].gyro, 1U);
  EXPECT_EQ(list[0].against, "stamps");
}

TEST(Differences, NoiseThatTheModelPutsTooLowIsSaid) {
  Making making;
  making.seed = 35;
  const Studied studied(making);
  ASSERT_NE(studied.study, nullptr);
  Making wrong = making;
  wrong.white_dps_rthz[0] *= 0.9;
  const std::vector<Difference> list = differences(*studied.study, noise_effects(wrong));
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0].gyro, 0U);
  EXPECT_EQ(list[0].against, "noise");
  // 24000 samples of (1/0.9)² times the variance: n/2 (r − 1 − log r), by its own scatter.
  const double ratio = 1.0 / 0.81;
  const double nats = 12000.0 * (ratio - 1.0 - std::log(ratio));
  EXPECT_NEAR(list[0].nats, nats, 0.3 * nats);
}

}  // namespace
}  // namespace vgyro::gap
