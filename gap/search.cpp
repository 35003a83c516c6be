#include "gap/search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <unsupported/Eigen/FFT>

#include "gap/views.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

constexpr std::size_t kFoundMax = 10;
// More of one kind for one gyro is something else in pieces.
constexpr std::ptrdiff_t kLinesMax = 3;
constexpr std::ptrdiff_t kStepsMax = 3;
constexpr Eigen::Index kParts = 6;
constexpr double kCoarsePenalty = 1000.0;
constexpr std::size_t kRefitsMax = 7;
constexpr double kStepEvery_s = 2.0;
constexpr double kStepReach_s = 2.0;
constexpr double kLineShare = 0.05;
constexpr double kTimingLeaves = 2e-3;
constexpr double kJitterLeaves = 2e-2;
constexpr double kLineLow_hz = 0.02;

void clamp_to_catalogue(Effect& effect) {
  const auto parameters = model::info(effect.kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    effect.parameters[i] =
        std::clamp(effect.parameters[i], parameters[i].minimum, parameters[i].maximum);
    if (std::abs(effect.parameters[i]) < parameters[i].least) effect.parameters[i] = 0.0;
  }
  if (effect.kind == Kind::kBandwidth)
    effect.parameters[0] = std::clamp(effect.parameters[0], 0.05, 1e4);
  if (effect.kind == Kind::kWarmUp)
    effect.parameters[1] = std::clamp(effect.parameters[1], 0.5, 1e4);
}

// Whitened fit-part columns stacked: samples within blocks, then means of blocks.
Matrix whitened(Matrix columns, Matrix means, const Layout& layout, const PairNoise& noise) {
  whiten_within(columns, layout, noise, Part::kFit);
  whiten_means(means, layout, noise, Part::kFit);
  Matrix all(columns.rows() + means.rows(), columns.cols());
  all.topRows(columns.rows()) = columns;
  all.bottomRows(means.rows()) = means;
  return all;
}

Matrix whitened(const Matrix& columns, const Layout& layout, const PairNoise& noise) {
  return whitened(columns, block_means(columns, layout), layout, noise);
}

// Least squares that passes over directions without information.
struct Solution {
  Eigen::VectorXd x;
  Eigen::MatrixXd covariance;
  double gain = 0.0;  ///< of 2·log-likelihood
};
Solution solve(const Eigen::MatrixXd& gram, const Eigen::VectorXd& right) {
  const Eigen::Index n = gram.rows();
  Solution solution{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n), 0.0};
  if (n == 0) return solution;
  Eigen::VectorXd scale = gram.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < n; ++i)
    scale[i] = scale[i] > 0.0 ? 1.0 / scale[i] : 0.0;
  const Eigen::MatrixXd scaled = scale.asDiagonal() * gram * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  Eigen::VectorXd inverse = eigen.eigenvalues();
  for (Eigen::Index i = 0; i < n; ++i)
    inverse[i] = inverse[i] > 1e-9 ? 1.0 / inverse[i] : 0.0;
  const Eigen::MatrixXd scaled_inverse =
      eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  solution.covariance = scale.asDiagonal() * scaled_inverse * scale.asDiagonal();
  solution.x = solution.covariance * right;
  solution.gain = right.dot(solution.x);
  return solution;
}

// Amplitude above 0, phase from 0 to one turn.
void tidy_phase(Effect& effect) {
  if (effect.kind != Kind::kLine && effect.kind != Kind::kAngleHarmonic) return;
  const double turn = 2.0 * std::numbers::pi;
  if (effect.parameters[1] < 0.0) {
    effect.parameters[1] = -effect.parameters[1];
    effect.parameters[2] += std::numbers::pi;
  }
  effect.parameters[2] -= turn * std::floor(effect.parameters[2] / turn);
}

Eigen::Index free_count(const std::vector<Term>& terms) {
  Eigen::Index count = 0;
  for (const Term& term : terms)
    count += static_cast<Eigen::Index>(term.free.size());
  return count;
}

bool is_noise(const Found& found) {
  return model::info(found.term.effect.kind).nature == model::Nature::kNoise;
}

bool is_drift(Kind kind) {
  return kind == Kind::kRateRandomWalk || kind == Kind::kGaussMarkov;
}

bool is_timing(Kind kind) {
  return kind == Kind::kDelay || kind == Kind::kBandwidth || kind == Kind::kClockSkew;
}

PairNoise only_walk(PairNoise noise, const PairNoise& file) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    noise[gyro].markov = file[gyro].markov;
  return noise;
}

}  // namespace

Search::Search(Study& study, std::vector<Effect> known)
    : study_(study), known_(std::move(known)), file_noise_(noise_of(known_)) {
  noise_ = file_noise_;
}

void Search::keep_in_bounds(Effect& effect) const {
  clamp_to_catalogue(effect);
  // Nothing reads ahead of time; a reference may be late, but the other gyro has a name of its own.
  if (effect.kind == Kind::kDelay && !study_.recording().has_reference)
    effect.parameters[0] = std::max(0.0, effect.parameters[0]);
}

std::vector<Effect> Search::effects() const {
  std::vector<Effect> all = known_;
  for (const Found& found : found_)
    all.push_back(found.term.effect);
  return all;
}

std::vector<Effect> Search::known_and(const std::vector<Term>& terms) const {
  std::vector<Effect> all = known_;
  for (const Term& term : terms)
    all.push_back(term.effect);
  return all;
}

std::vector<Term> Search::terms_of_problem(const std::vector<Term>& terms,
                                           std::size_t problem) const {
  std::vector<Term> mine;
  for (const Term& term : terms) {
    if (study_.problem_of(term.effect.gyro) == problem) mine.push_back(term);
  }
  return mine;
}

Matrix Search::columns_of(const Problem& problem, const Term& term) const {
  Matrix columns(problem.size(), static_cast<Eigen::Index>(term.free.size()));
  for (std::size_t i = 0; i < term.free.size(); ++i) {
    columns.col(static_cast<Eigen::Index>(i)) =
        derivative(study_, problem, term.effect, term.free[i]);
  }
  return columns;
}

Eigen::VectorXd Search::residual_of(std::size_t problem, const std::vector<Term>& terms) const {
  const Problem& data = study_.problems()[problem];
  Eigen::VectorXd residual = base_[problem];
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!data.holds[gyro]) continue;
    std::vector<Effect> effects;
    effects.reserve(terms.size());
    for (const Term& term : terms)
      effects.push_back(term.effect);
    if (!effects.empty()) residual -= study_.contribution(data, gyro, effects);
  }
  return residual;
}

