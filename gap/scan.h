#pragma once

// Looks for what would explain a residual: every shape of the catalogue that the recording could
// show, steps at many instants, lines at many frequencies. A linear look at given noise, beside
// what is fitted anyway; its answer is a ranking, for others to fit and to judge.

#include <vector>

#include "gap/found.h"
#include "gap/regression.h"

namespace vgyro::gap {

class Scan {
 public:
  /// The regression outlives the scan. `beside`: terms beside the known ones that shapes are seen
  /// with, because a late rate changes them.
  Scan(const Regression& regression, const Effects& beside);

  /// Proposals for what `null` leaves at `noise`, the likeliest first. Their effects have the sizes
  /// that the look has found.
  [[nodiscard]] std::vector<Score> scores(const Fit& null, const PairNoise& noise) const;

 private:
  /// Residual and derivatives of what is fitted anyway.
  struct Base {
    Matrix columns;
    Matrix white;
    Eigen::MatrixXd gram;
  };
  void add_shapes(std::size_t gyro);
  [[nodiscard]] Matrix columns_of(const model::Effect& effect, const Effects& beside) const;
  [[nodiscard]] Base base_of(const Fit& null, const PairNoise& noise) const;
  void score_shapes(const Base& base, const PairNoise& noise, std::vector<Score>& scores) const;
  void score_steps(const Base& base, const PairNoise& noise, std::vector<Score>& scores) const;
  [[nodiscard]] Score best_step(std::size_t gyro, const std::vector<double>& at_s,
                                const Matrix& white_base, const PairNoise& noise) const;
  void score_lines(const Base& base, const PairNoise& noise, std::vector<Score>& scores) const;
  [[nodiscard]] Score line_at(double frequency_hz, std::size_t gyro, double penalty,
                              const Eigen::VectorXd& residual, const PairNoise& noise) const;
  [[nodiscard]] double penalty_of(const model::Effect& effect, double penalty) const;

  const Regression& regression_;
  /// Shapes of size 1, with the columns that each has among all of them.
  struct Shape {
    model::Effect effect;
    Eigen::Index first = 0;
    Eigen::Index width = 1;
  };
  std::vector<Shape> shapes_;
  FloatMatrix columns_;  ///< turned as whitening turns them
  Matrix means_;
};

/// A step with the instant and size that fit best beside `null`, to a fiftieth of a second.
model::Effect placed(const Regression& regression, const Fit& null, const model::Effect& step);
/// How far from its first place.
inline constexpr double kStepReach_s = 2.0;

/// Of these times, rising, those at which a step can be told from one at the time before: where
/// nothing was recorded in between, both are the same.
std::vector<double> distinct_steps(const Layout& layout, const std::vector<double>& at_s);

/// The inputs that the effect needs moved far enough to show it.
bool could_show(const Observations& data, const model::Effect& effect);

}  // namespace vgyro::gap
