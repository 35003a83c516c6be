#include "gap/differences.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

#include <Eigen/Cholesky>
#include <fmt/core.h>
#include <unsupported/Eigen/FFT>

#include "gap/candidates.h"
#include "gap/median.h"
#include "gap/views.h"
#include "model/catalogue.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

/// 2·ΔlogL, less what looking in many places brings by chance.
constexpr double kBeyondChance = 15.0;
constexpr std::size_t kDifferencesMax = 12;
constexpr std::size_t kChosenMax = 8;
constexpr std::size_t kLinesMax = 3;
constexpr double kStepEvery_s = 4.0;
constexpr double kLoudCell_s = 5.0;
constexpr std::size_t kLoudCellsMax = 150;
constexpr double kNoiseTermsPenalty = 8.0;
constexpr double kColourMin = 0.1;
constexpr double kLoudByLag = 3.0;
constexpr double kLagStep_s = 0.03;
constexpr int kSkewSteps = 16;

std::string_view against_word(Kind kind) {
  switch (kind) {
    case Kind::kTemperatureBias:
    case Kind::kTemperatureBiasQuadratic:
    case Kind::kTemperatureRateBias:
    case Kind::kScaleFactorTemperature:
      return "temperature";
    case Kind::kScaleFactor:
    case Kind::kScaleFactorAsymmetry:
    case Kind::kScaleFactorQuadratic:
    case Kind::kScaleFactorCubic:
      return "rate";
    case Kind::kGSensitivity:
    case Kind::kVibrationRectification:
      return "acceleration";
    case Kind::kDelay:
    case Kind::kBandwidth:
      return "rate_slope";
    case Kind::kClockSkew:
    case Kind::kTimestampJitter:
      return "stamps";
    case Kind::kAngleHarmonic:
      return "angle";
    case Kind::kLine:
      return "frequency";
    case Kind::kDroppedFrames:
      return "frames";
    case Kind::kSaturation:
    case Kind::kDeadBand:
    case Kind::kQuantization:
    case Kind::kSpikes:
    case Kind::kStuck:
      return "values";
    default:
      return "time";
  }
}

// A shape that a residual may have, to be multiplied by a number; an angle's has two.
struct Shape {
  Effect effect;
  double penalty = 0.0;
  Eigen::VectorXd column;
};

std::vector<Shape> shapes_of(const Study& study, const Problem& problem, std::size_t gyro) {
  std::vector<Shape> shapes;
  for (const Candidate& candidate : shaped_candidates(study, gyro)) {
    Effect effect = candidate.term.effect;
    const auto of = [&](const Effect& one) { return study.contribution(problem, gyro, {one}); };
    if (effect.kind == Kind::kDelay || effect.kind == Kind::kClockSkew) {
      shapes.push_back({effect, candidate.penalty, derivative(study, problem, effect, 0)});
      continue;
    }
    shapes.push_back({effect, candidate.penalty, of(effect)});
    if (effect.kind != Kind::kAngleHarmonic) continue;
    // Its quadrature, right behind it.
    effect.parameters[2] = 0.5 * std::numbers::pi;
    shapes.push_back({effect, candidate.penalty, of(effect)});
  }
  const double seconds = study.recording().seconds;
  const double penalty = 2.0 * std::log(std::max(2.0, seconds / kStepEvery_s));
  std::vector<double> steps_s;
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter): a time
  for (double at_s = kStepEvery_s; at_s < seconds - kStepEvery_s; at_s += kStepEvery_s)
    steps_s.push_back(at_s);
  for (const double at_s : distinct_steps(problem.layout, steps_s))
    shapes.push_back({Effect{gyro, Kind::kBiasStep, {1.0, at_s}, 0}, penalty, {}});
  return shapes;
}

Eigen::VectorXd column_of(const Study& study, const Problem& problem, const Shape& shape) {
  if (shape.column.size() > 0) return shape.column;
  return study.contribution(problem, shape.effect.gyro, {shape.effect});
}