// Residual of `terms`, then what the free parameters of `others` move, then `spare` columns of
// zeros.
Matrix Search::normal_columns(std::size_t problem, const std::vector<Term>& terms,
                              const std::vector<Term>& others, Eigen::Index spare) const {
  const Problem& data = study_.problems()[problem];
  Matrix columns = Matrix::Zero(data.size(), 1 + free_count(others) + spare);
  columns.col(0) = residual_of(problem, terms);
  Eigen::Index at = 1;
  for (const Term& term : others) {
    const auto count = static_cast<Eigen::Index>(term.free.size());
    if (count > 0) columns.middleCols(at, count) = columns_of(data, term);
    at += count;
  }
  return columns;
}

// Gauss-Newton over the free parameters at given noise.
void Search::improve(std::size_t problem, Fit& fit) const {
  const Problem& data = study_.problems()[problem];
  const auto square_of = [&](const std::vector<Term>& terms) {
    return whitened(Matrix(residual_of(problem, terms)), data.layout, fit.noise).squaredNorm();
  };
  if (fit.terms.empty()) return;
  double square = square_of(fit.terms);
  for (int step = 0; step < 8; ++step) {
    const Eigen::Index width = 1 + free_count(fit.terms);
    const Matrix columns = normal_columns(problem, fit.terms, fit.terms, 0);
    const Matrix white = whitened(columns, data.layout, fit.noise);
    const Eigen::MatrixXd gram = white.transpose() * white;
    const Solution solution =
        solve(gram.bottomRightCorner(width - 1, width - 1), gram.col(0).tail(width - 1));
    fit.covariance = solution.covariance;
    bool better = false;
    double scale = 1.0;
    for (int half = 0; half < 6 && !better; ++half, scale *= 0.4) {
      std::vector<Term> trial = fit.terms;
      Eigen::Index place = 0;
      for (Term& term : trial) {
        for (const std::size_t parameter : term.free)
          term.effect.parameters[parameter] += scale * solution.x[place++];
        keep_in_bounds(term.effect);
      }
      const double now = square_of(trial);
      if (now <= square + 1e-9) {
        better = true;
        const double gained = square - now;
        fit.terms = std::move(trial);
        square = now;
        if (gained < 0.01) step = 100;
      }
    }
    if (!better) break;
    bool linear = true;
    for (const Term& term : fit.terms) {
      for (const std::size_t parameter : term.free)
        linear = linear && is_linear(term.effect.kind, parameter);
    }
    if (linear) break;
  }
}

Fit Search::fit(std::size_t problem, std::vector<Term> terms, const PairNoise& start) const {
  const Problem& data = study_.problems()[problem];
  Fit fit{std::move(terms), start, 0.0, {}};
  std::array<Freedom, 2> free;
  const int rounds = fit.terms.empty() ? 1 : 3;
  for (int round = 0; round < rounds; ++round) {
    improve(problem, fit);
    const Eigen::VectorXd residual = residual_of(problem, fit.terms);
    const NoiseFitResult plain = fit_pair_noise(
        residual, data.layout, only_walk(fit.noise, file_noise_), free, data.holds, Part::kFit);
    const double before = fit.log_likelihood;
    fit.noise = plain.noise;
    fit.log_likelihood = plain.log_likelihood;
    if (round > 0 && std::abs(fit.log_likelihood - before) < 0.05) break;
  }
  // Drift of a few seconds' or minutes' memory must not pass for an effect: where such a term makes
  // the rest likelier, it stays beside the walk.
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!data.holds[gyro] || fit.noise[gyro].markov.size() >= kMarkovMax) continue;
    std::array<Freedom, 2> rich;
    rich[0] = rich[1] = {true, true, true, false};
    rich[gyro].markov = true;
    const Eigen::VectorXd residual = residual_of(problem, fit.terms);
    const NoiseFitResult with =
        fit_pair_noise(residual, data.layout, fit.noise, rich, data.holds, Part::kFit);
    if (with.log_likelihood < fit.log_likelihood + 2.0) continue;
    Fit richer = fit;
    richer.noise = with.noise;
    richer.log_likelihood = with.log_likelihood;
    improve(problem, richer);
    richer.log_likelihood =
        log_likelihood(residual_of(problem, richer.terms), data.layout, richer.noise, Part::kFit);
    if (richer.log_likelihood > fit.log_likelihood) fit = std::move(richer);
  }
  return fit;
}

void Search::cache_candidates() {
  cached_.clear();
  base_.clear();
  for (const Problem& data : study_.problems()) {
    base_.push_back(study_.residual(data, known_));
    Cached cached;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!data.holds[gyro]) continue;
      for (Candidate& candidate : shaped_candidates(study_, gyro)) {
        // Rounding of slow readings looks like any slow effect.
        if (study_.is_coarse(gyro)) candidate.penalty += kCoarsePenalty;
        const Kind kind = candidate.term.effect.kind;
        const Eigen::Index width = kind == Kind::kAngleHarmonic ? 2 : 1;
        cached.first.push_back(cached.first.empty() ? 0
                                                    : cached.first.back() + cached.width.back());
        cached.width.push_back(width);
        cached.candidates.push_back(std::move(candidate));
      }
    }
    const Eigen::Index width = cached.first.back() + cached.width.back();
    cached.columns.resize(data.size(), width);
    for (std::size_t i = 0; i < cached.candidates.size(); ++i) {
      const Term& term = cached.candidates[i].term;
      const std::size_t gyro = term.effect.gyro;
      const Eigen::Index at = cached.first[i];
      if (term.effect.kind == Kind::kAngleHarmonic) {
        Effect quadrature = term.effect;
        quadrature.parameters[2] = 0.5 * std::numbers::pi;
        cached.columns.col(at) = study_.contribution(data, gyro, {term.effect});
        cached.columns.col(at + 1) = study_.contribution(data, gyro, {quadrature});
      } else if (term.effect.kind == Kind::kBandwidth) {
        cached.columns.col(at) = study_.contribution(data, gyro, {term.effect});
      } else {
        Term one = term;
        one.free = {term.free[0]};
        cached.columns.col(at) = columns_of(data, one);
      }
    }
    cached.means = block_means(cached.columns, data.layout);
    cached_.push_back(std::move(cached));
  }
}

