#include "gap/scan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "gap/periodogram.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

constexpr double kQuarterTurn = 0.5 * std::numbers::pi;
// Rounding of slow readings looks like any slow effect.
constexpr double kCoarsePenalty = 1000.0;
// What the others can build but for this share of its square brings nothing of its own. A step's
// columns are means alone, and the drift builds most of them.
constexpr double kOwnShareMin = 1e-6;
constexpr double kOwnStepShareMin = 1e-4;
// Less of a low-pass than this is none; how far the cut-off may be moved at once.
constexpr double kLowPassMin = 0.05;
constexpr double kCutoffFactorMin = 0.2;
constexpr double kCutoffFactorMax = 20.0;
constexpr double kStepEvery_s = 2.0;
// First coarsely, then to what stamps of slow gyros can tell.
constexpr double kStepCoarse_s = 0.25;
constexpr double kStepFine_s = 0.02;
constexpr std::size_t kPeaks = 2;
// Amplitude, phase and frequency between the grid's.
constexpr double kLinePenalty = 6.0;

// Normal equations of one shape, less what is fitted anyway.
struct Reduced {
  Eigen::MatrixXd gram;
  Eigen::VectorXd right;
};

// `cross`: products of the base's columns, the residual first, with the shape's.
Reduced reduce(const Eigen::MatrixXd& own, const Eigen::MatrixXd& cross,
               const Eigen::MatrixXd& base_gram, const Eigen::MatrixXd& nuisance_covariance) {
  Reduced reduced{own, cross.row(0).transpose()};
  const Eigen::Index nuisance = base_gram.rows() - 1;
  if (nuisance == 0) return reduced;
  const Eigen::MatrixXd down = nuisance_covariance * cross.bottomRows(nuisance);
  reduced.gram -= cross.bottomRows(nuisance).transpose() * down;
  reduced.right -= down.transpose() * base_gram.col(0).tail(nuisance);
  return reduced;
}

// A low-pass is there or not: its size is not free. A weaker one is a higher cut-off, about in
// proportion.
void take_low_pass(const Reduced& reduced, const Solution& solution, Score& score) {
  score.statistic = 0.0;
  const double size = solution.x[0];
  if (size <= kLowPassMin) return;
  score.statistic = std::max(2.0 * reduced.right[0] - reduced.gram(0, 0), solution.gain);
  score.effect.parameters[0] /= std::clamp(size, kCutoffFactorMin, kCutoffFactorMax);
}

// a·cos(x) + b·cos(x + π/2), or the same with sines.
void take_wave(const Eigen::VectorXd& x, Effect& effect) {
  effect.parameters[1] = std::hypot(x[0], x[1]);
  effect.parameters[2] = std::atan2(x[1], x[0]);
}

void take(const Reduced& reduced, Score& score) {
  const Solution solution = solve(reduced.gram, reduced.right);
  score.statistic = solution.gain;
  const KindRow& its = row(score.effect.kind);
  switch (its.form) {
    case Form::kWave:
      return take_wave(solution.x, score.effect);
    case Form::kLowPass:
      return take_low_pass(reduced, solution, score);
    case Form::kSize:
      score.effect.parameters[(*its.free)[0].parameter] = solution.x[0];
      return;
    case Form::kShift:
      score.effect.parameters[(*its.free)[0].parameter] += solution.x[0];
      return;
    case Form::kNone:
      return;
  }
}

bool enough(const Effects& terms, Kind kind) {
  const std::size_t most = row(kind).most;
  const auto same = [&](const Effect& term) { return term.kind == kind; };
  return most > 0 &&
         std::count_if(terms.begin(), terms.end(), same) >= static_cast<std::ptrdiff_t>(most);
}

}  // namespace

