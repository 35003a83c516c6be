#include "gap/scan.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Effect;
using model::Kind;

constexpr double kPlantedSigmas = 12.0;
constexpr double kSigmas = 4.0;
// What a name needs; docs/gap.md.
constexpr double kNameNeeds = 18.0;
constexpr std::size_t kGyro = 0;

Making making_of(std::uint64_t seed, double seconds = 120.0, double rest_s = 30.0) {
  Making making;
  making.seconds = seconds;
  making.rest_s = rest_s;
  making.seed = seed;
  return making;
}

std::string text_of(const Effect& effect) {
  return std::string(model::info(effect.kind).name) + " " + model::parameters_text(effect);
}

std::string text_of(const Score& score) {
  return text_of(score.effect) + ": " + std::to_string(score.statistic) + " less " +
         std::to_string(score.penalty);
}

std::string text_of(const std::vector<Score>& scores) {
  std::string text;
  for (std::size_t i = 0; i < std::min<std::size_t>(5, scores.size()); ++i)
    text += "\n  " + text_of(scores[i]);
  return text;
}

// By definition: of the size of the acceleration over the last second.
double true_vibration_g2(double t_s) {
  constexpr double kInterval_s = 0.01;
  double sum = 0.0;
  double squares = 0.0;
  double count = 0.0;
  for (double age_s = 0.0; age_s < 1.0 - 0.5 * kInterval_s && age_s <= t_s; age_s += kInterval_s) {
    double square = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      square += std::pow(true_acceleration_g(axis, t_s - age_s), 2);
    sum += std::sqrt(square);
    squares += square;
    count += 1.0;
  }
  return squares / count - std::pow(sum / count, 2);
}

// One shape of the catalogue, of size 1, in closed form.
struct Shape {
  Kind kind;
  std::size_t size_at;       ///< which parameter is the size
  model::Parameters others;  ///< its own as in the scan; the size is not looked at
  std::function<double(double t_s, double rate_dps)> dps;
};

std::vector<Shape> shapes_of(const Making& making) {
  const auto excess_c = [](double t_s) { return true_temperature_c(t_s) - 25.0; };
  // A lag is linear in its size where it is small.
  const auto lag = [making](double t_s, double lag_s) {
    constexpr double kSmall = 1e-4;
    return (true_rate_dps(making, t_s - kSmall * lag_s) - true_rate_dps(making, t_s)) / kSmall;
  };
  return {
      {Kind::kBias, 0, {}, [](double, double) { return 1.0; }},
      {Kind::kBiasRamp, 0, {}, [](double t_s, double) { return t_s; }},
      {Kind::kWarmUp, 0, {0.0, 15.0}, [](double t_s, double) { return std::exp(-t_s / 15.0); }},
      {Kind::kTemperatureBias, 0, {0.0, 25.0}, [=](double t_s, double) { return excess_c(t_s); }},
      {Kind::kTemperatureBiasQuadratic,
       0,
       {0.0, 25.0},
       [=](double t_s, double) { return excess_c(t_s) * excess_c(t_s); }},
      {Kind::kTemperatureRateBias,
       0,
       {},
       [](double t_s, double) { return true_temperature_slope_c_s(t_s); }},
      {Kind::kScaleFactor, 0, {}, [](double, double rate_dps) { return rate_dps; }},
      {Kind::kScaleFactorAsymmetry,
       0,
       {},
       [](double, double rate_dps) { return std::abs(rate_dps); }},
      {Kind::kScaleFactorQuadratic,
       0,
       {},
       [](double, double rate_dps) { return rate_dps * rate_dps; }},
      {Kind::kScaleFactorCubic,
       0,
       {},
       [](double, double rate_dps) { return rate_dps * rate_dps * rate_dps; }},
      {Kind::kScaleFactorTemperature,
       0,
       {0.0, 25.0},
       [=](double t_s, double rate_dps) { return excess_c(t_s) * rate_dps; }},
      {Kind::kGSensitivity,
       1,
       {0.0},
       [](double t_s, double) { return true_acceleration_g(0, t_s); }},
      {Kind::kGSensitivity,
       1,
       {1.0},
       [](double t_s, double) { return true_acceleration_g(1, t_s); }},
      {Kind::kVibrationRectification,
       0,
       {},
       [](double t_s, double) { return true_vibration_g2(t_s); }},
      {Kind::kDelay, 0, {}, [=](double t_s, double) { return lag(t_s, 1.0); }},
      {Kind::kClockSkew, 0, {}, [=](double t_s, double) { return lag(t_s, 1e-6 * t_s); }},
  };
}