std::vector<Search::Score> Search::score(std::size_t problem, const Fit& null,
                                         const PairNoise& noise) const {
  const Problem& data = study_.problems()[problem];
  const Cached& cached = cached_[problem];
  const Eigen::Index nuisance = free_count(null.terms);
  const Matrix base = normal_columns(problem, null.terms, null.terms, 0);
  const Matrix white_base = whitened(base, data.layout, noise);
  const Matrix white = whitened(cached.columns, cached.means, data.layout, noise);
  // Project out what is estimated anyway.
  const Eigen::MatrixXd base_gram = white_base.transpose() * white_base;
  const Eigen::MatrixXd cross = white_base.transpose() * white;
  const Solution nuisance_only =
      solve(base_gram.bottomRightCorner(nuisance, nuisance), base_gram.col(0).tail(nuisance));
  const Eigen::MatrixXd down = nuisance_only.covariance * cross.bottomRows(nuisance);
  std::vector<Score> scores;
  for (std::size_t i = 0; i < cached.candidates.size(); ++i) {
    const Eigen::Index first = cached.first[i];
    const Eigen::Index width = cached.width[i];
    const auto columns = white.middleCols(first, width);
    Eigen::MatrixXd gram = columns.transpose() * columns;
    Eigen::VectorXd right = cross.row(0).segment(first, width).transpose();
    const Eigen::VectorXd own = gram.diagonal();
    if (nuisance > 0) {
      gram -= cross.middleCols(first, width).bottomRows(nuisance).transpose() *
              down.middleCols(first, width);
      right -= down.middleCols(first, width).transpose() * base_gram.col(0).tail(nuisance);
    }
    // What the others can build almost wholly brings nothing.
    if (gram.diagonal().minCoeff() <= 1e-6 * own.maxCoeff()) continue;
    Score score{cached.candidates[i], 0.0};
    Effect& effect = score.candidate.term.effect;
    const Solution solution = solve(gram, right);
    score.statistic = solution.gain;
    if (effect.kind == Kind::kAngleHarmonic) {
      // a·cos(nθ) + b·cos(nθ + π/2)
      effect.parameters[1] = std::hypot(solution.x[0], solution.x[1]);
      effect.parameters[2] = std::atan2(solution.x[1], solution.x[0]);
    } else if (effect.kind == Kind::kBandwidth) {
      // Its size is not free: it is what a low-pass of this cut-off does.
      score.statistic = 2.0 * right[0] - gram(0, 0);
      if (solution.x[0] > 0.05) {
        // A weaker one is a higher cut-off, about in proportion.
        score.statistic = std::max(score.statistic, solution.gain);
        effect.parameters[0] /= std::clamp(solution.x[0], 0.2, 20.0);
      } else {
        score.statistic = 0.0;
      }
    } else {
      effect.parameters[score.candidate.term.free[0]] =
          is_linear(effect.kind, score.candidate.term.free[0])
              ? solution.x[0]
              : effect.parameters[0] + solution.x[0];
      if (effect.kind == Kind::kWarmUp)
        effect.parameters[1] = cached.candidates[i].term.effect.parameters[1];
    }
    keep_in_bounds(effect);
    scores.push_back(std::move(score));
  }
  const auto enough = [&](Kind kind, std::ptrdiff_t most) {
    return std::count_if(null.terms.begin(), null.terms.end(),
                         [&](const Term& term) { return term.effect.kind == kind; }) >= most;
  };
  if (!enough(Kind::kBiasStep, kStepsMax)) score_steps(problem, base, noise, scores);
  if (!enough(Kind::kLine, kLinesMax)) score_lines(problem, base.col(0), noise, scores);
  std::sort(scores.begin(), scores.end(),
            [](const Score& a, const Score& b) { return a.adjusted() > b.adjusted(); });
  return scores;
}

// Steps at places on an even grid, but none within a pause; judged by the means of blocks.
void Search::score_steps(std::size_t problem, const Matrix& base, const PairNoise& noise,
                         std::vector<Score>& scores) const {
  const Problem& data = study_.problems()[problem];
  const auto even = static_cast<int>(study_.recording().seconds / kStepEvery_s) - 1;
  std::vector<double> even_s;
  for (int i = 1; i <= even; ++i)
    even_s.push_back(kStepEvery_s * i);
  const std::vector<double> at_s = distinct_steps(data.layout, even_s);
  const auto places = static_cast<Eigen::Index>(at_s.size());
  if (places < 2) return;
  const Eigen::Index nuisance = base.cols() - 1;
  Matrix white_base = block_means(base, data.layout);
  whiten_means(white_base, data.layout, noise, Part::kFit);
  const Eigen::MatrixXd base_gram = white_base.transpose() * white_base;
  const Solution fixed =
      solve(base_gram.bottomRightCorner(nuisance, nuisance), base_gram.col(0).tail(nuisance));
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!data.holds[gyro]) continue;
    Matrix steps(static_cast<Eigen::Index>(data.layout.blocks.size()), places);
    for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
      const Block& block = data.layout.blocks[b];
      const double share = share_of(block.channel, gyro);
      for (Eigen::Index i = 0; i < places; ++i) {
        steps(static_cast<Eigen::Index>(b), i) =
            block.t_s >= at_s[static_cast<std::size_t>(i)] ? share : 0.0;
      }
    }
    whiten_means(steps, data.layout, noise, Part::kFit);
    const Eigen::MatrixXd cross = white_base.transpose() * steps;
    const Eigen::MatrixXd down = fixed.covariance * cross.bottomRows(nuisance);
    Score best;
    for (Eigen::Index i = 0; i < places; ++i) {
      double gram = steps.col(i).squaredNorm();
      double right = cross(0, i);
      const double own = gram;
      if (nuisance > 0) {
        gram -= cross.col(i).tail(nuisance).dot(down.col(i));
        right -= down.col(i).dot(base_gram.col(0).tail(nuisance));
      }
      if (gram <= 1e-4 * own || own <= 0.0) continue;
      const double statistic = right * right / gram;
      if (statistic <= best.statistic) continue;
      best.statistic = statistic;
      best.candidate.term = {
          Effect{gyro, Kind::kBiasStep, {right / gram, at_s[static_cast<std::size_t>(i)]}, 0}, {0}};
      best.candidate.penalty = 2.0 * std::log(static_cast<double>(places)) +
                               (study_.is_coarse(gyro) ? kCoarsePenalty : 0.0);
    }
    if (best.statistic > 0.0) scores.push_back(best);
  }
}

