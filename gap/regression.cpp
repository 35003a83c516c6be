#include "gap/regression.h"

#include <algorithm>
#include <cmath>

#include "model/equation.h"

namespace vgyro::gap {

namespace {

using model::Effect;

constexpr int kStepsMax = 8;
// A step that makes it worse is tried shorter: after six of these nothing is left of it.
constexpr int kShorterMax = 6;
constexpr double kShorter = 0.4;
// Of the sum of squares in units of the noise: rounding, and what no longer matters.
constexpr double kSame = 1e-9;
constexpr double kSettledGain = 0.01;
// Slopes are dear; a step that gained less than this moved too little to change them.
constexpr double kSlopesStay = 1.0;
// Terms and noise in turn, until the likelihood stands.
constexpr int kTurns = 3;
constexpr double kSettledLikelihood = 0.05;
// Two more parameters, as an information criterion counts them.
constexpr double kDriftGain = 2.0;

bool is_linear(const Effects& terms) {
  return std::all_of(terms.begin(), terms.end(), [](const Effect& term) {
    const auto free = *row(term.kind).free;
    return std::all_of(free.begin(), free.end(), [](const Free& one) { return one.linear; });
  });
}

bool any_moves(const Effects& terms) {
  return std::any_of(terms.begin(), terms.end(),
                     [](const Effect& term) { return model::moves_in_time(term.kind); });
}

// Solution x of the free parameters, taken up.
Effects moved(Effects terms, const Eigen::VectorXd& x, double scale) {
  Eigen::Index place = 0;
  for (Effect& term : terms) {
    for (const Free& free : *row(term.kind).free)
      term.parameters[free.parameter] += scale * x[place++];
  }
  return terms;
}

}  // namespace

Eigen::Index free_count(const Effects& terms) {
  Eigen::Index count = 0;
  for (const Effect& term : terms)
    count += static_cast<Eigen::Index>((*row(term.kind).free).size());
  return count;
}

std::vector<model::Parameters> sigmas_of(const Fit& fit) {
  std::vector<model::Parameters> sigmas;
  Eigen::Index place = 0;
  for (const Effect& term : fit.terms) {
    model::Parameters& sigma = sigmas.emplace_back();
    for (const Free& free : *row(term.kind).free) {
      sigma[free.parameter] = std::sqrt(std::max(0.0, fit.covariance(place, place)));
      ++place;
    }
  }
  return sigmas;
}

Matrix whitened(Matrix columns, Matrix means, const Layout& layout, const PairNoise& noise,
                Part part) {
  whiten_within(columns, layout, noise, part);
  whiten_means(means, layout, noise, part);
  Matrix all(columns.rows() + means.rows(), columns.cols());
  all.topRows(columns.rows()) = columns;
  all.bottomRows(means.rows()) = means;
  return all;
}

Matrix whitened(const Matrix& columns, const Layout& layout, const PairNoise& noise, Part part) {
  return whitened(columns, block_means(columns, layout), layout, noise, part);
}

Regression::Regression(std::shared_ptr<const Observations> data, Effects known, Part part)
    : data_(std::move(data)),
      known_(std::move(known)),
      known_noise_(noise_of(known_)),
      part_(part) {}

void Regression::keep_in_bounds(Effect& effect) const {
  for (const Limit& limit : *row(effect.kind).limits) {
    if (!limit.in_fits) continue;
    double& value = effect.parameters[limit.parameter];
    value = std::min(value, data_->most_of(limit, effect.gyro));
  }
  clamp(effect);
  // Nothing reads ahead of time; a reference may be late, but the other gyro has a name of its own.
  if (effect.kind == model::Kind::kDelay && !data_->about.with_reference)
    effect.parameters[0] = std::max(0.0, effect.parameters[0]);
}

Effects Regression::with_known(const Effects& terms) const {
  Effects all = known_;
  all.insert(all.end(), terms.begin(), terms.end());
  return all;
}

Eigen::VectorXd Regression::residual(const Effects& terms) const {
  if (any_moves(terms)) return data_->residual(with_known(terms));
  if (known_residual_.size() == 0) known_residual_ = data_->residual(known_);
  Eigen::VectorXd residual = known_residual_;
  for (const Effect& term : terms)
    residual -= data_->contribution_beside(known_, term);
  return residual;
}

Matrix Regression::derivatives(const Effects& terms, std::size_t index) const {
  Effects others = with_known(terms);
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(known_.size() + index));
  const auto free = *row(terms[index].kind).free;
  Matrix columns(data_->size(), static_cast<Eigen::Index>(free.size()));
  for (std::size_t i = 0; i < free.size(); ++i) {
    columns.col(static_cast<Eigen::Index>(i)) = data_->derivative(others, terms[index], free[i]);
  }
  return columns;
}