// Standard error of a shape's size by generalised least squares with the full covariance of means
// over a fifth of a second, in which no shape here moves much: white noise, and a walk from time 0.
class DenseErrors {
 public:
  explicit DenseErrors(const Making& making) : making_(making) {
    const auto cells = static_cast<Eigen::Index>(making.seconds / kCell_s);
    Eigen::MatrixXd covariance(cells, cells);
    const double white = making.white_dps_rthz[kGyro];
    const double walk = making.walk_dps_rts[kGyro];
    for (Eigen::Index i = 0; i < cells; ++i) {
      for (Eigen::Index j = 0; j < cells; ++j)
        covariance(i, j) = walk * walk * std::min(middle_s(i), middle_s(j));
      covariance(i, i) += white * white / kCell_s;
    }
    factor_.compute(covariance);
  }

  [[nodiscard]] double sigma(const Shape& shape) const {
    Eigen::VectorXd column(factor_.rows());
    for (Eigen::Index i = 0; i < column.size(); ++i)
      column[i] = shape.dps(middle_s(i), true_rate_dps(making_, middle_s(i)));
    return 1.0 / std::sqrt(column.dot(factor_.solve(column)));
  }

 private:
  static constexpr double kCell_s = 0.2;
  static double middle_s(Eigen::Index i) { return kCell_s * (static_cast<double>(i) + 0.5); }

  Making making_;
  Eigen::LLT<Eigen::MatrixXd> factor_;
};

bool is_of(const Score& score, const Shape& shape) {
  if (score.effect.kind != shape.kind) return false;
  for (std::size_t i = 0; i < shape.others.size(); ++i) {
    if (i != shape.size_at && score.effect.parameters[i] != shape.others[i]) return false;
  }
  return true;
}

// On a platform that stays level z feels 1 g all the time, which is a bias in other words.
bool is_rival_of(const Score& score, const Shape& shape) {
  return shape.kind == Kind::kBias && score.effect.kind == Kind::kGSensitivity &&
         score.effect.parameters[0] == 2.0;
}

const Score* find(const std::vector<Score>& scores, Kind kind) {
  const auto found = std::find_if(scores.begin(), scores.end(),
                                  [&](const Score& one) { return one.effect.kind == kind; });
  return found == scores.end() ? nullptr : &*found;
}

// A recording with all that moves, and nothing wrong.
class ScanTest : public ::testing::Test {
 protected:
  static constexpr std::uint64_t kSeed = 51;

  static void SetUpTestSuite() {
    Recording recording = make_recording(making());
    add_surroundings(recording);
    made_ = new MadeStudy(std::move(recording), noise_effects(making()));
  }
  static void TearDownTestSuite() { delete made_; }

  void SetUp() override { ASSERT_NE(made_->study(), nullptr); }

  static Making making() { return making_of(kSeed); }
  static const Observations& clean() { return *made_->observations(kGyro); }

  static std::vector<Score> scan(std::shared_ptr<const Observations> data, Effects terms = {},
                                 const Effects& known = {}) {
    Effects all = noise_effects(making());
    all.insert(all.end(), known.begin(), known.end());
    const Regression regression(std::move(data), all, Part::kAll);
    Fit null{std::move(terms), regression.known_noise(), 0.0, {}};
    regression.improve(null);
    return Scan(regression, null.terms).scores(null, null.noise);
  }

 private:
  static inline MadeStudy* made_ = nullptr;
};

TEST_F(ScanTest, RanksEveryShapeFirstThatIsPlanted) {
  const DenseErrors errors(making());
  for (const Shape& shape : shapes_of(making())) {
    const double sigma = errors.sigma(shape);
    const double size = kPlantedSigmas * sigma;
    const auto scores = scan(planted(clean(), kGyro, [&](double t_s, double rate_dps) {
      return size * shape.dps(t_s, rate_dps);
    }));
    ASSERT_FALSE(scores.empty());
    const Score& first = scores.front();
    EXPECT_TRUE(is_of(first, shape) || is_rival_of(first, shape))
        << model::info(shape.kind).name << ":" << text_of(scores);
    const auto own = std::find_if(scores.begin(), scores.end(),
                                  [&](const Score& one) { return is_of(one, shape); });
    ASSERT_NE(own, scores.end()) << model::info(shape.kind).name;
    EXPECT_NEAR(own->effect.parameters[shape.size_at], size, kSigmas * sigma) << text_of(*own);
    // The square of a normal variable about 12.
    EXPECT_NEAR(std::sqrt(own->statistic), kPlantedSigmas, kSigmas) << text_of(*own);
  }
}

