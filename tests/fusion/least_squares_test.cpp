#include "fusion/least_squares.h"

#include <limits>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

Polynomial random_polynomial(Random& random, int order, double from_s, double width_s) {
  Polynomial p{.centre_s = from_s + 0.5 * width_s, .half_width_s = 0.5 * width_s};
  for (int i = 0; i <= order; ++i)
    p.coefficient[static_cast<std::size_t>(i)] = random.uniform(-1.0, 1.0);
  return p;
}

// A polynomial of the fit's order is recovered without loss of digits to large time stamps or
// uneven sampling. The moments of order 3 have a condition number near 100 on a full window.
TEST(LeastSquares, IsExactOnPolynomialsOfItsOrder) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    for (const double from_s : {0.0, 1234.5, 1e8}) {
      for (int order = 0; order <= kOrderMax; ++order) {
        SCOPED_TRACE(::testing::Message()
                     << "seed " << seed << " from " << from_s << " order " << order);
        Random random(seed);
        const double width_s = random.uniform(1.0, 100.0);
        const Polynomial truth = random_polynomial(random, order, from_s, width_s);
        LeastSquares window(order, from_s, width_s);
        for (int i = 0; i < 200; ++i) {
          const double t_s = from_s + width_s * (i + random.uniform(0.0, 0.9)) / 200.0;
          window.add(t_s, truth.at(t_s));
        }
        const auto fit = window.fit();
        ASSERT_TRUE(fit);
        for (double share = 0.0; share <= 1.0; share += 0.125) {
          const double t_s = from_s + share * width_s;
          ASSERT_NEAR(fit->polynomial.at(t_s), truth.at(t_s), 256 * kEpsilon) << share;
        }
        EXPECT_LT(fit->residual_variance, 256 * kEpsilon);
      }
    }
  }
}

// On data that is not a polynomial, the sums give the same result as an orthogonal solver on all
// the samples.
TEST(LeastSquares, AgreesWithAnOrthogonalSolver) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    Random random(seed);
    const int order = static_cast<int>(random.below(kOrderMax + 1));
    const double from_s = random.uniform(0.0, 1e6);
    const double width_s = random.uniform(0.5, 60.0);
    const auto count = static_cast<Eigen::Index>(20 + random.below(200));
    LeastSquares window(order, from_s, width_s);
    Eigen::MatrixXd powers(count, order + 1);
    Eigen::VectorXd values(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const double t_s = from_s + width_s * random.uniform(0.0, 1.0);
      values(i) = random.normal();
      const double x = (t_s - (from_s + 0.5 * width_s)) / (0.5 * width_s);
      for (Eigen::Index j = 0; j <= order; ++j)
        powers(i, j) = std::pow(x, static_cast<double>(j));
      window.add(t_s, values(i));
    }
    const Eigen::VectorXd solution = powers.colPivHouseholderQr().solve(values);
    const auto fit = window.fit();
    ASSERT_TRUE(fit);
    for (Eigen::Index j = 0; j <= order; ++j) {
      EXPECT_NEAR(fit->polynomial.coefficient[static_cast<std::size_t>(j)], solution(j), 1e-12);
    }
    for (auto j = static_cast<std::size_t>(order) + 1; j <= kOrderMax; ++j)
      EXPECT_EQ(fit->polynomial.coefficient[j], 0.0);
    const double residual = (values - powers * solution).squaredNorm() / static_cast<double>(count);
    EXPECT_NEAR(fit->residual_variance, residual, 1e-12);
  }
}

// As the header states, a value at the window's centre has an error of σ/√n for orders 0 and 1, and
// of 3/2 of that for a parabola's vertex.
TEST(LeastSquares, ErrsAtTheCentreAsPredicted) {
  constexpr double kSigma = 0.02;
  constexpr int kSamples = 200;
  constexpr int kRuns = 1000;
  for (int order = 0; order <= kOrderMax; ++order) {
    SCOPED_TRACE(::testing::Message() << "order " << order << ", seeds from 1");
    Rms error;
    double variance = 0.0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      Random random(seed);
      LeastSquares window(order, 0.0, 10.0);
      for (int i = 0; i < kSamples; ++i)
        window.add((i + 0.5) * 10.0 / kSamples, 0.5 + random.normal(kSigma));
      const auto fit = window.fit();
      ASSERT_TRUE(fit);
      error.add(fit->polynomial.at(5.0) - 0.5);
      variance += fit->residual_variance / kRuns;
    }
    const double predicted = (order < 2 ? 1.0 : 1.5) * kSigma / std::sqrt(kSamples);
    EXPECT_NEAR(error.value() / predicted, 1.0, kSigmas * error.relative_error());
    // Each coefficient takes one degree of freedom out of the residuals.
    const double left = kSigma * kSigma * (kSamples - order - 1) / kSamples;
    EXPECT_NEAR(variance / left, 1.0, kSigmas * std::sqrt(2.0 / (kSamples * kRuns)));
  }
}

// A window without samples has no drift, rather than a drift of zero.
TEST(LeastSquares, RefusesAnEmptyWindow) {
  for (int order = 0; order <= kOrderMax; ++order)
    EXPECT_FALSE(LeastSquares(order, 0.0, 10.0).fit()) << order;
}

// Twice as many samples as coefficients, at least: fewer would fit the noise.
TEST(LeastSquares, RefusesTooFewSamples) {
  for (int order = 0; order <= kOrderMax; ++order) {
    const int enough = 2 * (order + 1);
    LeastSquares window(order, 0.0, 10.0);
    for (int i = 0; i < enough - 1; ++i) {
      window.add(9.0 * i / enough + 0.5 * (i % 2), 1.0);
      EXPECT_FALSE(window.fit()) << order << ' ' << i;
    }
    window.add(10.0, 1.0);
    EXPECT_TRUE(window.fit()) << order;
    EXPECT_EQ(window.count(), static_cast<std::uint64_t>(enough));
  }
}

// A slope from one corner of the window would be noise times a long lever.
TEST(LeastSquares, RefusesToCoverLessThanHalfOfTheWindow) {
  for (int order = 0; order <= kOrderMax; ++order) {
    LeastSquares window(order, 100.0, 10.0);
    for (int i = 0; i < 1000; ++i)
      window.add(102.0 + 4.99 * i / 999.0, 1.0);
    EXPECT_FALSE(window.fit()) << order;
    window.add(107.0, 1.0);
    EXPECT_TRUE(window.fit()) << order;
  }
}

// Many samples at two instants cover the window but do not determine a parabola; the result must be
// finite or absent, never a NaN.
TEST(LeastSquares, MakesNoNanOfSamplesAtTwoInstants) {
  for (int order = 0; order <= kOrderMax; ++order) {
    LeastSquares window(order, 0.0, 10.0);
    for (int i = 0; i < 100; ++i) {
      window.add(1.0, 0.25);
      window.add(9.0, 0.25);
    }
    const auto fit = window.fit();
    if (fit) {
      EXPECT_NEAR(fit->polynomial.at(1.0), 0.25, 1e-12) << order;
      EXPECT_NEAR(fit->polynomial.at(9.0), 0.25, 1e-12) << order;
    } else {
      EXPECT_GE(order, 2);
    }
  }
}

}  // namespace
}  // namespace vgyro::fusion