// Whitened columns, the residual first. Steps stand still within blocks: only their means are kept.
struct Whitened {
  Matrix within;  ///< residual and smooth shapes
  Matrix means;   ///< residual and all shapes
};

Whitened whiten(const Problem& problem, const PairNoise& noise, const Eigen::VectorXd& residual,
                const std::vector<Shape>& shapes) {
  Eigen::Index smooth = 0;
  for (const Shape& shape : shapes)
    smooth += shape.column.size() > 0 ? 1 : 0;
  Whitened white;
  white.within.resize(problem.size(), 1 + smooth);
  white.within.col(0) = residual;
  Eigen::Index at = 1;
  for (const Shape& shape : shapes) {
    if (shape.column.size() > 0) white.within.col(at++) = shape.column;
  }
  white.means.resize(static_cast<Eigen::Index>(problem.layout.blocks.size()),
                     1 + static_cast<Eigen::Index>(shapes.size()));
  white.means.leftCols(1 + smooth) = block_means(white.within, problem.layout);
  at = 1 + smooth;
  for (const Shape& shape : shapes) {
    if (shape.column.size() > 0) continue;
    for (std::size_t b = 0; b < problem.layout.blocks.size(); ++b) {
      const Block& block = problem.layout.blocks[b];
      white.means(static_cast<Eigen::Index>(b), at) =
          block.t_s >= shape.effect.parameters[1] ? share_of(block.channel, shape.effect.gyro)
                                                  : 0.0;
    }
    ++at;
  }
  whiten_within(white.within, problem.layout, noise, Part::kAll);
  whiten_means(white.means, problem.layout, noise, Part::kAll);
  return white;
}

struct Chosen {
  Shape shape;
  double statistic = 0.0;
  double size = 0.0;
  double sigma = 0.0;
};

// The shape that takes most, again and again, each time less what the earlier ones hold of it.
// `shapes`: smooth ones first.
std::vector<Chosen> choose(const Whitened& white, const std::vector<Shape>& shapes) {
  const Eigen::Index smooth = white.within.cols() - 1;
  const auto count = static_cast<Eigen::Index>(shapes.size());
  // All products that are ever needed.
  Eigen::MatrixXd gram = white.means.transpose() * white.means;
  gram.topLeftCorner(1 + smooth, 1 + smooth) += white.within.transpose() * white.within;
  const Eigen::VectorXd own = gram.diagonal();
  std::vector<std::size_t> places;
  std::vector<double> statistics;
  const Eigen::MatrixXd first = gram;
  const auto sweep = [&](Eigen::Index j) {
    if (gram(j, j) <= 1e-6 * own[j]) return;
    const Eigen::VectorXd row = gram.col(j) / std::sqrt(gram(j, j));
    gram -= row * row.transpose();
  };
  while (places.size() < kChosenMax) {
    double best = kBeyondChance;
    Eigen::Index which = -1;
    double statistic_of_best = 0.0;
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Index j = k + 1;
      const Shape& shape = shapes[static_cast<std::size_t>(k)];
      if (gram(j, j) <= 1e-4 * own[j] || own[j] <= 0.0) continue;
      double statistic = gram(0, j) * gram(0, j) / gram(j, j);
      if (shape.effect.kind == Kind::kAngleHarmonic) {
        if (shape.effect.parameters[2] != 0.0) continue;
        const double rest = gram(j + 1, j + 1) - gram(j, j + 1) * gram(j, j + 1) / gram(j, j);
        const double right = gram(0, j + 1) - gram(j, j + 1) * gram(0, j) / gram(j, j);
        if (rest > 1e-4 * own[j + 1]) statistic += right * right / rest;
      }
      if (statistic - shape.penalty <= best) continue;
      best = statistic - shape.penalty;
      statistic_of_best = statistic;
      which = j;
    }
    if (which < 0) break;
    places.push_back(static_cast<std::size_t>(which - 1));
    statistics.push_back(statistic_of_best);
    const bool pair = shapes[places.back()].effect.kind == Kind::kAngleHarmonic;
    sweep(which);
    if (!pair) continue;
    places.push_back(static_cast<std::size_t>(which));
    statistics.push_back(0.0);
    sweep(which + 1);
  }
  const auto n = static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd normal(n, n);
  Eigen::VectorXd right(n);
  const auto at = [&](Eigen::Index i) {
    return static_cast<Eigen::Index>(places[static_cast<std::size_t>(i)]) + 1;
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    right[i] = first(0, at(i));
    for (Eigen::Index j = 0; j < n; ++j)
      normal(i, j) = first(at(i), at(j));
  }
  std::vector<Chosen> chosen;
  if (n == 0) return chosen;
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  const Eigen::VectorXd size = solver.solve(right);
  const Eigen::MatrixXd covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto place = static_cast<std::size_t>(i);
    chosen.push_back({shapes[places[place]], statistics[place], size[i],
                      std::sqrt(std::max(0.0, covariance(i, i)))});
  }
  return chosen;
}

