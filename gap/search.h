#pragma once

// Rounds of: fit the noise with what is in the model, score every candidate on whitened
// innovations, fit the best ones again together with the noise, and take the likeliest if it is
// beyond what chance brings. Then replacement, backward deletion, and the noise itself.

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "gap/candidates.h"
#include "gap/noise.h"
#include "gap/study.h"

namespace vgyro::gap {

/// Statistic less penalty that a name needs; docs/gap.md says what chance brings.
inline constexpr double kStatisticMin = 18.0;
/// What noise needs: weak noise of the wrong name would hide what grew it.
inline constexpr double kNoiseMin = 24.0;
/// What it needs where the noise must have grown beyond the model's to do without it: then one name
/// or another is due, and the question is only which.
inline constexpr double kStatisticMinAgainstNoise = 13.0;
/// Rivals that are less than this worse cannot be told apart.
inline constexpr double kLead = 7.0;
/// Of great effects the arithmetic of interpolation is not sure to better than this share.
inline constexpr double kLeadShare = 3e-3;

struct Fit {
  std::vector<Term> terms;
  PairNoise noise;
  double log_likelihood = 0.0;
  Eigen::MatrixXd covariance;  ///< of the free parameters, in the order of the terms
};

struct Found {
  Term term;
  model::Parameters sigma{};
  double statistic = 0.0;
  double penalty = 0.0;
  double needed = kStatisticMin;  ///< of statistic less penalty
  std::vector<Reading> ambiguous_with;
  [[nodiscard]] double margin() const { return statistic - penalty - needed; }
};

class Search {
 public:
  /// `known`: the model's effects, which stay as they are.
  Search(Study& study, std::vector<model::Effect> known);

  std::function<void(std::string_view what, double share)> progress;

  /// Finds deterministic effects, in the order of their weight; then noise.
  void run();

  [[nodiscard]] const std::vector<Found>& found() const { return found_; }
  /// What looked like an effect and is none of the catalogue's: it does not hold throughout.
  [[nodiscard]] const std::vector<Found>& rejected() const { return rejected_; }
  /// The model's effects and what was found.
  [[nodiscard]] std::vector<model::Effect> effects() const;
  /// The noise that fits best, which may be less or more than the model's.
  [[nodiscard]] const PairNoise& fitted_noise() const { return noise_; }

 private:
  struct Score {
    Candidate candidate;
    double statistic = 0.0;
    [[nodiscard]] double adjusted() const { return statistic - candidate.penalty; }
  };

  [[nodiscard]] std::vector<model::Effect> known_and(const std::vector<Term>& terms) const;
  [[nodiscard]] std::vector<Term> terms_of_problem(const std::vector<Term>& terms,
                                                   std::size_t problem) const;
  Matrix columns_of(const Problem& problem, const Term& term) const;
  Matrix normal_columns(std::size_t problem, const std::vector<Term>& terms,
                        const std::vector<Term>& others, Eigen::Index spare) const;
  Eigen::VectorXd residual_of(std::size_t problem, const std::vector<Term>& terms) const;
  Fit fit(std::size_t problem, std::vector<Term> terms, const PairNoise& start) const;
  void improve(std::size_t problem, Fit& fit) const;
  std::vector<Score> score(std::size_t problem, const Fit& null, const PairNoise& noise) const;
  /// `base`: residual and what is estimated anyway.
  void score_steps(std::size_t problem, const Matrix& base, const PairNoise& noise,
                   std::vector<Score>& scores) const;
  void score_lines(std::size_t problem, const Eigen::VectorXd& residual, const PairNoise& noise,
                   std::vector<Score>& scores) const;
  /// `start`: the noise that the fits begin with.
  std::vector<Found> refit_best(std::size_t problem, const Fit& null, const PairNoise& start,
                                const std::vector<Score>& scores, std::size_t most) const;
  void keep_in_bounds(model::Effect& effect) const;
  void place_step(std::size_t problem, const Fit& null, Term& term, double reach_s,
                  double step_s) const;
  bool add_round();
  [[nodiscard]] bool is_left_of_timing(const Found& one) const;
  Found judge_timing(const std::vector<Term>& terms, Found best, const std::vector<Score>& scores);
  void place_again();
  void replace_round();
  void delete_backward();
  /// How much better the effect fits with a size of its own in each part of the recording, as a
  /// statistic, and its degrees of freedom.
  struct Change {
    double statistic = 0.0;
    double freedom = 0.0;
  };
  Change change_over_time(std::size_t index) const;
  void reject_unsteady();
  void noise_rounds();
  bool reject_beside_noise();
  [[nodiscard]] double statistic_beside(std::size_t index) const;
  void settle();
  void cache_candidates();

  Study& study_;
  std::vector<model::Effect> known_;
  std::vector<Found> found_;
  std::vector<Found> rejected_;
  PairNoise noise_;                    ///< fitted
  PairNoise file_noise_;               ///< what the model says, with what was found
  std::vector<Eigen::VectorXd> base_;  ///< residual of the known effects, by problem
  struct Cached {
    std::vector<Candidate> candidates;
    std::vector<Eigen::Index> first;  ///< column of each candidate
    std::vector<Eigen::Index> width;
    Matrix columns;
    Matrix means;
  };
  std::vector<Cached> cached_;
};

}  // namespace vgyro::gap