Matrix Regression::columns(const Effects& terms, Eigen::Index spare, std::size_t left_out) const {
  Eigen::Index width = 1 + free_count(terms) + spare;
  if (left_out != kNone) width -= free_count({terms[left_out]});
  Matrix columns = Matrix::Zero(data_->size(), width);
  columns.col(0) = residual(terms);
  set_slopes(terms, left_out, columns);
  return columns;
}

void Regression::set_slopes(const Effects& terms, std::size_t left_out, Matrix& columns) const {
  Eigen::Index at = 1;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const Eigen::Index count = free_count({terms[i]});
    if (count == 0 || i == left_out) continue;
    columns.middleCols(at, count) = derivatives(terms, i);
    at += count;
  }
}

Matrix Regression::whitened(const Matrix& columns, const PairNoise& noise) const {
  return gap::whitened(columns, data_->layout, noise, part_);
}

double Regression::log_likelihood(const Effects& terms, const PairNoise& noise) const {
  return gap::log_likelihood(residual(terms), data_->layout, noise, part_);
}

double Regression::log_likelihood_by_motion(const Effects& terms, const PairNoise& noise) const {
  return gap::log_likelihood(data_->residual_by_motion(with_known(terms)), data_->layout, noise,
                             part_);
}

// Gauss-Newton's steps, each from where the last one ended: what is left of the observations, and
// what the free parameters move.
class Regression::Descent {
 public:
  Descent(const Regression& regression, const Effects& terms)
      : regression_(regression),
        is_linear_(vgyro::gap::is_linear(terms)),
        columns_(regression.data().size(), 1 + free_count(terms)) {
    columns_.col(0) = regression.residual(terms);
  }

  [[nodiscard]] Eigen::VectorXd residual() const { return columns_.col(0); }
  void set_residual(const Eigen::VectorXd& residual) { columns_.col(0) = residual; }

  /// Precondition: the residual is that of the fit's terms.
  void settle(Fit& fit) {
    if (fit.terms.empty()) return;
    double before = 0.0;
    for (int i = 0; i < kStepsMax; ++i) {
      const bool fresh = !slopes_known_;
      if (fresh) regression_.set_slopes(fit.terms, kNone, columns_);
      slopes_known_ = true;
      const double gained = step(fit);
      // What is as good as linear is solved; else gains shrink by the same share or faster.
      if (is_linear_) return;
      if (gained < kSettledGain || gained * gained < kSettledGain * before) {
        if (fresh || gained > 0.0) return;
        slopes_known_ = false;
        continue;
      }
      if (gained > kSlopesStay) slopes_known_ = false;
      before = gained;
    }
  }

 private:
  // Shortened until it makes nothing worse. Returns what it gained of the sum of squares; 0: it was
  // not taken.
  double step(Fit& fit) {
    const Matrix white = regression_.whitened(columns_, fit.noise);
    const Solution solution = explain_first(white.transpose() * white);
    fit.covariance = solution.covariance;
    const double square = white.col(0).squaredNorm();
    double scale = 1.0;
    for (int shorter = 0; shorter < kShorterMax; ++shorter, scale *= kShorter) {
      Effects trial = moved(fit.terms, solution.x, scale);
      for (Effect& term : trial)
        regression_.keep_in_bounds(term);
      const Eigen::VectorXd residual = regression_.residual(trial);
      const double now = regression_.whitened(Matrix(residual), fit.noise).squaredNorm();
      if (now > square + kSame) continue;
      fit.terms = std::move(trial);
      columns_.col(0) = residual;
      return square - now;
    }
    return 0.0;
  }

  const Regression& regression_;
  bool is_linear_;
  Matrix columns_;
  bool slopes_known_ = false;
};

void Regression::improve(Fit& fit) const {
  if (fit.terms.empty()) return;
  Descent(*this, fit.terms).settle(fit);
}