bool could_show(const Observations& data, const Effect& effect) {
  if (!data.holds[effect.gyro] || !data.excitation[effect.gyro].moves(needs_of(effect)))
    return false;
  const auto& signals = data.about.signals[effect.gyro];
  if (row(effect.kind).by_turns && signals &&
      signals->temperature_step_c >= Signals::kCoarseTemperature_c)
    return false;
  const auto limits = *row(effect.kind).limits;
  return std::all_of(limits.begin(), limits.end(), [&](const Limit& limit) {
    return effect.parameters[limit.parameter] < data.most_of(limit, effect.gyro);
  });
}

std::vector<double> distinct_steps(const Layout& layout, const std::vector<double>& at_s) {
  std::vector<double> block_s;
  block_s.reserve(layout.blocks.size());
  for (const Block& block : layout.blocks)
    block_s.push_back(block.t_s);
  std::sort(block_s.begin(), block_s.end());
  std::vector<double> distinct;
  auto next = block_s.begin();
  for (const double at : at_s) {
    if (next == block_s.end()) break;
    if (*next >= at) continue;
    distinct.push_back(at);
    next = std::lower_bound(next, block_s.end(), at);
  }
  return distinct;
}

double Scan::penalty_of(const Effect& effect, double penalty) const {
  return penalty + (regression_.data().about.coarse[effect.gyro] ? kCoarsePenalty : 0.0);
}

Scan::Scan(const Regression& regression, const Effects& beside) : regression_(regression) {
  const Observations& data = regression.data();
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    add_shapes(gyro);
  const Effects others = regression.with_known(beside);
  const Eigen::Index width = shapes_.empty() ? 0 : shapes_.back().first + shapes_.back().width;
  columns_.resize(data.size(), width);
  means_.resize(static_cast<Eigen::Index>(data.layout.blocks.size()), width);
  for (const Shape& shape : shapes_) {
    Matrix columns = columns_of(shape.effect, others);
    means_.middleCols(shape.first, shape.width) = block_means(columns, data.layout);
    turn_within(columns, data.layout);
    columns_.middleCols(shape.first, shape.width) = columns.cast<float>();
  }
}

void Scan::add_shapes(std::size_t gyro) {
  for (const KindRow& its : kinds()) {
    if (its.finder != Finder::kShape) continue;
    for (const model::Parameters& start : *its.starts) {
      const Effect effect{gyro, its.kind, start, 0};
      if (!could_show(regression_.data(), effect)) continue;
      const Eigen::Index first = shapes_.empty() ? 0 : shapes_.back().first + shapes_.back().width;
      shapes_.push_back({effect, first, its.form == Form::kWave ? 2 : 1});
    }
  }
}

// What one shape of size 1 adds to what is observed.
Matrix Scan::columns_of(const Effect& effect, const Effects& beside) const {
  const Observations& data = regression_.data();
  const KindRow& its = row(effect.kind);
  Matrix columns(data.size(), its.form == Form::kWave ? 2 : 1);
  if (its.form == Form::kSize || its.form == Form::kShift) {
    columns.col(0) = data.derivative(beside, effect, (*its.free)[0]);
    return columns;
  }
  columns.col(0) = data.contribution_beside(beside, effect);
  if (its.form != Form::kWave) return columns;
  Effect quadrature = effect;
  quadrature.parameters[2] += kQuarterTurn;
  columns.col(1) = data.contribution_beside(beside, quadrature);
  return columns;
}

Scan::Base Scan::base_of(const Fit& null, const PairNoise& noise) const {
  Base base;
  base.columns = regression_.columns(null.terms);
  base.white = regression_.whitened(base.columns, noise);
  base.gram = base.white.transpose() * base.white;
  return base;
}

std::vector<Score> Scan::scores(const Fit& null, const PairNoise& noise) const {
  const Base base = base_of(null, noise);
  std::vector<Score> scores;
  score_shapes(base, noise, scores);
  // In several recordings no instant comes twice, and no phase is kept.
  const bool is_one = regression_.data().is_one();
  if (is_one && !enough(null.terms, Kind::kBiasStep)) score_steps(base, noise, scores);
  if (is_one && !enough(null.terms, Kind::kLine)) score_lines(base, noise, scores);
  std::sort(scores.begin(), scores.end(),
            [](const Score& a, const Score& b) { return a.adjusted() > b.adjusted(); });
  return scores;
}