// On a quiet recording the same shapes are what chance makes of them.
TEST_F(ScanTest, ProposesNothingOfWeightWhereNothingIsPlanted) {
  const std::vector<Score> scores =
      scan(planted(clean(), kGyro, [](double, double) { return 0.0; }));
  ASSERT_FALSE(scores.empty());
  EXPECT_LT(scores.front().adjusted(), kNameNeeds) << text_of(scores);
  EXPECT_TRUE(std::is_sorted(scores.begin(), scores.end(), [](const Score& a, const Score& b) {
    return a.adjusted() > b.adjusted();
  }));
}

TEST_F(ScanTest, FindsALowPassAndAboutWhereItCutsOff) {
  for (const double cutoff_hz : {2.0, 5.0}) {
    const std::vector<double> late_dps = low_passed_rate_dps(making(), cutoff_hz);
    const std::vector<Score> scores =
        scan(planted(clean(), kGyro, [&](double t_s, double rate_dps) {
          return late_dps[static_cast<std::size_t>(std::lround(t_s / 0.01))] - rate_dps;
        }));
    ASSERT_FALSE(scores.empty());
    EXPECT_EQ(scores.front().effect.kind, Kind::kBandwidth) << text_of(scores);
    // A linear look from a start that is at most 2.5 times away: a tenth is what a fit bridges.
    EXPECT_NEAR(scores.front().effect.parameters[0] / cutoff_hz, 1.0, 0.1) << text_of(scores);
  }
}

TEST_F(ScanTest, FindsWhatRepeatsWithTheAngle) {
  const std::vector<double> angle_rad = true_angle_rad(making());
  constexpr double kAmplitude_dps = 4e-3;
  constexpr double kPhase_rad = 0.7;
  const std::vector<Score> scores = scan(planted(clean(), kGyro, [&](double t_s, double) {
    const double angle = angle_rad[static_cast<std::size_t>(std::lround(t_s / 0.01))];
    return kAmplitude_dps * std::cos(5.0 * angle + kPhase_rad);
  }));
  ASSERT_FALSE(scores.empty());
  const Effect& first = scores.front().effect;
  EXPECT_EQ(first.kind, Kind::kAngleHarmonic) << text_of(scores);
  EXPECT_EQ(first.parameters[0], 5.0) << text_of(scores);
  // Both parts of a wave that fills the recording are known to about N·√(2/T).
  const double sigma = making().white_dps_rthz[kGyro] * std::sqrt(2.0 / making().seconds);
  EXPECT_NEAR(first.parameters[1], kAmplitude_dps, 2.0 * kSigmas * sigma);
  EXPECT_NEAR(first.parameters[2], kPhase_rad, 2.0 * kSigmas * sigma / kAmplitude_dps);
}

TEST_F(ScanTest, FindsALineToWithinAStepOfItsFrequencies) {
  const double sigma = making().white_dps_rthz[kGyro] * std::sqrt(2.0 / making().seconds);
  const double amplitude_dps = kPlantedSigmas * sigma;
  // Twice as many frequencies as the recording resolves, rounded up to a power of two.
  const double step_hz = 0.5 / making().seconds;
  for (const double frequency_hz : {0.4321, 7.7, 37.02}) {
    const std::vector<Score> scores = scan(planted(clean(), kGyro, [&](double t_s, double) {
      return amplitude_dps * std::sin(2.0 * kPi * frequency_hz * t_s + 1.0);
    }));
    ASSERT_FALSE(scores.empty());
    const Effect& first = scores.front().effect;
    EXPECT_EQ(first.kind, Kind::kLine) << frequency_hz << text_of(scores);
    EXPECT_NEAR(first.parameters[0], frequency_hz, step_hz);
    EXPECT_NEAR(first.parameters[1], amplitude_dps, kSigmas * sigma);
    // Less what is lost between two frequencies: sinc² of a quarter of a turn at most.
    EXPECT_NEAR(std::sqrt(scores.front().statistic), kPlantedSigmas, kSigmas);
  }
}

