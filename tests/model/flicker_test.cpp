#include "model/flicker.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace vgyro::model {
namespace {

constexpr double kB_dps = 0.003;
constexpr double kPi = std::numbers::pi;

/// Textbook formulas: two-sided spectrum and Allan variance of one exponentially correlated term.
double spectrum(const FlickerTerm& term, double frequency_hz) {
  const double x = 2.0 * kPi * frequency_hz * term.tau_s;
  return 2.0 * term.sigma_dps * term.sigma_dps * term.tau_s / (1.0 + x * x);
}
double allan_variance(const FlickerTerm& term, double tau_s) {
  const double x = tau_s / term.tau_s;
  if (x < 1e-3) return term.sigma_dps * term.sigma_dps * 2.0 / 3.0 * x;
  return term.sigma_dps * term.sigma_dps / (x * x) *
         (2.0 * x - 3.0 + 4.0 * std::exp(-x) - std::exp(-2.0 * x));
}

void expect_flicker(std::size_t count, double from_s, double to_s, double close) {
  // At least a decade inside the ends, so that no term is missing on one side.
  for (double tau_s = 10.0 * from_s; tau_s < 0.1 * to_s; tau_s *= 1.1) {
    const double frequency_hz = 1.0 / (2.0 * kPi * tau_s);
    double density = 0.0;
    double variance = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const FlickerTerm term = flicker_term(kB_dps, i, count, from_s, to_s);
      density += spectrum(term, frequency_hz);
      variance += allan_variance(term, tau_s);
    }
    const double wanted = kB_dps * kB_dps / (2.0 * kPi * frequency_hz);
    EXPECT_NEAR(density / wanted, 1.0, close) << count << " terms, " << frequency_hz << " Hz";
    EXPECT_NEAR(std::sqrt(variance) / (0.664 * kB_dps), 1.0, close)
        << count << " terms, averaged over " << tau_s << " s";
  }
}

// An end that is a decade away still reduces the spectrum by 6 %.
TEST(Flicker, TermsAFactorOfFourApartAreFlickerNoise) {
  expect_flicker(15, 1e-3, 1e6, 0.08);
}

TEST(Flicker, TermsADecadeApartAreNearIt) {
  expect_flicker(9, 1e-3, 1e6, 0.12);
}

TEST(Flicker, FarFromTheEndsItIsExact) {
  double density = 0.0;
  for (std::size_t i = 0; i < 30; ++i)
    density += spectrum(flicker_term(kB_dps, i, 30, 1e-9, 1e9), 1.0);
  EXPECT_NEAR(density, kB_dps * kB_dps / (2.0 * kPi), 4e-3 * density);
}

}  // namespace
}  // namespace vgyro::model