void Scan::score_shapes(const Base& base, const PairNoise& noise,
                        std::vector<Score>& scores) const {
  const Layout& layout = regression_.data().layout;
  Matrix means = means_;
  whiten_means(means, layout, noise, regression_.part());
  Matrix weighted = base.columns;
  turn_within(weighted, layout);
  const Eigen::VectorXd weights = within_weights(layout, noise, regression_.part());
  weighted.array().colwise() *= weights.array();
  const FloatMatrix light = weighted.cast<float>();
  const Eigen::MatrixXd cross = (light.transpose() * columns_).cast<double>() +
                                base.white.bottomRows(means.rows()).transpose() * means;
  const Eigen::VectorXf light_weights = weights.cast<float>();
  const Solution nuisance = explain_first(base.gram);
  for (const Shape& shape : shapes_) {
    const auto columns = columns_.middleCols(shape.first, shape.width);
    const auto of_means = means.middleCols(shape.first, shape.width);
    const Eigen::MatrixXd own =
        (columns.transpose() * light_weights.asDiagonal() * columns).cast<double>() +
        of_means.transpose() * of_means;
    const Reduced reduced =
        reduce(own, cross.middleCols(shape.first, shape.width), base.gram, nuisance.covariance);
    if (reduced.gram.diagonal().minCoeff() <= kOwnShareMin * own.diagonal().maxCoeff()) continue;
    Score score{shape.effect, 0.0, penalty_of(shape.effect, row(shape.effect.kind).penalty)};
    take(reduced, score);
    regression_.keep_in_bounds(score.effect);
    scores.push_back(std::move(score));
  }
}

// Steps at places on an even grid, but none within a pause; judged by the means of blocks.
void Scan::score_steps(const Base& base, const PairNoise& noise, std::vector<Score>& scores) const {
  const Observations& data = regression_.data();
  std::vector<double> even_s;
  const auto even = static_cast<int>(data.about.seconds / kStepEvery_s) - 1;
  for (int i = 1; i <= even; ++i)
    even_s.push_back(kStepEvery_s * i);
  const std::vector<double> at_s = distinct_steps(data.layout, even_s);
  if (at_s.size() < 2) return;
  Matrix white_base = block_means(base.columns, data.layout);
  whiten_means(white_base, data.layout, noise, regression_.part());
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!data.holds[gyro]) continue;
    Score best = best_step(gyro, at_s, white_base, noise);
    if (best.statistic > 0.0) scores.push_back(std::move(best));
  }
}

Score Scan::best_step(std::size_t gyro, const std::vector<double>& at_s, const Matrix& white_base,
                      const PairNoise& noise) const {
  const Layout& layout = regression_.data().layout;
  const auto places = static_cast<Eigen::Index>(at_s.size());
  Matrix steps(static_cast<Eigen::Index>(layout.blocks.size()), places);
  for (std::size_t b = 0; b < layout.blocks.size(); ++b) {
    const Block& block = layout.blocks[b];
    const double share = share_of(block.channel, gyro);
    for (Eigen::Index i = 0; i < places; ++i) {
      steps(static_cast<Eigen::Index>(b), i) =
          block.t_s >= at_s[static_cast<std::size_t>(i)] ? share : 0.0;
    }
  }
  whiten_means(steps, layout, noise, regression_.part());
  const Eigen::MatrixXd base_gram = white_base.transpose() * white_base;
  const Solution nuisance = explain_first(base_gram);
  const Eigen::MatrixXd cross = white_base.transpose() * steps;
  Score best;
  for (Eigen::Index i = 0; i < places; ++i) {
    const Eigen::MatrixXd own = Eigen::MatrixXd::Constant(1, 1, steps.col(i).squaredNorm());
    const Reduced reduced = reduce(own, cross.col(i), base_gram, nuisance.covariance);
    const double gram = reduced.gram(0, 0);
    if (gram <= kOwnStepShareMin * own(0, 0) || own(0, 0) <= 0.0) continue;
    const double statistic = reduced.right[0] * reduced.right[0] / gram;
    if (statistic <= best.statistic) continue;
    best.statistic = statistic;
    best.effect = {
        gyro, Kind::kBiasStep, {reduced.right[0] / gram, at_s[static_cast<std::size_t>(i)]}, 0};
  }
  best.penalty = penalty_of(best.effect, 2.0 * std::log(static_cast<double>(places)));
  return best;
}