TEST_F(ScanTest, PlacesAStepAsWellAsTheNoiseLets) {
  constexpr double kSize_dps = 0.01;
  const double white = making().white_dps_rthz[kGyro];
  // Of a step the instant scatters on this scale, with tails of exp(−t/8) of it.
  const double scale_s = std::pow(white / kSize_dps, 2);
  constexpr double kResolution_s = 0.02;
  for (const double at_s : {41.37, 77.0}) {
    const auto data =
        planted(clean(), kGyro, [&](double t_s, double) { return t_s >= at_s ? -kSize_dps : 0.0; });
    const Regression regression(data, noise_effects(making()), Part::kAll);
    const Fit null{{}, regression.known_noise(), 0.0, {}};
    const Scan scan(regression, {});
    const std::vector<Score> scores = scan.scores(null, null.noise);
    ASSERT_FALSE(scores.empty());
    ASSERT_EQ(scores.front().effect.kind, Kind::kBiasStep) << text_of(scores);
    const Effect step = placed(regression, null, scores.front().effect);
    EXPECT_NEAR(step.parameters[1], at_s, 60.0 * scale_s + kResolution_s);
    // By the seconds that the drift leaves of both sides: some N/K.
    const double reach_s = std::min(at_s, white / making().walk_dps_rts[kGyro]);
    EXPECT_NEAR(step.parameters[0], -kSize_dps, 2.0 * kSigmas * white / std::sqrt(reach_s));
  }
}

TEST_F(ScanTest, LooksPastWhatIsFittedAnyway) {
  const std::vector<Shape> shapes = shapes_of(making());
  const auto shape_of = [&](Kind kind) {
    return *std::find_if(shapes.begin(), shapes.end(),
                         [&](const Shape& one) { return one.kind == kind; });
  };
  const Shape asymmetry = shape_of(Kind::kScaleFactorAsymmetry);
  const double size = kPlantedSigmas * DenseErrors(making()).sigma(asymmetry);
  constexpr double kScale = 0.01;
  const auto data = planted(clean(), kGyro, [&](double, double rate_dps) {
    return kScale * rate_dps + size * std::abs(rate_dps);
  });
  const std::vector<Score> alone = scan(data);
  ASSERT_FALSE(alone.empty());
  EXPECT_EQ(alone.front().effect.kind, Kind::kScaleFactor);
  const std::vector<Score> beside = scan(data, {{kGyro, Kind::kScaleFactor, {0.0}, 0}});
  ASSERT_FALSE(beside.empty());
  EXPECT_EQ(beside.front().effect.kind, Kind::kScaleFactorAsymmetry) << text_of(beside);
  EXPECT_NEAR(beside.front().effect.parameters[0], size, kSigmas * size / kPlantedSigmas);
  // A shape has nothing left of its own beside itself.
  EXPECT_EQ(find(beside, Kind::kScaleFactor), nullptr);
}

// A delay of two samples is known: the scale factor is one of the rate that comes late.
TEST_F(ScanTest, SeesAResponseToTheRateThatIsKnownToComeLate) {
  constexpr double kDelay_s = 0.02;
  const Making the_making = making();
  const double sigma =
      DenseErrors(the_making).sigma({Kind::kScaleFactor, 0, {}, [&](double t_s, double) {
                                       return true_rate_dps(the_making, t_s - kDelay_s);
                                     }});
  const double size = kPlantedSigmas * sigma;
  const auto data = planted(clean(), kGyro, [&](double t_s, double rate_dps) {
    return (1.0 + size) * true_rate_dps(the_making, t_s - kDelay_s) - rate_dps;
  });
  const std::vector<Score> scores = scan(data, {}, {{kGyro, Kind::kDelay, {kDelay_s}, 0}});
  ASSERT_FALSE(scores.empty());
  EXPECT_EQ(scores.front().effect.kind, Kind::kScaleFactor) << text_of(scores);
  EXPECT_NEAR(scores.front().effect.parameters[0], size, kSigmas * sigma);
}

TEST_F(ScanTest, ProposesNoMoreOfWhatComesInPieces) {
  const auto data = planted(clean(), kGyro, [](double t_s, double) {
    return (t_s > 35.0 ? 0.01 : 0.0) - (t_s > 50.0 ? 0.02 : 0.0) + (t_s > 70.0 ? 0.03 : 0.0) -
           (t_s > 95.0 ? 0.01 : 0.0) + 0.01 * std::sin(2.0 * kPi * 11.0 * t_s);
  });
  const Effects steps{{kGyro, Kind::kBiasStep, {0.01, 35.0}, 0},
                      {kGyro, Kind::kBiasStep, {0.01, 50.0}, 0},
                      {kGyro, Kind::kBiasStep, {0.01, 70.0}, 0}};
  const std::vector<Score> two = scan(data, {steps[0], steps[1]});
  EXPECT_NE(find(two, Kind::kBiasStep), nullptr);
  const std::vector<Score> three = scan(data, steps);
  EXPECT_EQ(find(three, Kind::kBiasStep), nullptr);
  EXPECT_NE(find(three, Kind::kLine), nullptr);
}