std::string text_of(const Chosen& one, const std::string& name) {
  const Kind kind = one.shape.effect.kind;
  const model::Parameters& p = one.shape.effect.parameters;
  const double errors = std::abs(one.size) / one.sigma;
  const auto with = [&](std::string_view follows, std::string_view unit) {
    return fmt::format("the residual of {} {}: {:+.3g}{}{}, {:.0f} standard errors", name, follows,
                       one.size, unit.empty() ? "" : " ", unit, errors);
  };
  switch (kind) {
    case Kind::kBias:
      return with("is off all the time", "deg/s");
    case Kind::kBiasRamp:
      return with("climbs with time", "(deg/s)/s");
    case Kind::kBiasStep:
      return with(fmt::format("jumps near {:.0f} s", p[1]), "deg/s");
    case Kind::kWarmUp:
      return with(fmt::format("dies away within {:.0f} s", p[1]), "deg/s at the start");
    case Kind::kTemperatureBias:
      return with("follows the temperature", "deg/s per K");
    case Kind::kTemperatureBiasQuadratic:
      return with("follows the square of the temperature", "deg/s per K²");
    case Kind::kTemperatureRateBias:
      return with("follows the change of temperature", "deg/s per K/s");
    case Kind::kScaleFactorTemperature:
      return with("follows the rate times the temperature", "of the rate per K");
    case Kind::kScaleFactor:
      return with("follows the rate", "of it");
    case Kind::kScaleFactorAsymmetry:
      return with("follows |rate|", "of it");
    case Kind::kScaleFactorQuadratic:
      return with("follows the square of the rate", "deg/s per (deg/s)²");
    case Kind::kScaleFactorCubic:
      return with("follows the cube of the rate", "deg/s per (deg/s)³");
    case Kind::kGSensitivity:
      return with(
          fmt::format("follows the acceleration along {}", "xyz"[static_cast<std::size_t>(p[0])]),
          "deg/s per g");
    case Kind::kVibrationRectification:
      return with("follows the vibration", "deg/s per g²");
    case Kind::kDelay:
      return with("follows the slope of the rate, as a delay", "s");
    case Kind::kBandwidth:
      if (one.size <= 0.0) return with("leads where the rate bends, as behind a high-pass", "");
      return fmt::format(
          "the residual of {} looks low-passed at about {:.3g} Hz, {:.0f} standard "
          "errors",
          name, p[0] / one.size, errors);
    case Kind::kClockSkew:
      return with("lags more and more", "µs per s");
    case Kind::kAngleHarmonic:
      return fmt::format("the residual of {} repeats {:.0f} times a turn", name, p[0]);
    default:
      return with(std::string("shows ") + std::string(model::info(kind).name), "");
  }
}

struct Line {
  double frequency_hz = 0.0;
  double amplitude_dps = 0.0;
  double phase_rad = 0.0;
  double nats = 0.0;
};