// The highest peaks of the periodogram of what is left, for each gyro that shows.
void Scan::score_lines(const Base& base, const PairNoise& noise, std::vector<Score>& scores) const {
  const Observations& data = regression_.data();
  const Eigen::VectorXd residual = base.columns.col(0);
  const Periodogram periodogram = periodogram_of(data, residual, noise, regression_.part());
  const double penalty = 2.0 * std::log(periodogram.frequencies) + kLinePenalty;
  for (const Periodogram::Peak& peak : highest_peaks(periodogram, kPeaks)) {
    // A quick look before the exact one.
    if (peak.statistic < penalty) continue;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (data.holds[gyro])
        scores.push_back(line_at(peak.frequency_hz, gyro, penalty, residual, noise));
    }
  }
}

Score Scan::line_at(double frequency_hz, std::size_t gyro, double penalty,
                    const Eigen::VectorXd& residual, const PairNoise& noise) const {
  const Effect sine{gyro, Kind::kLine, {frequency_hz, 1.0, 0.0}, 0};
  Matrix columns(residual.size(), 3);
  columns.col(0) = residual;
  columns.rightCols(2) = columns_of(sine, {});
  const Matrix white = regression_.whitened(columns, noise);
  const Solution solution = explain_first(white.transpose() * white);
  Score score{sine, solution.gain, penalty};
  take_wave(solution.x, score.effect);
  return score;
}

namespace {

// By trying: the size is solved anew at each instant.
Effect placed(const Regression& regression, const Fit& null, const Effect& step, double reach_s,
              double every_s) {
  const Observations& data = regression.data();
  const auto places = static_cast<Eigen::Index>(2.0 * reach_s / every_s) + 1;
  const auto place_s = [&](Eigen::Index i) {
    return std::max(0.0, step.parameters[1] - reach_s + every_s * static_cast<double>(i));
  };
  Matrix columns = regression.columns(null.terms, places);
  const Eigen::Index at = columns.cols() - places;
  for (Eigen::Index i = 0; i < places; ++i) {
    Effect unit = step;
    unit.parameters = {1.0, place_s(i)};
    columns.col(at + i) = data.contribution(step.gyro, {unit});
  }
  const Matrix white = regression.whitened(columns, null.noise);
  const Eigen::MatrixXd gram = white.transpose() * white;
  Effect best = step;
  double best_gain = -1.0;
  std::vector<Eigen::Index> used;
  for (Eigen::Index i = 0; i < at; ++i)
    used.push_back(i);
  used.push_back(at);
  for (Eigen::Index i = 0; i < places; ++i) {
    used.back() = at + i;
    const Solution solution = explain_first(gram(used, used));
    if (solution.gain <= best_gain) continue;
    best_gain = solution.gain;
    best.parameters = {solution.x[at - 1], place_s(i)};
  }
  return best;
}

}  // namespace

Effect placed(const Regression& regression, const Fit& null, const Effect& step) {
  const Effect coarse = placed(regression, null, step, kStepReach_s, kStepCoarse_s);
  return placed(regression, null, coarse, kStepCoarse_s, kStepFine_s);
}

}  // namespace vgyro::gap