// White noise, that of the rate, and walk; correlated drift as the model has it.
void Regression::fit_noise(Fit& fit, const Eigen::VectorXd& residual) const {
  PairNoise start = fit.noise;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    start[gyro].markov = known_noise_[gyro].markov;
  const NoiseFitResult plain =
      fit_pair_noise(residual, data_->layout, start, {}, data_->holds, part_);
  fit.noise = plain.noise;
  fit.log_likelihood = plain.log_likelihood;
}

// Drift of a few seconds' or minutes' memory must not pass for an effect.
void Regression::allow_drift(Fit& fit, std::size_t gyro, Descent& descent) const {
  if (!data_->holds[gyro] || fit.noise[gyro].markov.size() >= kMarkovMax) return;
  std::array<Freedom, 2> free;
  free[gyro].markov = true;
  const Eigen::VectorXd residual = descent.residual();
  const NoiseFitResult with =
      fit_pair_noise(residual, data_->layout, fit.noise, free, data_->holds, part_);
  if (with.log_likelihood < fit.log_likelihood + kDriftGain) return;
  Fit richer = fit;
  richer.noise = with.noise;
  descent.settle(richer);
  richer.log_likelihood =
      gap::log_likelihood(descent.residual(), data_->layout, richer.noise, part_);
  if (richer.log_likelihood > fit.log_likelihood) {
    fit = std::move(richer);
  } else {
    descent.set_residual(residual);
  }
}

Fit Regression::fit_linearised(Effects terms, const PairNoise& start, const Fit& null) const {
  const Matrix all = columns(terms);
  const Eigen::Index width = all.cols() - 1;
  Fit fit{std::move(terms), start, 0.0, {}};
  Eigen::VectorXd x = Eigen::VectorXd::Zero(width);
  const auto residual = [&] { return Eigen::VectorXd(all.col(0) - all.rightCols(width) * x); };
  const auto solve = [&] {
    const Matrix white = whitened(all, fit.noise);
    const Solution solution = explain_first(white.transpose() * white);
    x = solution.x;
    fit.covariance = solution.covariance;
  };
  for (int turn = 0; turn < kTurns; ++turn) {
    solve();
    const double before = fit.log_likelihood;
    fit_noise(fit, residual());
    if (turn > 0 && std::abs(fit.log_likelihood - before) < kSettledLikelihood) break;
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!needs_drift(null, gyro)) continue;
    std::array<Freedom, 2> free;
    free[gyro].markov = true;
    const NoiseFitResult with =
        fit_pair_noise(residual(), data_->layout, fit.noise, free, data_->holds, part_);
    if (with.log_likelihood < fit.log_likelihood + kDriftGain) continue;
    fit.noise = with.noise;
    solve();
    fit.log_likelihood = gap::log_likelihood(residual(), data_->layout, fit.noise, part_);
  }
  fit.terms = moved(fit.terms, x, 1.0);
  for (Effect& term : fit.terms)
    keep_in_bounds(term);
  return fit;
}

Fit Regression::fit_in_turns(Effects terms, const PairNoise& start, Descent& descent) const {
  Fit fit{std::move(terms), start, 0.0, {}};
  const int turns = fit.terms.empty() ? 1 : kTurns;
  for (int turn = 0; turn < turns; ++turn) {
    descent.settle(fit);
    const double before = fit.log_likelihood;
    fit_noise(fit, descent.residual());
    if (turn > 0 && std::abs(fit.log_likelihood - before) < kSettledLikelihood) break;
  }
  return fit;
}

Fit Regression::fit(Effects terms, const PairNoise& start) const {
  Descent descent(*this, terms);
  Fit fit = fit_in_turns(std::move(terms), start, descent);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    allow_drift(fit, gyro, descent);
  return fit;
}

// More drift than the model has.
bool Regression::needs_drift(const Fit& fit, std::size_t gyro) const {
  return fit.noise[gyro].markov.size() > known_noise_[gyro].markov.size();
}

Fit Regression::fit_beside(Effects terms, const PairNoise& start, const Fit& null) const {
  // What the others are moved by it is little: their slopes serve.
  if (!terms.empty() && is_linear({terms.back()}))
    return fit_linearised(std::move(terms), start, null);
  Descent descent(*this, terms);
  Fit fit = fit_in_turns(std::move(terms), start, descent);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (needs_drift(null, gyro)) allow_drift(fit, gyro, descent);
  }
  return fit;
}

}  // namespace vgyro::gap