// Peaks above the noise around them, whatever its colour.
template <class Psd>
std::vector<Line> lines_of(const EvenSeries& even, double seconds, const Psd& psd) {
  std::vector<Line> lines;
  const std::size_t n = even.value.size();
  std::size_t length = 256;
  while (length < n)
    length *= 2;
  std::vector<double> tapered(length, 0.0);
  double sum = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    sum += even.value[i], count += even.present[i];
  if (count < 256.0) return lines;
  double weights = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (even.present[i] == 0) continue;
    const double phase = (static_cast<double>(i) + 0.5) / static_cast<double>(n);
    const double weight = 0.5 - 0.5 * std::cos(2.0 * std::numbers::pi * phase);
    tapered[i] = weight * (even.value[i] - sum / count);
    weights += weight;
  }
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, tapered);
  const double resolution_hz = 1.0 / (static_cast<double>(length) * even.interval_s);
  // In units of the expected noise, so that the slope of drift is no peak.
  std::vector<double> power(length / 2, 0.0);
  for (std::size_t i = 1; i < power.size(); ++i)
    power[i] = std::norm(spectrum[i]) / psd(static_cast<double>(i) * resolution_hz);
  const double penalty = 2.0 * std::log(static_cast<double>(power.size()));
  constexpr std::size_t kAround = 64;
  const auto first = static_cast<std::size_t>(std::max(0.05, 20.0 / seconds) / resolution_hz) + 1;
  std::vector<double> around;
  for (std::size_t from = first; from < power.size(); from += kAround) {
    const std::size_t low = from > first + kAround / 2 ? from - kAround / 2 : first;
    const std::size_t high = std::min(power.size(), low + 2 * kAround);
    around.assign(power.begin() + static_cast<std::ptrdiff_t>(low),
                  power.begin() + static_cast<std::ptrdiff_t>(high));
    const double floor = median_of(around) / std::numbers::ln2;
    if (floor <= 0.0) continue;
    for (std::size_t i = from; i < std::min(power.size() - 1, from + kAround); ++i) {
      if (power[i] < power[i - 1] || power[i] < power[i + 1]) continue;
      if (2.0 * power[i] / floor - penalty < kBeyondChance) continue;
      lines.push_back({static_cast<double>(i) * resolution_hz,
                       2.0 * std::abs(spectrum[i]) / weights,
                       std::arg(spectrum[i]) + 0.5 * std::numbers::pi, power[i] / floor});
    }
  }
  std::sort(lines.begin(), lines.end(),
            [](const Line& a, const Line& b) { return a.nats > b.nats; });
  // Of one hump only the summit.
  std::vector<Line> apart;
  for (const Line& line : lines) {
    const bool near = std::any_of(apart.begin(), apart.end(), [&](const Line& other) {
      return std::abs(other.frequency_hz - line.frequency_hz) < 8.0 / seconds;
    });
    if (!near && apart.size() < kLinesMax) apart.push_back(line);
  }
  return apart;
}

// Samples' scatter within blocks, by stretches of time: the stretch that differs most.
struct Loud {
  double from_s = 0.0;
  double to_s = 0.0;
  double ratio = 1.0;  ///< of variances
  double nats = 0.0;
};
Loud loudest(const Problem& problem, std::size_t gyro, const PairNoise& noise,
             const Eigen::VectorXd& residual, double seconds) {
  const double cell_s = std::max(kLoudCell_s, seconds / static_cast<double>(kLoudCellsMax));
  const auto cells = static_cast<std::size_t>(seconds / cell_s) + 1;
  std::vector<double> freedom(cells + 1, 0.0);
  std::vector<double> squares(cells + 1, 0.0);
  for (const Block& block : problem.layout.blocks) {
    if (share_of(block.channel, gyro) == 0.0 || block.count < 2) continue;
    const auto values = residual.segment(block.first, block.count);
    const auto cell =
        std::min(cells - 1, static_cast<std::size_t>(std::max(0.0, block.t_s) / cell_s));
    freedom[cell + 1] += block.count - 1.0;
    squares[cell + 1] += (values.array() - values.mean()).square().sum() /
                         within_variance(block, noise, problem.layout);
  }
  for (std::size_t i = 0; i < cells; ++i) {
    freedom[i + 1] += freedom[i];
    squares[i + 1] += squares[i];
  }
  Loud best;
  for (std::size_t from = 0; from < cells; ++from) {
    for (std::size_t to = from + 1; to <= cells; ++to) {
      const double f = freedom[to] - freedom[from];
      if (f < 20.0) continue;
      const double ratio = (squares[to] - squares[from]) / f;
      if (ratio <= 0.0) continue;
      const double nats = 0.5 * f * (ratio - 1.0 - std::log(ratio));
      if (nats <= best.nats) continue;
      best = {cell_s * static_cast<double>(from),
              std::min(seconds, cell_s * static_cast<double>(to)), ratio, nats};
    }
  }
  const double penalty = 4.0 * std::log(static_cast<double>(cells));
  if (2.0 * best.nats - penalty < kBeyondChance) best.nats = 0.0;
  return best;
}

