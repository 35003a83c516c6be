#pragma once

// Tails of distributions, and names among many that were tried.

#include <cstddef>
#include <vector>

namespace vgyro::fleet {

/// Two-sided, of a standard normal z.
double normal_tail(double z);
/// Two-sided, of Student's t.
double student_tail(double t, double freedom);
/// The t that this two-sided tail lies beyond.
double student_quantile(double tail, double freedom);
/// Upper tail of χ².
double chi_square_tail(double value, double freedom);
/// Of a binomial distribution: so many successes or more.
double binomial_tail(std::size_t successes, std::size_t trials, double share);

/// Benjamini–Yekutieli: which of these p-values are names where at most this share of all names is
/// false on average, however the tests depend on each other. `tests`: how many were made, of which
/// `p` are the ones that matter.
std::vector<bool> named_of(const std::vector<double>& p, double tests, double rate);
/// The least threshold of these: what a single name needs.
double threshold_of(std::size_t rank, double tests, double rate);

/// One unit's value of something.
struct Estimate {
  double value = 0.0;
  double sigma = 0.0;
};
/// DerSimonian and Laird's spread between units, and Knapp and Hartung's error of the mean.
struct RandomEffects {
  double mean = 0.0;
  double sigma = 0.0;          ///< of the mean; at least that of units that are all alike
  double between = 0.0;        ///< 1σ between units
  double between_sigma = 0.0;  ///< about
  double freedom = 0.0;        ///< of the mean's t; 0: one unit
  double q = 0.0;              ///< Cochran's
  [[nodiscard]] double half_width95() const;
};
RandomEffects random_effects(const std::vector<Estimate>& units);

double median(std::vector<double> values);

}  // namespace vgyro::fleet