// The highest peak of the periodogram of what is left, for each gyro that shows.
void Search::score_lines(std::size_t problem, const Eigen::VectorXd& residual,
                         const PairNoise& noise, std::vector<Score>& scores) const {
  const Problem& data = study_.problems()[problem];
  const double interval_s = data.holds[0] ? data.layout.interval_s[0] : data.layout.interval_s[1];
  const double seconds = study_.recording().seconds;
  const auto length =
      static_cast<std::size_t>(std::pow(2.0, std::ceil(std::log2(2.0 * seconds / interval_s))));
  std::vector<double> series(length, 0.0);
  // Less a running mean, which is drift and not a line.
  double drift = 0.0;
  double weight_sum = 0.0;
  for (const Block& block : data.layout.blocks) {
    if (!counts(block, Part::kFit)) continue;
    const double variance = sample_variance(block, noise, data.layout);
    const double sign = block.channel == Channel::kGyro2 && data.holds[0] ? -1.0 : 1.0;
    const auto values = residual.segment(block.first, block.count);
    const double mean = sign * values.mean();
    if (weight_sum == 0.0) drift = mean;
    drift += 0.02 * (mean - drift);
    for (std::uint32_t i = 0; i < block.count; ++i) {
      const auto place = static_cast<std::size_t>(
          std::lround(std::max(0.0, data.t_s[block.first + i]) / interval_s));
      if (place >= length) continue;
      series[place] += (sign * values[static_cast<Eigen::Index>(i)] - drift) / variance;
      weight_sum += 1.0 / variance;
    }
  }
  if (weight_sum <= 0.0) return;
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, series);
  const double resolution_hz = 1.0 / (static_cast<double>(length) * interval_s);
  struct Peak {
    std::size_t at;
    double power;
  };
  std::vector<Peak> peaks;
  const auto first = static_cast<std::size_t>(kLineLow_hz / resolution_hz) + 1;
  for (std::size_t i = first; i + 1 < length / 2; ++i) {
    const double power = std::norm(spectrum[i]);
    if (power < std::norm(spectrum[i - 1]) || power < std::norm(spectrum[i + 1])) continue;
    peaks.push_back({i, power});
  }
  std::partial_sort(
      peaks.begin(),
      peaks.begin() + std::min<std::ptrdiff_t>(2, static_cast<std::ptrdiff_t>(peaks.size())),
      peaks.end(), [](const Peak& a, const Peak& b) { return a.power > b.power; });
  peaks.resize(std::min<std::size_t>(2, peaks.size()));
  for (const Peak& peak : peaks) {
    // A quick look before the exact one: |Σ w e exp|² · 2/Σw is χ² with two degrees.
    const double statistic = 2.0 * peak.power / weight_sum;
    const double penalty = 2.0 * std::log(0.5 * seconds / interval_s) + 6.0;
    if (statistic < penalty) continue;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!data.holds[gyro]) continue;
      const double frequency_hz = static_cast<double>(peak.at) * resolution_hz;
      Matrix columns(data.size(), 3);
      columns.col(0) = residual;
      const Effect sine{gyro, Kind::kLine, {frequency_hz, 1.0, 0.0}, 0};
      const Effect cosine{gyro, Kind::kLine, {frequency_hz, 1.0, 0.5 * std::numbers::pi}, 0};
      columns.col(1) = study_.contribution(data, gyro, {sine});
      columns.col(2) = study_.contribution(data, gyro, {cosine});
      const Matrix white = whitened(columns, data.layout, noise);
      const Eigen::MatrixXd gram = white.transpose() * white;
      const Solution solution = solve(gram.bottomRightCorner(2, 2), gram.col(0).tail(2));
      Score score;
      score.statistic = solution.gain;
      score.candidate.penalty = penalty;
      score.candidate.term = {Effect{gyro,
                                     Kind::kLine,
                                     {frequency_hz, std::hypot(solution.x[0], solution.x[1]),
                                      std::atan2(solution.x[1], solution.x[0])},
                                     0},
                              {0, 1, 2}};
      scores.push_back(std::move(score));
    }
  }
}

// The step's instant, by trying: the size is solved anew at each.
void Search::place_step(std::size_t problem, const Fit& null, Term& term, double reach_s,
                        double step_s) const {
  const Problem& data = study_.problems()[problem];
  const double middle_s = term.effect.parameters[1];
  const auto places = static_cast<Eigen::Index>(2.0 * reach_s / step_s) + 1;
  const Eigen::Index nuisance = free_count(null.terms);
  const Eigen::Index at = 1 + nuisance;
  Matrix columns = normal_columns(problem, null.terms, null.terms, places);
  for (Eigen::Index i = 0; i < places; ++i) {
    Effect effect = term.effect;
    effect.parameters = {1.0, std::max(0.0, middle_s - reach_s + step_s * static_cast<double>(i))};
    columns.col(at + i) = study_.contribution(data, term.effect.gyro, {effect});
  }
  const Matrix white = whitened(columns, data.layout, null.noise);
  const Eigen::MatrixXd gram = white.transpose() * white;
  double best = -1.0;
  for (Eigen::Index i = 0; i < places; ++i) {
    Eigen::MatrixXd part(1 + nuisance, 1 + nuisance);
    Eigen::VectorXd right(1 + nuisance);
    part.topLeftCorner(nuisance, nuisance) = gram.block(1, 1, nuisance, nuisance);
    part.topRightCorner(nuisance, 1) = gram.block(1, at + i, nuisance, 1);
    part.bottomLeftCorner(1, nuisance) = gram.block(at + i, 1, 1, nuisance);
    part(nuisance, nuisance) = gram(at + i, at + i);
    right.head(nuisance) = gram.col(0).segment(1, nuisance);
    right[nuisance] = gram(at + i, 0);
    const Solution solution = solve(part, right);
    if (solution.gain <= best) continue;
    best = solution.gain;
    term.effect.parameters = {solution.x[nuisance],
                              std::max(0.0, middle_s - reach_s + step_s * static_cast<double>(i))};
  }
}