std::string noise_text(const std::string& name, const NoiseTerms& model, const NoiseTerms& fit) {
  return fmt::format(
      "noise of {}: white {:.3g} deg/s/√Hz where the model says {:.3g}, random walk {:.2g} "
      "deg/s/√s instead of {:.2g}, with the rate {:.2g} /√Hz instead of {:.2g}",
      name, fit.white_dps_rthz, model.white_dps_rthz, fit.walk_dps_rts, model.walk_dps_rts,
      fit.ratio_rthz, model.ratio_rthz);
}

class Comparer {
 public:
  Comparer(const Study& study, const Problem& problem, const std::vector<Effect>& effects)
      : study_(study),
        problem_(problem),
        effects_(effects),
        model_(noise_of(effects)),
        seconds_(study.recording().seconds),
        residual_(study.residual(problem, effects)) {}

  void run(std::vector<Difference>& list) {
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (problem_.holds[gyro]) clock(gyro, list);
    }
    shapes(list);
    lines(list);
    noise(list);
  }

 private:
  [[nodiscard]] const std::string& name(std::size_t gyro) const {
    return study_.recording().gyros[gyro].name;
  }
  [[nodiscard]] PairNoise fitted(const PairNoise& start, bool drift = true) const {
    Freedom free;
    free.walk = drift;
    return fit_pair_noise(residual_, problem_.layout, start, {free, free}, problem_.holds,
                          Part::kAll)
        .noise;
  }

  // Once more with the noise that is left then: what has a shape had passed for noise.
  std::vector<Chosen> chosen_with(const std::vector<Shape>& all, const Eigen::VectorXd& observed,
                                  bool drift) {
    residual_ = observed;
    noise_ = fitted(model_, drift);
    std::vector<Chosen> chosen;
    for (int round = 0; round < 2; ++round) {
      chosen = choose(whiten(problem_, noise_, observed, all), all);
      residual_ = observed;
      for (const Chosen& one : chosen)
        residual_ -= one.size * column_of(study_, problem_, one.shape);
      if (chosen.empty()) break;
      noise_ = fitted(model_, drift);
    }
    return chosen;
  }

  // Beyond a sample a lag is no longer its rate's slope: it is taken out first, as it is.
  void clock(std::size_t gyro, std::vector<Difference>& list) {
    double squares = 0.0;
    double freedom = 0.0;
    for (const Block& block : problem_.layout.blocks) {
      if (share_of(block.channel, gyro) == 0.0 || block.count < 2) continue;
      const auto values = residual_.segment(block.first, block.count);
      squares += (values.array() - values.mean()).square().sum() /
                 within_variance(block, model_, problem_.layout);
      freedom += block.count - 1.0;
    }
    if (squares < kLoudByLag * kLoudByLag * freedom) return;
    std::vector<Effect> with = effects_;
    with.push_back({gyro, Kind::kDelay, {0.0}, 0});
    with.push_back({gyro, Kind::kClockSkew, {0.0}, 0});
    Effect& delay = with[with.size() - 2];
    Effect& skew = with.back();
    const auto square = [&] { return study_.residual(problem_, with).squaredNorm(); };
    double best = square();
    double best_ppm = 0.0;
    const double step_ppm = 1e6 * kLagStep_s / seconds_;
    for (int i = -kSkewSteps; i <= kSkewSteps; ++i) {
      skew.parameters[0] = step_ppm * i;
      const double now = square();
      if (now < best) best = now, best_ppm = skew.parameters[0];
    }
    skew.parameters[0] = best_ppm;
    for (int round = 0; round < 6; ++round) {
      Matrix columns(problem_.size(), 3);
      columns.col(0) = study_.residual(problem_, with);
      const std::array<double, 2> step{1e-4, 1.0};
      for (std::size_t k = 0; k < 2; ++k) {
        std::vector<Effect> moved = with;
        moved[moved.size() - 2 + k].parameters[0] += step[k];
        columns.col(static_cast<Eigen::Index>(k) + 1) =
            (columns.col(0) - study_.residual(problem_, moved)) / step[k];
      }
      // In units of each other, so that seconds and millionths share a matrix.
      const Eigen::Vector2d scale = columns.rightCols(2).colwise().norm().transpose();
      if (!(scale.minCoeff() > 0.0)) return;
      columns.col(1) /= scale[0];
      columns.col(2) /= scale[1];
      const Eigen::Matrix3d gram = columns.transpose() * columns;
      const Eigen::Vector2d change =
          gram.bottomRightCorner<2, 2>().ldlt().solve(gram.col(0).tail<2>());
      delay.parameters[0] = std::clamp(delay.parameters[0] + change[0] / scale[0], -0.2, 0.2);
      skew.parameters[0] = std::clamp(skew.parameters[0] + change[1] / scale[1], -5e3, 5e3);
    }
    const double at_the_end_s = 1e-6 * skew.parameters[0] * seconds_;
    const double lag_s = std::max(std::abs(delay.parameters[0]), std::abs(at_the_end_s));
    if (lag_s < problem_.layout.interval_s[gyro] || square() > 0.5 * residual_.squaredNorm())
      return;
    const Eigen::VectorXd before = residual_;
    residual_ = study_.residual(problem_, with);
    effects_ = std::move(with);
    noise_ = fitted(model_);
    const std::vector<double> gains = block_gains(problem_.layout, noise_, before, residual_);
    const bool grows = std::abs(at_the_end_s) > std::abs(effects_.rbegin()[1].parameters[0]);
    Difference difference;
    difference.gyro = gyro;
    difference.where = where_of(problem_, gyro, noise_, seconds_, gains, before - residual_);
    difference.against = against_word(grows ? Kind::kClockSkew : Kind::kDelay);
    difference.nats = std::accumulate(gains.begin(), gains.end(), 0.0);
    difference.text =
        fmt::format("{} reads the rate {:+.2f} ms late at first, {:+.2f} ms at the end", name(gyro),
                    1e3 * effects_.rbegin()[1].parameters[0],
                    1e3 * (effects_.rbegin()[1].parameters[0] + at_the_end_s));
    list.push_back(std::move(difference));
  }

  void shapes(std::vector<Difference>& list) {
    std::vector<Shape> all;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!problem_.holds[gyro]) continue;
      for (Shape& shape : shapes_of(study_, problem_, gyro))
        all.push_back(std::move(shape));
    }
    std::stable_partition(all.begin(), all.end(),
                          [](const Shape& shape) { return shape.column.size() > 0; });
    const Eigen::VectorXd observed = residual_;
    // Drift as the model says with shapes in it, or more drift: whichever is likelier.
    std::vector<Chosen> chosen = chosen_with(all, observed, false);
    const Eigen::VectorXd residual = residual_;
    const PairNoise noise = noise_;
    const auto score = [&](const std::vector<Chosen>& shapes) {
      return log_likelihood(residual_, problem_.layout, noise_, Part::kAll) -
             0.5 * kBeyondChance * static_cast<double>(shapes.size());
    };
    const double steady = score(chosen);
    std::vector<Chosen> wandering = chosen_with(all, observed, true);
    if (score(wandering) > steady + 0.5 * kNoiseTermsPenalty) {
      chosen = std::move(wandering);
    } else {
      residual_ = residual;
      noise_ = noise;
    }
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const Chosen& one = chosen[i];
      const Effect& effect = one.shape.effect;
      Eigen::VectorXd shape = one.size * column_of(study_, problem_, one.shape);
      if (one.statistic == 0.0) continue;  // an angle's second column
      if (effect.kind == Kind::kAngleHarmonic)
        shape += chosen[i + 1].size * column_of(study_, problem_, chosen[i + 1].shape);
      Difference difference;
      difference.gyro = effect.gyro;
      difference.where =
          where_of(problem_, effect.gyro, noise_, seconds_,
                   block_gains(problem_.layout, noise_, residual_ + shape, residual_), shape);
      if (effect.kind == Kind::kBiasStep)
        difference.where.from_s = std::min(effect.parameters[1], difference.where.to_s);
      difference.against = against_word(effect.kind);
      difference.nats = 0.5 * one.statistic;
      difference.text = text_of(one, name(effect.gyro));
      list.push_back(std::move(difference));
    }
  }

  void lines(std::vector<Difference>& list) {
    struct Seen {
      std::size_t gyro;
      Line line;
    };
    std::vector<Seen> seen;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!problem_.holds[gyro]) continue;
      const double rate_square = mean_rate_square(problem_, gyro);
      const auto psd = [&](double frequency_hz) {
        double sum = 1e-300;
        for (std::size_t k = 0; k < 2; ++k) {
          if (problem_.holds[k])
            sum += noise_psd(noise_[k], problem_.layout.interval_s[k], rate_square, frequency_hz);
        }
        return sum;
      };
      for (const Line& line :
           lines_of(even_series(problem_, gyro, Sight::kBoth, residual_), seconds_, psd))
        seen.push_back({gyro, line});
    }
    std::sort(seen.begin(), seen.end(),
              [](const Seen& a, const Seen& b) { return a.line.nats > b.line.nats; });
    std::vector<double> taken_hz;
    for (const Seen& one : seen) {
      // What the difference shows, both gyros show.
      if (std::any_of(taken_hz.begin(), taken_hz.end(), [&](double hz) {
            return std::abs(hz - one.line.frequency_hz) < 8.0 / seconds_;
          })) {
        continue;
      }
      taken_hz.push_back(one.line.frequency_hz);
      const Effect effect{one.gyro,
                          Kind::kLine,
                          {one.line.frequency_hz, one.line.amplitude_dps, one.line.phase_rad},
                          0};
      const Eigen::VectorXd shape = study_.contribution(problem_, one.gyro, {effect});
      const std::vector<double> gains =
          block_gains(problem_.layout, noise_, residual_, residual_ - shape);
      // A peak of the periodogram may be a wave of drift: the noise decides.
      const double nats = std::accumulate(gains.begin(), gains.end(), 0.0);
      if (2.0 * nats - 2.0 * std::log(seconds_ / problem_.layout.interval_s[one.gyro]) <
          kBeyondChance)
        continue;
      Difference difference;
      difference.gyro = one.gyro;
      difference.where = where_of(problem_, one.gyro, noise_, seconds_, gains, shape);
      difference.against = "frequency";
      difference.nats = nats;
      difference.text = fmt::format("the residual of {} holds a line at {:.4f} Hz of {:.3g} deg/s",
                                    name(one.gyro), one.line.frequency_hz, one.line.amplitude_dps);
      list.push_back(std::move(difference));
      residual_ -= shape;
    }
  }

  void noise(std::vector<Difference>& list) {
    const PairNoise& model = model_;
    const PairNoise fit = fitted(model);
    const double as_modelled = log_likelihood(residual_, problem_.layout, model, Part::kAll);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!problem_.holds[gyro]) continue;
      const double high_hz = 0.5 / problem_.layout.interval_s[gyro];
      PairNoise mixed = model;
      mixed[gyro] = fit[gyro];
      const double nats =
          log_likelihood(residual_, problem_.layout, mixed, Part::kAll) - as_modelled;
      if (2.0 * nats - kNoiseTermsPenalty > kBeyondChance) {
        list.push_back({gyro,
                        {0.0, seconds_, 0.0, high_hz},
                        "noise",
                        nats,
                        noise_text(name(gyro), model[gyro], fit[gyro])});
      }
      const Loud loud = loudest(problem_, gyro, fit, residual_, seconds_);
      if (loud.nats > 0.0) {
        list.push_back({gyro,
                        {loud.from_s, loud.to_s, 0.0, high_hz},
                        "noise",
                        loud.nats,
                        fmt::format("{} scatters {:.2f} times as much from {:.0f} to {:.0f} s",
                                    name(gyro), std::sqrt(loud.ratio), loud.from_s, loud.to_s)});
      }
      // Interpolation colours a difference.
      if (!problem_.holds[1 - gyro]) colour(gyro, fit, list);
    }
  }

  // Power by octaves against what the noise terms make.
  void colour(std::size_t gyro, const PairNoise& fit, std::vector<Difference>& list) const {
    const EvenSeries series = even_series(problem_, gyro, Sight::kOwn, residual_);
    const Curve curve = spectrum_curve(series, {});
    if (curve.x.empty()) return;
    const double rate_square = mean_rate_square(problem_, gyro);
    const double reference_psd = problem_.layout.reference_variance * series.interval_s;
    Difference worst;
    for (double low_hz = 1.0; low_hz * 1.5 < curve.x.back(); low_hz *= 2.0) {
      double ratio = 0.0;
      double points = 0.0;
      for (std::size_t i = 0; i < curve.x.size(); ++i) {
        if (curve.x[i] < low_hz || curve.x[i] >= 2.0 * low_hz) continue;
        const double psd = noise_psd(fit[gyro], series.interval_s, rate_square, curve.x[i]);
        // Points are evenly spread over the logarithm: their weight is their frequency.
        ratio += curve.x[i] * curve.y[i] * curve.y[i] / (psd + reference_psd);
        points += curve.x[i];
      }
      if (points <= 0.0) continue;
      ratio /= points;
      const double high_hz = std::min(2.0 * low_hz, 0.5 / series.interval_s);
      const double freedom = (high_hz - low_hz) * seconds_;
      const double nats = freedom * (ratio - 1.0 - std::log(ratio));
      if (std::abs(ratio - 1.0) < kColourMin || nats <= worst.nats) continue;
      worst = {
          gyro,
          {0.0, seconds_, low_hz, high_hz},
          "frequency",
          nats,
          fmt::format("the noise of {} from {:.3g} to {:.3g} Hz has {:.2f} times the power that "
                      "white noise and drift account for",
                      name(gyro), low_hz, high_hz, ratio)};
    }
    if (2.0 * worst.nats - 4.0 > kBeyondChance) list.push_back(std::move(worst));
  }

  const Study& study_;
  const Problem& problem_;
  std::vector<Effect> effects_;
  PairNoise model_;
  double seconds_;
  Eigen::VectorXd residual_;
  PairNoise noise_;
};

}  // namespace

std::vector<Difference> differences(const Study& study, const std::vector<Effect>& effects) {
  std::vector<Difference> list;
  for (const Problem& problem : study.problems())
    Comparer(study, problem, effects).run(list);
  for (const Finding& finding : study.findings()) {
    list.push_back({finding.effect.gyro, finding.where,
                    std::string(against_word(finding.effect.kind)), 0.5 * finding.statistic,
                    finding.evidence});
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const Difference& a, const Difference& b) { return a.nats > b.nats; });
  // Shapes that depend on the same are one difference: its largest.
  std::vector<Difference> kept;
  for (Difference& difference : list) {
    const bool said = difference.against != "frequency" && difference.against != "noise" &&
                      std::any_of(kept.begin(), kept.end(), [&](const Difference& other) {
                        return other.gyro == difference.gyro && other.against == difference.against;
                      });
    if (!said) kept.push_back(std::move(difference));
  }
  list = std::move(kept);
  if (list.size() > kDifferencesMax) list.resize(kDifferencesMax);
  return list;
}

}  // namespace vgyro::gap
