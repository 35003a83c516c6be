// Compares the drift filter with plain mathematics: the covariance of a walk's means in closed
// form, a differential equation integrated step by step, and a filter at full rate.

#include "fusion/drift_filter.h"

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "tests/fusion/random.h"
#include "tests/fusion/world.h"

namespace vgyro::fusion {
namespace {

using Observables = DriftFilter::Observables;
using Covariance = DriftFilter::Covariance;

constexpr double kHour_s = 3600.0;

Covariance prior(double bias_sigma) {
  Covariance covariance = Covariance::Zero();
  covariance(kBias1, kBias1) = covariance(kBias2, kBias2) = bias_sigma * bias_sigma;
  covariance(kScale, kScale) = 1e-4;
  covariance(kSkew, kSkew) = 4e-4;
  return covariance;
}

DriftMeasurement stop(const std::array<double, 2>& white, double length_s, Random& random) {
  DriftMeasurement measurement(2);
  measurement.rows(0, kBias1) = measurement.rows(1, kBias2) = 1.0;
  for (int gyro = 0; gyro < 2; ++gyro) {
    const double sigma = white[static_cast<std::size_t>(gyro)] / std::sqrt(length_s);
    measurement.noise(gyro, gyro) = sigma * sigma;
    measurement.values(gyro) = random.normal(sigma);
  }
  return measurement;
}

/// `rows` of y₁ − y₂, at as many rates and derivatives.
DriftMeasurement difference(int rows, const std::array<double, 2>& white, double length_s,
                            Random& random) {
  DriftMeasurement measurement(rows);
  const double variance = (white[0] * white[0] + white[1] * white[1]) / length_s;
  for (int row = 0; row < rows; ++row) {
    measurement.rows(row, kBias1) = 1.0;
    measurement.rows(row, kBias2) = -1.0;
    if (row > 0) measurement.rows(row, kScale) = random.uniform(-300.0, 300.0);
    if (row > 1) measurement.rows(row, kSkew) = random.uniform(-100.0, 100.0);
    measurement.noise(row, row) = variance;
    measurement.values(row) = random.normal(std::sqrt(variance));
  }
  return measurement;
}

struct Sensors {
  const char* name;
  std::array<double, 2> white;
  std::array<double, 2> walk;
  std::vector<std::pair<std::size_t, GaussMarkov>> terms;
  SlopeModel slopes = {};
  std::array<double, 2> temperature_dps_k = {};
};

DriftModel model_of(const Sensors& sensors) {
  DriftModel model;
  model.walk_dps_rts = sensors.walk;
  model.slopes = sensors.slopes;
  model.temperature_dps_k = sensors.temperature_dps_k;
  for (const auto& [gyro, term] : sensors.terms)
    model.gauss_markov[gyro][model.gauss_markov_count[gyro]++] = term;
  return model;
}

constexpr SlopeModel kWarm{.begin_dps_s = {1e-3, 2e-3},
                           .steady_dps_s = {2e-5, 4e-5},
                           .tau_s = 100.0,
                           .correlation = 0.0,
                           .relative = 0.3};
constexpr SlopeModel kAlike{.begin_dps_s = {0.0, 0.0},
                            .steady_dps_s = {1e-4, 1e-4},
                            .tau_s = 300.0,
                            .correlation = 0.98,
                            .relative = 0.0};

// A hundred hours of everything that can come: the covariance stays symmetric and positive.
TEST(DriftFilter, KeepsASoundCovarianceForAHundredHours) {
  const std::vector<Sensors> all{
      {"two MEMS", {3e-3, 4e-3}, {2e-5, 3e-5}, {}},
      {"the best beside the worst", {1e-6, 1e-1}, {1e-10, 1e-3}, {}},
      {"no drift", {1e-6, 1e-1}, {0.0, 0.0}, {}},
      {"one drifts", {1e-4, 1e-4}, {0.0, 1e-3}, {}},
      {"drifts more than noise", {1e-6, 1e-6}, {1e-2, 1e-2}, {}},
      {"Gauss–Markov",
       {1e-3, 2e-3},
       {1e-6, 0.0},
       {{0, {3e-3, 100.0}}, {0, {1e-3, 1e4}}, {1, {5e-3, 30.0}}, {1, {1e-2, 1e6}}}},
      {"slopes", {3e-3, 4e-3}, {2e-5, 3e-5}, {}, kWarm},
      {"slopes alike", {1e-6, 1e-1}, {1e-10, 1e-3}, {}, kAlike},
      {"slopes of no drift", {1e-3, 1e-3}, {0.0, 0.0}, {}, kWarm},
      {"temperatures", {3e-3, 4e-3}, {2e-5, 3e-5}, {}, {}, {5e-3, 1e-2}},
      {"the temperature of one", {1e-6, 1e-1}, {1e-10, 1e-3}, {}, {}, {0.0, 0.1}},
      {"slopes and temperatures", {3e-3, 4e-3}, {2e-5, 3e-5}, {}, kAlike, {5e-3, 1e-2}},
      {"all of it",
       {1e-3, 2e-3},
       {1e-6, 0.0},
       {{0, {3e-3, 100.0}}, {1, {5e-3, 30.0}}},
       kWarm,
       {5e-3, 1e-2}},
  };
  for (const Sensors& sensors : all) {
    constexpr std::uint64_t kSeed = 11;
    SCOPED_TRACE(::testing::Message() << sensors.name << ", seed " << kSeed);
    Random random(kSeed);
    DriftFilter filter(model_of(sensors), Observables::Zero(), prior(1.0));
    double hours = 0.0;
    while (hours < 100.0) {
      const double length = random.below(20) == 0 ? 0.01 : random.uniform(1.0, 60.0);
      double likelihood = 0.0;
      switch (random.below(8)) {
        case 0: {
          const double gap = random.below(10) == 0 ? kHour_s : 30.0;
          filter.predict(gap);
          hours += gap / kHour_s;
          break;
        }
        case 1:
        case 2:
          likelihood = filter.update(length, stop(sensors.white, length, random));
          break;
        case 3:
          if (random.below(50) == 0) filter.widen(1e-2, 1e-2, 1e-2);
          if (random.below(50) == 0) filter.shift(random.below(2), random.normal(0.1), 1e-3);
          filter.set_temperature({random.uniform(-40.0, 60.0), random.uniform(-40.0, 60.0)});
          break;
        default: {
          const int rows = 1 + static_cast<int>(random.below(3));
          likelihood = filter.update(length, difference(rows, sensors.white, length, random));
        }
      }
      hours += length / kHour_s;
      const Covariance p = filter.covariance();
      ASSERT_TRUE(p.allFinite() && filter.mean().allFinite() && std::isfinite(likelihood)) << hours;
      ASSERT_TRUE((p.diagonal().array() > 0.0).all()) << hours << " h\n" << p;
      const Observables unit = p.diagonal().cwiseSqrt().cwiseInverse();
      const Covariance correlation = unit.asDiagonal() * p * unit.asDiagonal();
      ASSERT_LT((correlation - correlation.transpose()).norm(), 1e-12) << hours << " h\n" << p;
      ASSERT_EQ(Eigen::LLT<Covariance>(correlation).info(), Eigen::Success) << hours << " h\n" << p;
    }
  }
}

// The means of a random walk over windows have a covariance in closed form; the filter's
// likelihoods multiply to the density of all means together.
TEST(DriftFilter, FindsTheLikelihoodThatAllWindowsHaveTogether) {
  constexpr int kWindows = 40;
  constexpr double kWalk = 2e-3;
  constexpr double kStart = 0.3;
  constexpr std::uint64_t kSeed = 5;
  Random random(kSeed);
  DriftModel model;
  model.walk_dps_rts = {kWalk, 0.0};
  DriftFilter filter(model, Observables::Zero(), prior(kStart));

  Eigen::VectorXd values(kWindows);
  Eigen::VectorXd middle(kWindows);
  Eigen::MatrixXd joint(kWindows, kWindows);
  Eigen::VectorXd with_end(kWindows);
  double t = 0.0;
  double sum = 0.0;
  for (int i = 0; i < kWindows; ++i) {
    const double length = random.uniform(0.5, 20.0);
    DriftMeasurement measurement(1);
    measurement.rows(0, kBias1) = 1.0;
    measurement.noise(0, 0) = 1e-4 / length;
    values(i) = measurement.values(0) = random.normal(0.1);
    sum += filter.update(length, measurement);
    // Cov(mean over i, anything later) = P₀ + K² · middle of i; within a window K²·T/3, not T/2.
    middle(i) = t + 0.5 * length;
    for (int j = 0; j < i; ++j)
      joint(i, j) = joint(j, i) = kStart * kStart + kWalk * kWalk * middle(j);
    joint(i, i) = kStart * kStart + kWalk * kWalk * (t + length / 3.0) + 1e-4 / length;
    with_end(i) = kStart * kStart + kWalk * kWalk * middle(i);
    t += length;
    if (i % 7 != 3) continue;
    filter.predict(50.0);
    t += 50.0;
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(joint);
  const double log_determinant = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  const double expected = -0.5 * values.dot(factor.solve(values)) - 0.5 * log_determinant;
  EXPECT_NEAR(sum, expected, 1e-9 * std::abs(expected));
  // The estimate at the end is the regression on all of them.
  EXPECT_NEAR(filter.mean()(kBias1), with_end.dot(factor.solve(values)), 1e-9 * kStart);
  const double variance =
      kStart * kStart + kWalk * kWalk * t - with_end.dot(factor.solve(with_end));
  EXPECT_NEAR(filter.covariance()(kBias1, kBias1), variance, 1e-9 * variance);
}

/// The same model as a differential equation: the states, and the integral of each gyro's drift
/// since the window began, integrated by the Runge–Kutta method.
class PlainFilter {
 public:
  static constexpr int kStates = 6;  // walk 1, walk 2, term 1, term 2, ∫B₁, ∫B₂
  using Matrix = Eigen::Matrix<double, kStates, kStates>;
  using Vector = Eigen::Matrix<double, kStates, 1>;

  PlainFilter(const std::array<double, 2>& walk, const std::array<GaussMarkov, 2>& terms,
              double bias_sigma) {
    for (int k = 0; k < 2; ++k) {
      const auto gyro = static_cast<std::size_t>(k);
      const GaussMarkov& term = terms[gyro];
      flow_(2 + k, 2 + k) = -1.0 / term.tau_s;
      flow_(4 + k, k) = flow_(4 + k, 2 + k) = 1.0;
      drive_(k, k) = walk[gyro] * walk[gyro];
      drive_(2 + k, 2 + k) = 2.0 * term.sigma_dps * term.sigma_dps / term.tau_s;
      // The whole drift was measured: the walk is that less the term.
      const double square = term.sigma_dps * term.sigma_dps;
      p_(k, k) = bias_sigma * bias_sigma + square;
      p_(2 + k, 2 + k) = square;
      p_(k, 2 + k) = p_(2 + k, k) = -square;
    }
  }
  void pass(double length_s) {
    p_.bottomRows<2>().setZero();
    p_.rightCols<2>().setZero();
    x_.tail<2>().setZero();
    constexpr int kSteps = 400;
    const double h = length_s / kSteps;
    const auto slope = [this](const Matrix& p) -> Matrix {
      return flow_ * p + p * flow_.transpose() + drive_;
    };
    for (int i = 0; i < kSteps; ++i) {
      const Matrix a = slope(p_);
      const Matrix b = slope(p_ + 0.5 * h * a);
      const Matrix c = slope(p_ + 0.5 * h * b);
      const Matrix d = slope(p_ + h * c);
      p_ += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
      const Vector e = flow_ * x_;
      const Vector f = flow_ * (x_ + 0.5 * h * e);
      const Vector g = flow_ * (x_ + 0.5 * h * f);
      const Vector j = flow_ * (x_ + h * g);
      x_ += h / 6.0 * (e + 2.0 * f + 2.0 * g + j);
    }
  }
  /// The measured value of h₁·mean of B₁ + h₂·mean of B₂ was `value`.
  void learn(double length_s, double h1, double h2, double value, double noise) {
    Vector h = Vector::Zero();
    h(4) = h1 / length_s;
    h(5) = h2 / length_s;
    const Vector cross = p_ * h;
    const double square = h.dot(cross) + noise;
    x_ += cross * ((value - h.dot(x_)) / square);
    p_ -= cross * cross.transpose() / square;
  }
  [[nodiscard]] double bias(int k) const { return x_(k) + x_(2 + k); }
  [[nodiscard]] double covariance(int i, int k) const {
    return p_(i, k) + p_(i, 2 + k) + p_(2 + i, k) + p_(2 + i, 2 + k);
  }

 private:
  Matrix flow_ = Matrix::Zero();
  Matrix drive_ = Matrix::Zero();
  Matrix p_ = Matrix::Zero();
  Vector x_ = Vector::Zero();
};

// Walks and Gauss–Markov terms, in windows that are short and long relative to their correlation
// time. In a window below a thousandth of it, the term is treated as a walk: hence 1e-5.
TEST(DriftFilter, TreatsTheMeanOverAWindowExactly) {
  constexpr std::array<double, 2> kWalk{2e-4, 5e-5};
  constexpr std::array<GaussMarkov, 2> kTerms{GaussMarkov{4e-3, 40.0}, GaussMarkov{1e-3, 900.0}};
  constexpr double kBiasSigma = 0.05;
  constexpr std::uint64_t kSeed = 8;
  Random random(kSeed);
  DriftModel model;
  model.walk_dps_rts = kWalk;
  for (std::size_t k = 0; k < 2; ++k) {
    model.gauss_markov[k][0] = kTerms[k];
    model.gauss_markov_count[k] = 1;
  }
  DriftFilter filter(model, Observables::Zero(), prior(kBiasSigma));
  PlainFilter plain(kWalk, kTerms, kBiasSigma);
  constexpr std::array<double, 2> kWhite{1e-3, 2e-3};
  for (int i = 0; i < 120; ++i) {
    const double length = i % 10 == 0 ? 200.0 : random.uniform(0.5, 20.0);
    plain.pass(length);
    if (i % 5 == 0) {
      filter.predict(length);
    } else if (i % 3 == 0) {
      const DriftMeasurement measurement = stop(kWhite, length, random);
      filter.update(length, measurement);
      plain.learn(length, 1.0, 0.0, measurement.values(0), measurement.noise(0, 0));
      plain.learn(length, 0.0, 1.0, measurement.values(1), measurement.noise(1, 1));
    } else {
      const DriftMeasurement measurement = difference(1, kWhite, length, random);
      filter.update(length, measurement);
      plain.learn(length, 1.0, -1.0, measurement.values(0), measurement.noise(0, 0));
    }
    const Covariance p = filter.covariance();
    for (int gyro = 0; gyro < 2; ++gyro) {
      const double sigma = std::sqrt(plain.covariance(gyro, gyro));
      ASSERT_NEAR(filter.mean()(gyro), plain.bias(gyro), 1e-5 * sigma) << "window " << i;
      for (int other = 0; other < 2; ++other) {
        const double scale = sigma * std::sqrt(plain.covariance(other, other));
        ASSERT_NEAR(p(gyro, other), plain.covariance(gyro, other), 1e-5 * scale) << "window " << i;
      }
    }
  }
}

/// Drifts with slopes and temperature coefficients as a differential equation, integrated in the
/// same way. The temperature is constant within a window.
class PlainSlopes {
 public:
  static constexpr int kStates = 8;  // walks, slopes, coefficients, ∫B₁, ∫B₂
  using Matrix = Eigen::Matrix<double, kStates, kStates>;
  using Vector = Eigen::Matrix<double, kStates, 1>;

  PlainSlopes(const DriftModel& model, double bias_sigma) {
    const SlopeModel& slopes = model.slopes;
    for (int k = 0; k < 2; ++k) {
      const auto gyro = static_cast<std::size_t>(k);
      flow_(k, 2 + k) = 1.0;
      flow_(2 + k, 2 + k) = -1.0 / slopes.tau_s;
      flow_(6 + k, k) = 1.0;
      drive_(k, k) = std::pow(model.walk_dps_rts[gyro], 2.0);
      p_(k, k) = bias_sigma * bias_sigma;
      p_(2 + k, 2 + k) = std::pow(slopes.begin_dps_s[gyro], 2.0);
      p_(4 + k, 4 + k) = std::pow(model.temperature_dps_k[gyro], 2.0);
      for (int j = 0; j < 2; ++j) {
        drive_(2 + k, 2 + j) = 2.0 / slopes.tau_s * slopes.steady_dps_s[gyro] *
                               slopes.steady_dps_s[static_cast<std::size_t>(j)] *
                               (k == j ? 1.0 : slopes.correlation);
      }
    }
  }
  void set_temperature(const std::array<double, 2>& away_k) {
    for (int k = 0; k < 2; ++k)
      flow_(6 + k, 4 + k) = away_k_[static_cast<std::size_t>(k)] =
          away_k[static_cast<std::size_t>(k)];
  }
  void pass(double length_s) {
    p_.bottomRows<2>().setZero();
    p_.rightCols<2>().setZero();
    x_.tail<2>().setZero();
    constexpr int kSteps = 200;
    const double h = length_s / kSteps;
    const auto slope = [this](const Matrix& p) -> Matrix {
      return flow_ * p + p * flow_.transpose() + drive_;
    };
    for (int i = 0; i < kSteps; ++i) {
      const Matrix a = slope(p_);
      const Matrix b = slope(p_ + 0.5 * h * a);
      const Matrix c = slope(p_ + 0.5 * h * b);
      const Matrix d = slope(p_ + h * c);
      p_ += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
      const Vector e = flow_ * x_;
      const Vector f = flow_ * (x_ + 0.5 * h * e);
      const Vector g = flow_ * (x_ + 0.5 * h * f);
      const Vector j = flow_ * (x_ + h * g);
      x_ += h / 6.0 * (e + 2.0 * f + 2.0 * g + j);
    }
  }
  void learn(double length_s, double h1, double h2, double value, double noise) {
    Vector h = Vector::Zero();
    h(6) = h1 / length_s;
    h(7) = h2 / length_s;
    const Vector cross = p_ * h;
    const double square = h.dot(cross) + noise;
    x_ += cross * ((value - h.dot(x_)) / square);
    p_ -= cross * cross.transpose() / square;
  }
  /// Row k: the whole drift of gyro k; 2 + k: its slope; 4 + k: its coefficient.
  [[nodiscard]] double mean(int i) const { return row(i).dot(x_); }
  [[nodiscard]] double covariance(int i, int j) const { return row(i).dot(p_ * row(j)); }

 private:
  [[nodiscard]] Vector row(int i) const {
    Vector made = Vector::Zero();
    made(i) = 1.0;
    if (i < 2) made(4 + i) = away_k_[static_cast<std::size_t>(i)];
    return made;
  }

  Matrix flow_ = Matrix::Zero();
  Matrix drive_ = Matrix::Zero();
  Matrix p_ = Matrix::Zero();
  Vector x_ = Vector::Zero();
  std::array<double, 2> away_k_{};
};

/// Drift, slope and coefficient of a filter, in the numbering of PlainSlopes.
void expect_same(const DriftFilter& filter, const PlainSlopes& plain, double tolerance,
                 int window) {
  const DriftFilter::Slopes slopes = filter.slopes();
  const Covariance p = filter.covariance();
  for (int k = 0; k < 2; ++k) {
    const double sigma = std::sqrt(plain.covariance(k, k));
    const double slope_sigma = std::sqrt(plain.covariance(2 + k, 2 + k));
    ASSERT_NEAR(filter.mean()(k), plain.mean(k), tolerance * sigma) << "window " << window;
    ASSERT_NEAR(slopes.mean(k), plain.mean(2 + k), tolerance * slope_sigma) << "window " << window;
    const auto [mean, variance] = filter.coefficient(static_cast<std::size_t>(k));
    ASSERT_NEAR(mean, plain.mean(4 + k), tolerance * std::sqrt(variance)) << "window " << window;
    ASSERT_NEAR(variance, plain.covariance(4 + k, 4 + k), tolerance * variance)
        << "window " << window;
    for (int j = 0; j < 2; ++j) {
      const double other = std::sqrt(plain.covariance(j, j));
      const double other_slope = std::sqrt(plain.covariance(2 + j, 2 + j));
      ASSERT_NEAR(p(k, j), plain.covariance(k, j), tolerance * sigma * other)
          << "window " << window;
      ASSERT_NEAR(slopes.covariance(k, j), plain.covariance(2 + k, 2 + j),
                  tolerance * slope_sigma * other_slope)
          << "window " << window;
      ASSERT_NEAR(slopes.with_drift(k, j), plain.covariance(k, 2 + j),
                  tolerance * sigma * other_slope)
          << "window " << window;
    }
  }
}

// Slopes that begin uncertain and slopes that come and go, independent and alike, in windows that
// are short and long relative to their time constant, with temperatures that change in between.
// Constant slopes are treated exactly. The part of a slope's own walk in the mean drift is
// approximated by half of that at the window's end: hence a share of the variance, smaller for
// shorter windows.
TEST(DriftFilter, TreatsSlopesAndTemperaturesExactlyButForTheSlopesOwnWalk) {
  struct Case {
    const char* name;
    SlopeModel slopes;
    double longest_s;
    double tolerance;
  };
  SlopeModel dying = kWarm;
  dying.relative = 0.0;  // a walk that grows with the slope is not a linear equation
  const SlopeModel warm = dying;
  dying.steady_dps_s = {};
  constexpr double kWindow_s = 10.0;
  const std::array<Case, 4> cases{{{"dying away", dying, 200.0, 1e-5},
                                   {"warming up", warm, 200.0, 0.1},
                                   {"alike", kAlike, 200.0, 0.1},
                                   {"alike, in windows as they are", kAlike, kWindow_s, 0.03}}};
  constexpr double kBiasSigma = 0.05;
  for (const Case& which : cases) {
    constexpr std::uint64_t kSeed = 9;
    SCOPED_TRACE(::testing::Message() << which.name << ", seed " << kSeed);
    Random random(kSeed);
    DriftModel model;
    model.walk_dps_rts = {2e-4, 5e-5};
    model.slopes = which.slopes;
    model.temperature_dps_k = {5e-3, 1e-2};
    DriftFilter filter(model, Observables::Zero(), prior(kBiasSigma));
    PlainSlopes plain(model, kBiasSigma);
    constexpr std::array<double, 2> kWhite{1e-3, 2e-3};
    for (int i = 0; i < 120; ++i) {
      const double length =
          i % 10 == 0 ? which.longest_s : random.uniform(0.05, std::min(which.longest_s, 20.0));
      if (i % 4 == 1) {
        const std::array<double, 2> away_k{random.uniform(-20.0, 40.0),
                                           random.uniform(-20.0, 40.0)};
        filter.set_temperature(away_k);
        plain.set_temperature(away_k);
      }
      plain.pass(length);
      if (i % 5 == 0) {
        filter.predict(length);
      } else if (i % 3 == 0) {
        const DriftMeasurement measurement = stop(kWhite, length, random);
        filter.update(length, measurement);
        plain.learn(length, 1.0, 0.0, measurement.values(0), measurement.noise(0, 0));
        plain.learn(length, 0.0, 1.0, measurement.values(1), measurement.noise(1, 1));
      } else {
        const DriftMeasurement measurement = difference(1, kWhite, length, random);
        filter.update(length, measurement);
        plain.learn(length, 1.0, -1.0, measurement.values(0), measurement.noise(0, 0));
      }
      expect_same(filter, plain, which.tolerance, i);
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
}

// A prediction in two halves equals one over the whole, with any slopes.
TEST(DriftFilter, PredictsTheSameInPieces) {
  for (SlopeModel slopes : {kWarm, kAlike}) {
    slopes.relative = 0.0;
    DriftModel model;
    model.walk_dps_rts = {2e-4, 5e-5};
    model.slopes = slopes;
    DriftFilter whole(model, Observables::Zero(), prior(0.05));
    whole.set_slopes({1e-3, -2e-3}, Eigen::Matrix2d::Identity() * 1e-7);
    DriftFilter pieces = whole;
    whole.predict(1000.0);
    for (int i = 0; i < 4000; ++i)
      pieces.predict(0.25);
    for (int k = 0; k < 2; ++k) {
      EXPECT_NEAR(pieces.mean()(k) / whole.mean()(k), 1.0, 1e-9);
      EXPECT_NEAR(pieces.covariance()(k, k) / whole.covariance()(k, k), 1.0, 1e-6);
      EXPECT_NEAR(pieces.slopes().with_drift(k, k) / whole.slopes().with_drift(k, k), 1.0, 1e-6);
    }
    // ∫ r·exp(−t/τ): a slope that fades changes its drift by r·τ in all.
    const double all = slopes.tau_s * -std::expm1(-1000.0 / slopes.tau_s);
    EXPECT_NEAR(whole.mean()(0), 1e-3 * all, 1e-12);
    EXPECT_NEAR(whole.mean()(1), -2e-3 * all, 1e-12);
  }
}

struct Comparison {
  double mean_in_sigmas = 0.0;  ///< greatest difference of the two filters' biases
  double variance = 0.0;        ///< greatest relative difference
};

/// Means over 10 s compared with 50 samples a second: ten windows of stop, then the difference
/// alone.
Comparison against_full_rate(const std::array<double, 2>& walk, std::uint64_t seed) {
  constexpr std::array<double, 2> kWhite{1e-3, 2e-3};
  constexpr double kWindow_s = 10.0;
  constexpr int kSamples = 500;
  const std::array<world::Gyro, 2> gyros{world::Gyro{kWhite[0], walk[0], 0.05},
                                         world::Gyro{kWhite[1], walk[1], -0.08}};
  world::World world(gyros, kSamples / kWindow_s, seed);
  world::Bound bound(gyros, world.step_s());
  DriftModel model;
  model.walk_dps_rts = walk;
  DriftFilter filter(model, Observables::Zero(), prior(1.0));
  Random unused(seed);
  Comparison worst;
  for (int window = 0; window < 60; ++window) {
    const bool stopped = window < 10;
    std::array<double, 2> mean{};
    for (int i = 0; i < kSamples; ++i) {
      const world::Instant now = world.next([](double /*t_s*/) { return 0.0; }, stopped);
      bound.update(now, 0.0);
      for (std::size_t k = 0; k < 2; ++k)
        mean[k] += now.reading_dps[k] / kSamples;
    }
    DriftMeasurement measurement =
        stopped ? stop(kWhite, kWindow_s, unused) : difference(1, kWhite, kWindow_s, unused);
    measurement.values(0) = stopped ? mean[0] : mean[0] - mean[1];
    if (stopped) measurement.values(1) = mean[1];
    filter.update(kWindow_s, measurement);
    for (std::size_t k = 0; k < 2; ++k) {
      const auto row = static_cast<int>(k);
      const double variance = bound.p_[2 * k];
      const double away = filter.mean()(row) - bound.b_[k];
      worst.mean_in_sigmas = std::max(worst.mean_in_sigmas, std::abs(away) / std::sqrt(variance));
      worst.variance =
          std::max(worst.variance, std::abs(filter.covariance()(row, row) / variance - 1.0));
    }
  }
  return worst;
}

// Without drift a mean contains all information of its samples: the two filters agree.
TEST(DriftFilter, IsTheFilterAtFullRateWhereNothingDrifts) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Comparison worst = against_full_rate({0.0, 0.0}, seed);
    EXPECT_LT(worst.mean_in_sigmas, 1e-9) << "seed " << seed;
    EXPECT_LT(worst.variance, 1e-9) << "seed " << seed;
  }
}

// With drift of the size that a window of 10 s is made for, the mean loses hardly anything.
TEST(DriftFilter, LosesLittleToTheFilterAtFullRate) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Comparison worst = against_full_rate({1e-5, 2e-5}, seed);
    EXPECT_LT(worst.mean_in_sigmas, 0.1) << "seed " << seed;
    EXPECT_LT(worst.variance, 0.01) << "seed " << seed;
  }
}

}  // namespace
}  // namespace vgyro::fusion
