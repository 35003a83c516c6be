#pragma once

// Explains observations by effects: residuals, derivatives, Gauss-Newton steps over the free
// parameters, and the noise that is left fitted with them. Knows which effects the model has, and
// takes none of them for granted in what it is asked about. Never changes.

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "gap/least_squares.h"
#include "gap/noise.h"
#include "gap/observations.h"

namespace vgyro::gap {

/// Effects beside the known ones, and the noise that is left.
struct Fit {
  Effects terms;
  PairNoise noise;
  double log_likelihood = 0.0;
  Eigen::MatrixXd covariance;  ///< of the free parameters, in the order of the terms
};

/// Columns over samples and over blocks' means in units of the noise, one below the other.
Matrix whitened(const Matrix& columns, const Layout& layout, const PairNoise& noise, Part part);
/// The same with the means at hand.
Matrix whitened(Matrix columns, Matrix means, const Layout& layout, const PairNoise& noise,
                Part part);

class Regression {
 public:
  /// `known`: the model's effects, which stay as they are. `part`: the blocks that count.
  Regression(std::shared_ptr<const Observations> data, Effects known, Part part);

  [[nodiscard]] const Observations& data() const { return *data_; }
  [[nodiscard]] const Effects& known() const { return known_; }
  [[nodiscard]] const PairNoise& known_noise() const { return known_noise_; }
  [[nodiscard]] Part part() const { return part_; }

  /// The known effects, then the terms.
  [[nodiscard]] Effects with_known(const Effects& terms) const;
  /// What is observed less what known effects and terms say.
  [[nodiscard]] Eigen::VectorXd residual(const Effects& terms) const;
  /// What the free parameters of one term move, beside all others.
  [[nodiscard]] Matrix derivatives(const Effects& terms, std::size_t index) const;
  /// The residual of `terms`, what the free parameters of each but `left_out` move, and `spare`
  /// columns of zeros.
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  [[nodiscard]] Matrix columns(const Effects& terms, Eigen::Index spare = 0,
                               std::size_t left_out = kNone) const;
  [[nodiscard]] Matrix whitened(const Matrix& columns, const PairNoise& noise) const;
  [[nodiscard]] double log_likelihood(const Effects& terms, const PairNoise& noise) const;
  /// With every lateness reckoned as that of a low-pass: by the motion, not by what the other gyro
  /// reads.
  [[nodiscard]] double log_likelihood_by_motion(const Effects& terms, const PairNoise& noise) const;

  /// Gauss-Newton over the free parameters at the fit's noise; sets the covariance.
  void improve(Fit& fit) const;
  /// Terms and noise by maximum likelihood. Where an exponentially correlated drift makes what is
  /// left likelier, it stays in the fit's noise beside the walk.
  [[nodiscard]] Fit fit(Effects terms, const PairNoise& start) const;
  /// The same beside what `null` is without them, to see what they gain: where that needs no
  /// correlated drift of its own, they need none.
  [[nodiscard]] Fit fit_beside(Effects terms, const PairNoise& start, const Fit& null) const;

  /// Into the limits of its kind; nothing reads ahead of time.
  void keep_in_bounds(model::Effect& effect) const;

 private:
  class Descent;

  /// What the free parameters move, from column 1 on.
  void set_slopes(const Effects& terms, std::size_t left_out, Matrix& columns) const;
  [[nodiscard]] Fit fit_in_turns(Effects terms, const PairNoise& start, Descent& descent) const;
  [[nodiscard]] bool needs_drift(const Fit& fit, std::size_t gyro) const;
  void fit_noise(Fit& fit, const Eigen::VectorXd& residual) const;
  [[nodiscard]] Fit fit_linearised(Effects terms, const PairNoise& start, const Fit& null) const;
  void allow_drift(Fit& fit, std::size_t gyro, Descent& descent) const;

  std::shared_ptr<const Observations> data_;
  Effects known_;
  PairNoise known_noise_;
  Part part_;
  mutable Eigen::VectorXd known_residual_;  ///< once asked for: most terms leave it as it is
};

/// Free parameters of all terms.
Eigen::Index free_count(const Effects& terms);

/// σ of each term's parameters by the fit's covariance; 0 where nothing was estimated.
std::vector<model::Parameters> sigmas_of(const Fit& fit);

}  // namespace vgyro::gap