std::vector<Found> Search::refit_best(std::size_t problem, const Fit& null, const PairNoise& start,
                                      const std::vector<Score>& scores, std::size_t most) const {
  std::vector<Found> list;
  std::vector<Reading> tried;
  for (const Score& score : scores) {
    if (list.size() >= most) break;
    const Effect& effect = score.candidate.term.effect;
    // Of several starts for one kind the best is enough, but harmonics and axes differ.
    const bool again = std::any_of(list.begin(), list.end(), [&](const Found& other) {
      const Effect& first = other.term.effect;
      const bool same_form =
          effect.kind != Kind::kAngleHarmonic && effect.kind != Kind::kGSensitivity;
      return first.kind == effect.kind && first.gyro == effect.gyro &&
             (same_form || first.parameters[0] == effect.parameters[0]) &&
             effect.kind != Kind::kLine;
    });
    if (again || score.statistic < 8.0) continue;
    Term term = score.candidate.term;
    if (term.effect.kind == Kind::kBiasStep) {
      place_step(problem, null, term, kStepReach_s, 0.25);
      place_step(problem, null, term, 0.25, 0.02);
    }
    std::vector<Term> terms = null.terms;
    terms.push_back(term);
    const Fit with = fit(problem, terms, start);
    Found found;
    found.term = with.terms.back();
    found.statistic = 2.0 * (with.log_likelihood - null.log_likelihood);
    found.penalty = score.candidate.penalty;
    list.push_back(std::move(found));
  }
  std::sort(list.begin(), list.end(), [](const Found& a, const Found& b) {
    return a.statistic - a.penalty > b.statistic - b.penalty;
  });
  return list;
}

// Interpolation leaves a thousandth of a great timing effect, which looks like another one, and
// without a reference, where the rate itself is made of late readings, like lines and noise too.
bool Search::is_left_of_timing(const Found& one) const {
  const Effect& effect = one.term.effect;
  const bool knows_rate = study_.recording().has_reference;
  const bool fast = is_timing(effect.kind) || effect.kind == Kind::kLine ||
                    effect.kind == Kind::kWhiteNoise || effect.kind == Kind::kRateNoise;
  if (knows_rate ? !is_timing(effect.kind) : !fast) return false;
  for (const Found& found : found_) {
    if (is_timing(found.term.effect.kind) &&
        (!knows_rate || found.term.effect.gyro == effect.gyro) &&
        one.statistic < kTimingLeaves * found.statistic) {
      return true;
    }
  }
  for (const Finding& finding : study_.findings()) {
    if (is_timing(effect.kind) && finding.effect.kind == Kind::kTimestampJitter &&
        finding.effect.gyro == effect.gyro && one.statistic < kJitterLeaves * finding.statistic) {
      return true;
    }
  }
  return false;
}

bool Search::add_round() {
  std::vector<Term> terms;
  for (const Found& found : found_)
    terms.push_back(found.term);
  std::optional<Found> best;
  std::vector<Score> timing;
  for (std::size_t problem = 0; problem < study_.problems().size(); ++problem) {
    const Fit null = fit(problem, terms_of_problem(terms, problem), noise_);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (study_.problems()[problem].holds[gyro]) noise_[gyro] = null.noise[gyro];
    }
    std::vector<Score> scores = score(problem, null, null.noise);
    for (const Score& one : scores) {
      if (is_timing(one.candidate.term.effect.kind)) timing.push_back(one);
    }
    if (scores.size() > kRefitsMax) scores.resize(3 * kRefitsMax);
    // Slow effects raise the fitted drift, which hides them: look with the model's noise too.
    PairNoise file = null.noise;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      file[gyro].walk_dps_rts = std::min(file[gyro].walk_dps_rts, file_noise_[gyro].walk_dps_rts);
      file[gyro].ratio_rthz = file_noise_[gyro].ratio_rthz;
      file[gyro].markov = file_noise_[gyro].markov;
      if (file_noise_[gyro].white_dps_rthz > 0.0)
        file[gyro].white_dps_rthz = file_noise_[gyro].white_dps_rthz;
    }
    std::vector<Score> more = score(problem, null, file);
    std::vector<Found> first = refit_best(problem, null, null.noise, scores, kRefitsMax);
    std::vector<Found> second = refit_best(problem, null, file, more, kRefitsMax);
    first.insert(first.end(), second.begin(), second.end());
    // Has the fitted noise grown beyond the model's?
    const Problem& data = study_.problems()[problem];
    bool modelled = true;
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      modelled = modelled && (!data.holds[gyro] || file_noise_[gyro].white_dps_rthz > 0.0);
    const double at_file = modelled ? log_likelihood(residual_of(problem, null.terms), data.layout,
                                                     file_noise_, Part::kFit)
                                    : null.log_likelihood;
    const bool grown = 2.0 * (null.log_likelihood - at_file) > kStatisticMin;
    for (Found& found : first) {
      if (grown) found.needed = kStatisticMinAgainstNoise;
      if (!best || found.margin() > best->margin()) best = found;
    }
  }
  if (!best || best->margin() < 0.0) return false;
  if (is_timing(best->term.effect.kind) && !study_.recording().has_reference)
    best = judge_timing(terms, *best, timing);
  if (is_left_of_timing(*best)) return false;
  found_.push_back(*best);
  settle();
  if (best->term.effect.kind == Kind::kBiasStep) place_again();
  return true;
}

// Without a reference the rate is a mean of readings, late ones among them: what is late, and how,
// is judged by the rate that each answer gives.
Found Search::judge_timing(const std::vector<Term>& terms, Found best,
                           const std::vector<Score>& scores) {
  std::vector<Found> rivals;
  std::vector<Reading> seen;
  for (const Score& score : scores) {  // the likeliest of each reading comes first
    const Effect& effect = score.candidate.term.effect;
    const Reading reading{effect.kind, effect.gyro};
    const bool again = std::any_of(seen.begin(), seen.end(), [&](const Reading& one) {
      return one.kind == reading.kind && one.gyro == reading.gyro;
    });
    if (again || score.adjusted() < 0.2 * scores.front().adjusted()) continue;
    seen.push_back(reading);
    std::vector<Term> with = terms;
    with.push_back(score.candidate.term);
    Fit fitted;
    for (int round = 0; round < 3; ++round) {
      study_.learn_motion(known_and(with));
      base_ = {study_.residual(study_.problems().front(), known_)};
      fitted = fit(0, with, noise_);
      with = fitted.terms;
    }
    Found rival = best;
    rival.term = with.back();
    rival.penalty = score.candidate.penalty;
    rival.statistic = 2.0 * fitted.log_likelihood;
    rivals.push_back(std::move(rival));
  }
  if (rivals.empty()) return best;
  std::sort(rivals.begin(), rivals.end(), [](const Found& a, const Found& b) {
    return a.statistic - a.penalty > b.statistic - b.penalty;
  });
  const Reading first{rivals.front().term.effect.kind, rivals.front().term.effect.gyro};
  // Which of two clocks is the wrong one, no reading says.
  if (first.kind == Kind::kClockSkew) best.ambiguous_with.push_back({first.kind, 1 - first.gyro});
  const double most = rivals.front().statistic - rivals.front().penalty;
  const double gain = best.statistic - best.penalty;
  best.term = rivals.front().term;
  best.penalty = rivals.front().penalty;
  for (const Found& rival : rivals) {
    const Effect& effect = rival.term.effect;
    const bool other_clock = first.kind == Kind::kClockSkew && effect.kind == Kind::kClockSkew;
    if (&rival != &rivals.front() && !other_clock &&
        rival.statistic - rival.penalty > most - kLead - kLeadShare * gain) {
      best.ambiguous_with.push_back({effect.kind, effect.gyro});
    }
  }
  return best;
}