// The same statistic that is 144 on average where something is planted is χ² of one degree of
// freedom where nothing is: what a threshold means rests on this.
TEST(Scan, StatisticOfNoiseAloneIsChiSquare) {
  constexpr int kSeeds = 40;
  Making making = making_of(52, 60.0, 20.0);
  making.interval_s = 0.02;
  const MadeStudy made(making);
  ASSERT_NE(made.study(), nullptr);
  const std::vector<Kind> kinds{Kind::kBias,
                                Kind::kBiasRamp,
                                Kind::kScaleFactor,
                                Kind::kScaleFactorAsymmetry,
                                Kind::kScaleFactorCubic,
                                Kind::kDelay};
  std::vector<double> sums(kinds.size(), 0.0);
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    auto data = std::make_shared<Observations>(*made.observations(kGyro));
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    double walk_dps = 0.0;
    for (double& value : data->observed_dps) {
      walk_dps += making.walk_dps_rts[kGyro] * std::sqrt(making.interval_s) * normal(random);
      value =
          walk_dps + making.white_dps_rthz[kGyro] / std::sqrt(making.interval_s) * normal(random);
    }
    const Regression regression(data, noise_effects(making), Part::kFit);
    const Fit null{{}, regression.known_noise(), 0.0, {}};
    const std::vector<Score> scores = Scan(regression, {}).scores(null, null.noise);
    EXPECT_LT(scores.front().adjusted(), kNameNeeds) << "seed " << seed << text_of(scores);
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      const Score* const score = find(scores, kinds[i]);
      ASSERT_NE(score, nullptr);
      sums[i] += score->statistic;
    }
  }
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    EXPECT_NEAR(sums[i] / kSeeds, 1.0, kSigmas * std::sqrt(2.0 / kSeeds))
        << model::info(kinds[i]).name << ", seeds 1 to " << kSeeds;
  }
}

// At rest, without thermometer and accelerometer: biases, steps and lines are all that can be seen.
TEST(Scan, ProposesNothingThatTheRecordingCouldNotShow) {
  Making making = making_of(53, 60.0, 60.0);
  const MadeStudy made(making);
  ASSERT_NE(made.study(), nullptr);
  const Regression regression(made.observations(1), noise_effects(making), Part::kAll);
  const Fit null{{}, regression.known_noise(), 0.0, {}};
  const std::vector<Score> scores = Scan(regression, {}).scores(null, null.noise);
  ASSERT_FALSE(scores.empty());
  for (const Score& score : scores) {
    EXPECT_EQ(score.effect.gyro, 1U);
    const Kind kind = score.effect.kind;
    EXPECT_TRUE(kind == Kind::kBias || kind == Kind::kBiasRamp || kind == Kind::kWarmUp ||
                kind == Kind::kBiasStep || kind == Kind::kLine || kind == Kind::kRunIn)
        << text_of(score);
    // What dies away later than the recording ends cannot be told from a bias.
    if (kind == Kind::kWarmUp) {
      EXPECT_LT(score.effect.parameters[1], making.seconds);
    }
  }
  EXPECT_FALSE(could_show(regression.data(), {0, Kind::kBias, {1.0}, 0}));
  EXPECT_TRUE(could_show(regression.data(), {1, Kind::kBias, {1.0}, 0}));
  EXPECT_FALSE(could_show(regression.data(), {1, Kind::kWarmUp, {1.0, 60.0}, 0}));
  EXPECT_TRUE(could_show(regression.data(), {1, Kind::kWarmUp, {1.0, 59.0}, 0}));
  // A logarithm that hardly bends is a ramp.
  EXPECT_FALSE(could_show(regression.data(), {1, Kind::kRunIn, {1.0, 6.1}, 0}));
  EXPECT_TRUE(could_show(regression.data(), {1, Kind::kRunIn, {1.0, 5.9}, 0}));
}

TEST(Scan, StepsAreDistinctWhereABlockLiesBetweenThem) {
  Layout layout;
  for (const double t_s : {3.5, 1.0, 2.0}) {  // blocks of two channels need not rise
    layout.blocks.emplace_back();
    layout.blocks.back().t_s = t_s;
  }
  // A step at a block's instant is before it; one beyond the last block would show nothing.
  EXPECT_EQ(distinct_steps(layout, {0.5, 1.0, 1.5, 1.7, 2.0, 2.5, 3.6, 4.0}),
            (std::vector<double>{1.5, 2.5, 3.6}));
  EXPECT_TRUE(distinct_steps(Layout{}, {1.0, 2.0}).empty());
  EXPECT_TRUE(distinct_steps(layout, {}).empty());
}

}  // namespace
}  // namespace vgyro::gap
