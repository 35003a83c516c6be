#pragma once

// Tails of distributions, thresholds for names among many tests, and means over units.

#include <cstddef>
#include <vector>

namespace vgyro::fleet {

/// Two-sided tail of a standard normal z.
double normal_tail(double z);
/// Two-sided tail of Student's t.
double student_tail(double t, double freedom);
/// The t with this two-sided tail.
double student_quantile(double tail, double freedom);
/// Upper tail of χ².
double chi_square_tail(double value, double freedom);
/// Probability of at least so many successes, of a binomial distribution.
double binomial_tail(std::size_t successes, std::size_t trials, double share);

/// Benjamini–Yekutieli: which of these p-values are names if at most the share `rate` of all names
/// may be false on average, however the tests depend on each other. `tests`: number of tests made;
/// `p` holds those that matter.
std::vector<bool> named_of(const std::vector<double>& p, double tests, double rate);
/// The threshold for the p-value of this rank; rank 1 is what a single name needs.
double threshold_of(std::size_t rank, double tests, double rate);

/// One unit's estimate of a quantity.
struct Estimate {
  double value = 0.0;
  double sigma = 0.0;
};
/// DerSimonian and Laird's spread between units, and Knapp and Hartung's error of the mean.
struct RandomEffects {
  double mean = 0.0;
  double sigma = 0.0;          ///< of the mean; at least that of equal units
  double between = 0.0;        ///< 1σ between units
  double between_sigma = 0.0;  ///< approximate
  double freedom = 0.0;        ///< degrees of freedom of the mean's t; 0: one unit
  double q = 0.0;              ///< Cochran's Q
  [[nodiscard]] double half_width95() const;
};
RandomEffects random_effects(const std::vector<Estimate>& units);

double median(std::vector<double> values);

}  // namespace vgyro::fleet