// All found terms together, with their noise.
void Search::settle() {
  std::vector<Term> terms;
  for (const Found& found : found_)
    terms.push_back(found.term);
  if (!study_.recording().has_reference) {
    study_.learn_motion(known_and(terms));
    cache_candidates();
  }
  for (std::size_t problem = 0; problem < study_.problems().size(); ++problem) {
    Fit all = fit(problem, terms_of_problem(terms, problem), noise_);
    const PairNoise fitted = all.noise;
    // A drift that happened to be small once is no smaller than the model says: values and their
    // errors would seem surer than they are.
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      all.noise[gyro].walk_dps_rts =
          std::max(all.noise[gyro].walk_dps_rts, file_noise_[gyro].walk_dps_rts);
    }
    improve(problem, all);
    std::size_t place = 0;
    Eigen::Index row = 0;
    for (Found& found : found_) {
      if (study_.problem_of(found.term.effect.gyro) != problem) continue;
      found.term = all.terms[place++];
      tidy_phase(found.term.effect);
      for (const std::size_t parameter : found.term.free) {
        found.sigma[parameter] = std::sqrt(std::max(0.0, all.covariance(row, row)));
        ++row;
      }
    }
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (study_.problems()[problem].holds[gyro]) noise_[gyro] = fitted[gyro];
    }
  }
}

// A step's instant, now that the noise is known that is left with it. What was set aside about it
// is needed to see it.
void Search::place_again() {
  bool any = false;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    Effect& effect = found_[i].term.effect;
    if (effect.kind != Kind::kBiasStep) continue;
    const std::size_t problem = study_.problem_of(effect.gyro);
    study_.use_for_fit(effect.parameters[1] - kStepReach_s, effect.parameters[1] + kStepReach_s);
    std::vector<Term> others;
    for (std::size_t j = 0; j < found_.size(); ++j) {
      if (j != i) others.push_back(found_[j].term);
    }
    const Fit null{terms_of_problem(others, problem), noise_, 0.0, {}};
    place_step(problem, null, found_[i].term, kStepReach_s, 0.25);
    place_step(problem, null, found_[i].term, 0.25, 0.02);
    any = true;
  }
  if (any) settle();
}

// Each found effect against all others in its place.
void Search::replace_round() {
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const std::size_t problem = study_.problem_of(found_[i].term.effect.gyro);
    std::vector<Term> terms;
    for (std::size_t j = 0; j < found_.size(); ++j) {
      if (j != i) terms.push_back(found_[j].term);
    }
    const Fit null = fit(problem, terms_of_problem(terms, problem), noise_);
    std::vector<Score> scores = score(problem, null, noise_);
    std::vector<Term> with = null.terms;
    with.push_back(found_[i].term);
    const Fit own = fit(problem, with, noise_);
    const double statistic = 2.0 * (own.log_likelihood - null.log_likelihood);
    found_[i].statistic = statistic;
    if (is_timing(found_[i].term.effect.kind) && !study_.recording().has_reference) continue;
    found_[i].ambiguous_with.clear();
    std::vector<Score> rivals;
    const Effect& effect = found_[i].term.effect;
    for (const Score& score : scores) {
      const Effect& other = score.candidate.term.effect;
      if (other.kind == effect.kind && other.gyro == effect.gyro &&
          other.kind != Kind::kAngleHarmonic && other.kind != Kind::kGSensitivity) {
        continue;
      }
      if (score.adjusted() > 0.5 * (statistic - found_[i].penalty) - 10.0) rivals.push_back(score);
    }
    const std::vector<Found> others = refit_best(problem, null, noise_, rivals, 6);
    const double own_adjusted = statistic - found_[i].penalty;
    bool replaced = false;
    for (const Found& other : others) {
      const double adjusted = other.statistic - other.penalty;
      if (other.term.effect.kind == effect.kind && other.term.effect.gyro == effect.gyro) continue;
      if (!replaced && adjusted > own_adjusted + 0.5) {
        const Reading reading{effect.kind, effect.gyro};
        Found better = other;
        better.needed = found_[i].needed;
        if (own_adjusted > adjusted - kLead - kLeadShare * adjusted)
          better.ambiguous_with.push_back(reading);
        found_[i] = std::move(better);
        replaced = true;
        continue;
      }
      const double best = replaced ? found_[i].statistic - found_[i].penalty : own_adjusted;
      if (adjusted > best - kLead - kLeadShare * best) {
        found_[i].ambiguous_with.push_back({other.term.effect.kind, other.term.effect.gyro});
      }
    }
    if (replaced) settle();
  }
}

void Search::delete_backward() {
  for (std::size_t i = 0; i < found_.size();) {
    if (found_[i].margin() >= -4.0) {
      ++i;
      continue;
    }
    found_.erase(found_.begin() + static_cast<std::ptrdiff_t>(i));
    settle();
    replace_round();
    i = 0;
  }
}

Search::Change Search::change_over_time(std::size_t index) const {
  const Term& term = found_[index].term;
  const std::size_t problem = study_.problem_of(term.effect.gyro);
  const Problem& data = study_.problems()[problem];
  std::vector<Term> terms;
  std::vector<Term> others;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    if (study_.problem_of(found_[i].term.effect.gyro) != problem) continue;
    terms.push_back(found_[i].term);
    if (i != index) others.push_back(found_[i].term);
  }
  Matrix shape = columns_of(data, term);
  const Eigen::Index width = shape.cols();
  // Parts of about equal information.
  const Matrix white_shape = whitened(shape, data.layout, noise_);
  std::vector<std::pair<double, double>> information;
  for (std::size_t b = 0; b < data.layout.blocks.size(); ++b) {
    const Block& block = data.layout.blocks[b];
    const double sum = white_shape.middleRows(block.first, block.count).squaredNorm() +
                       white_shape.row(data.size() + static_cast<Eigen::Index>(b)).squaredNorm();
    information.emplace_back(block.t_s, sum);
  }
  std::sort(information.begin(), information.end());
  double total = 0.0;
  for (const auto& [t_s, sum] : information)
    total += sum;
  std::vector<double> ends_s;
  double so_far = 0.0;
  for (const auto& [t_s, sum] : information) {
    so_far += sum;
    if (so_far >= total * static_cast<double>(ends_s.size() + 1) / kParts) ends_s.push_back(t_s);
  }
  ends_s.resize(kParts, 1e300);
  ends_s.back() = 1e300;
  const Eigen::Index at = 1 + free_count(others);
  Matrix columns = normal_columns(problem, terms, others, kParts * width);
  for (Eigen::Index i = 0; i < data.size(); ++i) {
    const double t_s = data.t_s[static_cast<std::size_t>(i)];
    const auto part = std::lower_bound(ends_s.begin(), ends_s.end(), t_s) - ends_s.begin();
    columns.row(i).segment(at + static_cast<Eigen::Index>(part) * width, width) = shape.row(i);
  }
  const Matrix white = whitened(columns, data.layout, noise_);
  const Eigen::MatrixXd gram = white.transpose() * white;
  const Eigen::Index all = gram.rows() - 1;
  const double with = solve(gram.bottomRightCorner(all, all), gram.col(0).tail(all)).gain;
  return {with, static_cast<double>((kParts - 1) * width)};
}

// What is in the catalogue keeps its size throughout; what only resembles it does not.
void Search::reject_unsteady() {
  std::vector<bool> wrong(found_.size(), false);
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const Effect& effect = found_[i].term.effect;
    if (effect.kind == Kind::kWarmUp || effect.kind == Kind::kBiasStep) continue;
    const Change change = change_over_time(i);
    const double chance = change.freedom + 4.5 * std::sqrt(2.0 * change.freedom) + 10.0;
    wrong[i] = change.statistic > chance && change.statistic > 0.04 * found_[i].statistic;
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    // A handful of steps, or two that cancel, is a shape that comes and goes.
    std::vector<std::size_t> steps;
    for (std::size_t i = 0; i < found_.size(); ++i) {
      const Effect& effect = found_[i].term.effect;
      if (effect.gyro == gyro && effect.kind == Kind::kBiasStep) steps.push_back(i);
    }
    bool cancel = false;
    for (const std::size_t i : steps) {
      for (const std::size_t j : steps) {
        const double sum =
            found_[i].term.effect.parameters[0] + found_[j].term.effect.parameters[0];
        const double sigma = std::hypot(found_[i].sigma[0], found_[j].sigma[0]);
        const double size = std::abs(found_[i].term.effect.parameters[0]);
        cancel = cancel || (i != j && std::abs(sum) < std::max(3.0 * sigma, 0.1 * size));
      }
    }
    if (cancel || steps.size() >= static_cast<std::size_t>(kStepsMax)) {
      for (const std::size_t i : steps)
        wrong[i] = true;
    }
    std::vector<std::size_t> lines;
    for (std::size_t i = 0; i < found_.size(); ++i) {
      const Effect& effect = found_[i].term.effect;
      if (effect.gyro == gyro && effect.kind == Kind::kLine) lines.push_back(i);
    }
    if (lines.size() >= static_cast<std::size_t>(kLinesMax)) {
      for (const std::size_t i : lines)
        wrong[i] = true;
    }
  }
  if (std::none_of(wrong.begin(), wrong.end(), [](bool one) { return one; })) return;
  std::vector<Found> kept;
  for (std::size_t i = 0; i < found_.size(); ++i)
    (wrong[i] ? rejected_ : kept).push_back(found_[i]);
  found_ = std::move(kept);
  settle();
}

// Noise beyond what the model says: one term of one gyro free at a time, the others as they are.
void Search::noise_rounds() {
  for (int round = 0; round < 6; ++round) {
    std::vector<Term> terms;
    for (const Found& found : found_) {
      if (!is_noise(found)) terms.push_back(found.term);
    }
    std::optional<Found> best;
    std::vector<std::pair<double, Reading>> rivals;
    PairNoise best_noise = file_noise_;
    for (std::size_t problem = 0; problem < study_.problems().size(); ++problem) {
      const Problem& data = study_.problems()[problem];
      const Eigen::VectorXd residual = residual_of(problem, terms_of_problem(terms, problem));
      const double base = log_likelihood(residual, data.layout, file_noise_, Part::kFit);
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        // What is left of something unknown is no noise.
        const bool unknown = std::any_of(rejected_.begin(), rejected_.end(), [&](const Found& one) {
          return one.term.effect.gyro == gyro || study_.problems().size() == 1;
        });
        if (!data.holds[gyro] || unknown || study_.is_coarse(gyro)) continue;
        for (const Kind kind :
             {Kind::kWhiteNoise, Kind::kRateNoise, Kind::kRateRandomWalk, Kind::kGaussMarkov}) {
          std::array<Freedom, 2> free;
          free[0] = free[1] = {false, false, false, false};
          free[gyro] = {kind == Kind::kWhiteNoise, kind == Kind::kRateNoise,
                        kind == Kind::kRateRandomWalk, kind == Kind::kGaussMarkov};
          if (kind == Kind::kGaussMarkov && file_noise_[gyro].markov.size() >= kMarkovMax) continue;
          const NoiseFitResult with =
              fit_pair_noise(residual, data.layout, file_noise_, free, data.holds, Part::kFit);
          Found found;
          found.statistic = 2.0 * (with.log_likelihood - base);
          found.penalty = kind == Kind::kGaussMarkov ? 6.0 : 0.0;
          Effect& effect = found.term.effect;
          effect.gyro = gyro;
          effect.kind = kind;
          const NoiseTerms& now = with.noise[gyro];
          const NoiseTerms& then = file_noise_[gyro];
          const auto beyond = [](double a, double b) {
            return std::sqrt(std::max(0.0, a * a - b * b));
          };
          double total = 0.0;
          switch (kind) {
            case Kind::kWhiteNoise:
              effect.parameters[0] = beyond(now.white_dps_rthz, then.white_dps_rthz);
              total = now.white_dps_rthz;
              break;
            case Kind::kRateNoise:
              effect.parameters[0] = beyond(now.ratio_rthz, then.ratio_rthz);
              total = now.ratio_rthz;
              break;
            case Kind::kRateRandomWalk:
              effect.parameters[0] = beyond(now.walk_dps_rts, then.walk_dps_rts);
              total = now.walk_dps_rts;
              break;
            default:
              effect.parameters = {now.markov.back().sigma_dps, now.markov.back().tau_s};
              total = now.markov.back().sigma_dps;
              break;
          }
          if (effect.parameters[0] <= 0.0) continue;
          // Curvature of the likelihood over the logarithms, by differences; a correlated term's
          // size and memory go together.
          const auto at = [&](double first, double second) {
            PairNoise trial = with.noise;
            if (kind == Kind::kWhiteNoise) trial[gyro].white_dps_rthz *= std::exp(first);
            if (kind == Kind::kRateNoise) trial[gyro].ratio_rthz *= std::exp(first);
            if (kind == Kind::kRateRandomWalk) trial[gyro].walk_dps_rts *= std::exp(first);
            if (kind == Kind::kGaussMarkov) {
              trial[gyro].markov.back().sigma_dps *= std::exp(first);
              trial[gyro].markov.back().tau_s *= std::exp(second);
            }
            return log_likelihood(residual, data.layout, trial, Part::kFit);
          };
          const double h = kind == Kind::kWhiteNoise ? 0.005 : 0.1;
          const double top = at(0.0, 0.0);
          const auto relative = [](double curvature) {
            return curvature > 0.0 ? 1.0 / std::sqrt(curvature) : 1.0;
          };
          double of_first = -(at(h, 0.0) - 2.0 * top + at(-h, 0.0)) / (h * h);
          if (kind == Kind::kGaussMarkov) {
            const double of_second = -(at(0.0, h) - 2.0 * top + at(0.0, -h)) / (h * h);
            const double of_both = -(at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h * h);
            const double determinant = of_first * of_second - of_both * of_both;
            found.sigma[1] = relative(determinant / of_first) * effect.parameters[1];
            of_first = determinant / of_second;
          }
          // d(beyond)/d(total) = total/beyond
          found.sigma[0] = relative(of_first) * total * total / effect.parameters[0];
          rivals.push_back({found.statistic - found.penalty, {kind, gyro}});
          if (!best || found.statistic - found.penalty > best->statistic - best->penalty) {
            best = found;
            best_noise = with.noise;
          }
        }
      }
    }
    if (!best || best->statistic - best->penalty < kNoiseMin) return;
    if (is_left_of_timing(*best)) return;
    for (const auto& [adjusted, reading] : rivals) {
      if (reading.kind == best->term.effect.kind && reading.gyro == best->term.effect.gyro)
        continue;
      if (adjusted > best->statistic - best->penalty - kLead)
        best->ambiguous_with.push_back(reading);
    }
    const Effect& effect = best->term.effect;
    if (effect.kind == Kind::kGaussMarkov &&
        effect.parameters[1] > study_.recording().seconds / 16.0) {
      // Of what has hardly forgotten yet nobody can say that it ever will.
      best->ambiguous_with.push_back({Kind::kRateRandomWalk, effect.gyro});
    }
    found_.push_back(*best);
    file_noise_[best->term.effect.gyro] = best_noise[best->term.effect.gyro];
  }
}

// Names that were taken because noise beyond the model's was no better: now that such noise has a
// name beside them, they must stand by themselves. A small line in much drift is a part of it.
bool Search::reject_beside_noise() {
  std::vector<Found> kept;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const Effect& effect = found_[i].term.effect;
    double drift = 0.0;
    for (const Found& other : found_) {
      if (other.term.effect.gyro == effect.gyro && is_drift(other.term.effect.kind))
        drift += other.statistic;
    }
    if (drift == 0.0 || found_[i].needed >= kStatisticMin) {
      kept.push_back(found_[i]);
      continue;
    }
    const double statistic = statistic_beside(i);
    if (effect.kind == Kind::kLine && statistic < kLineShare * drift) {
      rejected_.push_back(found_[i]);
    } else if (statistic - found_[i].penalty >= kStatisticMin) {
      kept.push_back(found_[i]);
    }
  }
  if (kept.size() == found_.size()) return false;
  found_ = std::move(kept);
  return true;
}

// Of one found effect, beside all others and the noise with what was named.
double Search::statistic_beside(std::size_t index) const {
  const std::size_t problem = study_.problem_of(found_[index].term.effect.gyro);
  std::vector<Term> with;
  std::vector<Term> without;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    if (is_noise(found_[i])) continue;
    if (study_.problem_of(found_[i].term.effect.gyro) != problem) continue;
    with.push_back(found_[i].term);
    if (i != index) without.push_back(found_[i].term);
  }
  const auto fitted = [&](std::vector<Term> terms) {
    Fit fit{std::move(terms), file_noise_, 0.0, {}};
    improve(problem, fit);
    return log_likelihood(residual_of(problem, fit.terms), study_.problems()[problem].layout,
                          fit.noise, Part::kFit);
  };
  return 2.0 * (fitted(std::move(with)) - fitted(std::move(without)));
}

void Search::run() {
  cache_candidates();
  const auto tell = [&](std::string_view what, double share) {
    if (progress) progress(what, share);
  };
  for (std::size_t round = 0; round < kFoundMax; ++round) {
    tell("scoring candidates",
         0.1 + 0.6 * static_cast<double>(round) / (static_cast<double>(round) + 2.0));
    if (!add_round()) break;
    if (found_.size() > 1) replace_round();
  }
  tell("weighing rivals", 0.75);
  place_again();
  replace_round();
  delete_backward();
  reject_unsteady();
  tell("fitting the noise", 0.85);
  const PairNoise model_noise = file_noise_;
  noise_rounds();
  while (reject_beside_noise()) {
    found_.erase(std::remove_if(found_.begin(), found_.end(), is_noise), found_.end());
    file_noise_ = model_noise;
    settle();
    noise_rounds();
  }
}

}  // namespace vgyro::gap
