#include "gap/differences.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/core.h>

#include "gap/evidence.h"
#include "gap/regression.h"
#include "gap/scan.h"
#include "gap/views.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

/// 2·ΔlogL, less what looking in many places brings by chance.
constexpr double kBeyondChance = 15.0;
constexpr std::size_t kDifferencesMax = 12;
constexpr std::size_t kTermsMax = 8;
// Three noise terms that were fitted.
constexpr double kNoiseTermsPenalty = 8.0;
constexpr double kLoudCell_s = 5.0;
constexpr std::size_t kLoudCellsMax = 150;
// Two ends of a stretch, each anywhere.
constexpr double kEndsPenalty = 4.0;
constexpr double kLoudFreedomMin = 20.0;
constexpr double kColourMin = 0.1;
constexpr double kColourPenalty = 4.0;
constexpr double kColourFrom_hz = 1.0;
// An octave of which less than half is below the end says little.
constexpr double kOctaveHalf = 1.5;
// A lag is looked for by trying where the samples scatter three times as much as they should, in
// steps that Gauss and Newton bridge.
constexpr double kLoudByLag = 3.0;
constexpr double kLagStep_s = 0.03;
constexpr int kSkewSteps = 16;
// It must explain half of what is there.
constexpr double kLagExplains = 0.5;
constexpr double kMillion = 1e6;

// Samples' scatter within blocks, by stretches of time: the stretch that differs most.
struct Loud {
  double from_s = 0.0;
  double to_s = 0.0;
  double ratio = 1.0;  ///< of variances
  double nats = 0.0;
};

// Scatter in units of the noise, summed until each cell's end.
struct Scatter {
  double cell_s = 0.0;
  std::vector<double> freedom;
  std::vector<double> squares;
};
Scatter scatter_of(const Observations& data, std::size_t gyro, const PairNoise& noise,
                   const Eigen::VectorXd& residual) {
  const double seconds = data.about.seconds;
  Scatter scatter;
  scatter.cell_s = std::max(kLoudCell_s, seconds / static_cast<double>(kLoudCellsMax));
  const auto cells = static_cast<std::size_t>(seconds / scatter.cell_s) + 1;
  scatter.freedom.assign(cells + 1, 0.0);
  scatter.squares.assign(cells + 1, 0.0);
  for (const Block& block : data.layout.blocks) {
    if (share_of(block.channel, gyro) == 0.0 || block.count < 2) continue;
    const auto values = residual.segment(block.first, block.count);
    const auto cell =
        std::min(cells - 1, static_cast<std::size_t>(std::max(0.0, block.t_s) / scatter.cell_s));
    scatter.freedom[cell + 1] += block.count - 1.0;
    scatter.squares[cell + 1] += (values.array() - values.mean()).square().sum() /
                                 within_variance(block, noise, data.layout);
  }
  std::partial_sum(scatter.freedom.begin(), scatter.freedom.end(), scatter.freedom.begin());
  std::partial_sum(scatter.squares.begin(), scatter.squares.end(), scatter.squares.begin());
  return scatter;
}

Loud loudest(const Scatter& scatter, double seconds) {
  const std::size_t cells = scatter.freedom.size() - 1;
  Loud best;
  for (std::size_t from = 0; from < cells; ++from) {
    for (std::size_t to = from + 1; to <= cells; ++to) {
      const double freedom = scatter.freedom[to] - scatter.freedom[from];
      if (freedom < kLoudFreedomMin) continue;
      const double ratio = (scatter.squares[to] - scatter.squares[from]) / freedom;
      if (ratio <= 0.0) continue;
      const double nats = 0.5 * freedom * (ratio - 1.0 - std::log(ratio));
      if (nats <= best.nats) continue;
      best = {scatter.cell_s * static_cast<double>(from),
              std::min(seconds, scatter.cell_s * static_cast<double>(to)), ratio, nats};
    }
  }
  const double penalty = kEndsPenalty * std::log(static_cast<double>(cells));
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

// One set of observations against one model: what the scan proposes, one after the other, each with
// all others fitted again; then the noise.
class Comparer {
 public:
  Comparer(const Study& study, std::shared_ptr<const Observations> data, const Effects& effects)
      : study_(study),
        data_(*data),
        regression_(std::move(data), effects, Part::kAll),
        scan_(regression_, {}),
        model_(regression_.known_noise()) {}

  void run(std::vector<Difference>& list) {
    const Effects late = late_clocks();
    // Drift as the model says with effects in it, or more drift: whichever is likelier.
    Fit fit = collected(late, false);
    Fit wandering = collected(late, true);
    if (weight(wandering) > weight(fit) + 0.5 * kNoiseTermsPenalty) fit = std::move(wandering);
    for (std::size_t i = 0; i < fit.terms.size(); ++i)
      list.push_back(difference(fit, i));
    residual_ = regression_.residual(fit.terms);
    noise(list);
  }

 private:
  [[nodiscard]] const std::string& name(std::size_t gyro) const {
    return study_.recording().gyros[gyro].name;
  }

  [[nodiscard]] PairNoise fitted(const Eigen::VectorXd& residual, bool drift) const {
    Freedom free;
    free.walk = drift;
    return fit_pair_noise(residual, data_.layout, model_, {free, free}, data_.holds, Part::kAll)
        .noise;
  }

  // Terms and noise in turn: what has a shape had passed for noise.
  void refit(Fit& fit, bool drift) const {
    fit.noise = fitted(regression_.residual(fit.terms), drift);
    regression_.improve(fit);
    fit.noise = fitted(regression_.residual(fit.terms), drift);
    regression_.improve(fit);
    fit.log_likelihood = regression_.log_likelihood(fit.terms, fit.noise);
  }

  [[nodiscard]] Fit collected(Effects terms, bool drift) const {
    Fit fit{std::move(terms), model_, 0.0, {}};
    refit(fit, drift);
    while (fit.terms.size() < kTermsMax) {
      const std::vector<Score> scores = scan_.scores(fit, fit.noise);
      if (scores.empty() || scores.front().adjusted() < kBeyondChance) break;
      const Effect& best = scores.front().effect;
      fit.terms.push_back(row(best.kind).finder == Finder::kStep ? placed(regression_, fit, best)
                                                                 : best);
      refit(fit, drift);
    }
    return fit;
  }

  static double weight(const Fit& fit) {
    return fit.log_likelihood - 0.5 * kBeyondChance * static_cast<double>(fit.terms.size());
  }

  // The samples of a gyro scatter so much that only a lag beyond a sample explains it.
  [[nodiscard]] bool may_be_late(std::size_t gyro, const Effects& terms) const {
    if (!data_.holds[gyro]) return false;
    const Scatter scatter = scatter_of(data_, gyro, model_, regression_.residual(terms));
    return scatter.squares.back() >= kLoudByLag * kLoudByLag * scatter.freedom.back();
  }

  // Beyond a sample a lag is no longer its rate's slope: it is taken out first, as it is.
  [[nodiscard]] Effects late_clocks() const {
    Effects terms;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (may_be_late(gyro, terms)) terms = late_clock(gyro, terms);
    }
    return terms;
  }

  // `terms` and, where it explains what is there, a skew or a delay of the gyro.
  [[nodiscard]] Effects late_clock(std::size_t gyro, const Effects& terms) const {
    const auto square = [&](const Effects& all) { return regression_.residual(all).squaredNorm(); };
    const double without = square(terms);
    const PairNoise noise = fitted(regression_.residual(terms), true);
    Effects best = terms;
    double least = kLagExplains * without;
    for (const Kind kind : {Kind::kClockSkew, Kind::kDelay}) {
      Fit fit{nearest(gyro, kind, terms), noise, 0.0, {}};
      regression_.improve(fit);
      const double now = square(fit.terms);
      if (now < least) least = now, best = fit.terms;
    }
    return best;
  }

  // Of even steps of a skew or a delay the one that leaves least.
  [[nodiscard]] Effects nearest(std::size_t gyro, Kind kind, const Effects& terms) const {
    const double step =
        kind == Kind::kClockSkew ? kMillion * kLagStep_s / data_.about.seconds : kLagStep_s;
    Effects best;
    double least = std::numeric_limits<double>::max();
    for (int i = -kSkewSteps; i <= kSkewSteps; ++i) {
      Effects trial = terms;
      trial.push_back({gyro, kind, {step * i}, 0});
      regression_.keep_in_bounds(trial.back());
      const double now = regression_.residual(trial).squaredNorm();
      if (now < least) least = now, best = std::move(trial);
    }
    return best;
  }

  [[nodiscard]] Difference difference(const Fit& fit, std::size_t index) const {
    const Effect& effect = fit.terms[index];
    Effects others = fit.terms;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(index));
    const Eigen::VectorXd with = regression_.residual(fit.terms);
    const Eigen::VectorXd without = regression_.residual(others);
    const std::vector<double> gains = block_gains(data_.layout, fit.noise, without, with);
    Difference difference;
    difference.gyro = effect.gyro;
    difference.where =
        where_of(data_, effect.gyro, fit.noise, data_.about.seconds, gains, without - with);
    // A step begins at the step.
    if (row(effect.kind).finder == Finder::kStep)
      difference.where.from_s = std::min(effect.parameters[1], difference.where.to_s);
    difference.against = *row(effect.kind).against;
    difference.nats = std::accumulate(gains.begin(), gains.end(), 0.0);
    difference.text =
        evidence_text(effect, sigmas_of(fit)[index], name(effect.gyro), data_.about.seconds);
    return difference;
  }

  void noise(std::vector<Difference>& list) const {
    const double seconds = data_.about.seconds;
    const PairNoise fit = fitted(residual_, true);
    const double as_modelled = log_likelihood(residual_, data_.layout, model_, Part::kAll);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!data_.holds[gyro]) continue;
      const Where whole{0.0, seconds, 0.0, 0.5 / data_.layout.interval_s[gyro]};
      PairNoise mixed = model_;
      mixed[gyro] = fit[gyro];
      const double nats = log_likelihood(residual_, data_.layout, mixed, Part::kAll) - as_modelled;
      if (2.0 * nats - kNoiseTermsPenalty > kBeyondChance) {
        list.push_back(
            {gyro, whole, "noise", nats, noise_text(name(gyro), model_[gyro], fit[gyro])});
      }
      const Loud loud = loudest(scatter_of(data_, gyro, fit, residual_), seconds);
      if (loud.nats > 0.0) {
        list.push_back({gyro,
                        {loud.from_s, loud.to_s, 0.0, whole.high_hz},
                        "noise",
                        loud.nats,
                        fmt::format("{} scatters {:.2f} times as much from {:.0f} to {:.0f} s",
                                    name(gyro), std::sqrt(loud.ratio), loud.from_s, loud.to_s)});
      }
      // Interpolation colours a difference.
      if (!data_.holds[1 - gyro]) colour(gyro, fit, list);
    }
  }

  // Power of an octave over what the noise terms make of it.
  struct Octave {
    double ratio = 1.0;
    double nats = 0.0;
  };
  [[nodiscard]] Octave octave(const Curve& curve, double interval_s, const NoiseTerms& terms,
                              double rate_square, double low_hz, double high_hz) const {
    const double reference_psd = data_.layout.reference_variance * interval_s;
    double power = 0.0;
    double points = 0.0;
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      if (curve.x[i] < low_hz || curve.x[i] >= 2.0 * low_hz) continue;
      const double psd = noise_psd(terms, interval_s, rate_square, curve.x[i]);
      // Points are evenly spread over the logarithm: their weight is their frequency.
      power += curve.x[i] * curve.y[i] * curve.y[i] / (psd + reference_psd);
      points += curve.x[i];
    }
    if (points <= 0.0) return {};
    const double ratio = power / points;
    const double freedom = (high_hz - low_hz) * data_.about.seconds;
    return {ratio, freedom * (ratio - 1.0 - std::log(ratio))};
  }

  void colour(std::size_t gyro, const PairNoise& fit, std::vector<Difference>& list) const {
    const EvenSeries series = even_series(data_, gyro, Sight::kOwn, residual_);
    const Curve curve = spectrum_curve(series, {});
    if (curve.x.empty()) return;
    const double rate_square = mean_rate_square(data_, gyro);
    Difference worst;
    for (double low_hz = kColourFrom_hz; low_hz * kOctaveHalf < curve.x.back(); low_hz *= 2.0) {
      const double high_hz = std::min(2.0 * low_hz, 0.5 / series.interval_s);
      const Octave one = octave(curve, series.interval_s, fit[gyro], rate_square, low_hz, high_hz);
      if (std::abs(one.ratio - 1.0) < kColourMin || one.nats <= worst.nats) continue;
      worst = {gyro,
               {0.0, data_.about.seconds, low_hz, high_hz},
               "frequency",
               one.nats,
               fmt::format("the noise of {} from {:.3g} to {:.3g} Hz has {:.2f} times the power "
                           "that white noise and drift account for",
                           name(gyro), low_hz, high_hz, one.ratio)};
    }
    if (2.0 * worst.nats - kColourPenalty > kBeyondChance) list.push_back(std::move(worst));
  }

  const Study& study_;
  const Observations& data_;
  Regression regression_;
  Scan scan_;
  PairNoise model_;
  Eigen::VectorXd residual_;
};

// Effects that depend on the same are one difference: its largest. `list`: the largest first.
std::vector<Difference> without_repeats(std::vector<Difference> list) {
  std::vector<Difference> kept;
  for (Difference& difference : list) {
    const bool many = difference.against == "frequency" || difference.against == "noise";
    const bool said = !many && std::any_of(kept.begin(), kept.end(), [&](const Difference& other) {
      return other.gyro == difference.gyro && other.against == difference.against;
    });
    if (!said) kept.push_back(std::move(difference));
  }
  return kept;
}

}  // namespace

std::vector<Difference> differences(const Study& study, const std::vector<Effect>& effects) {
  std::vector<Difference> list;
  for (const auto& data : study.observations())
    Comparer(study, data, effects).run(list);
  for (const Finding& finding : study.findings()) {
    list.push_back({finding.effect.gyro, finding.where,
                    std::string(*row(finding.effect.kind).against), 0.5 * finding.statistic,
                    finding.evidence});
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const Difference& a, const Difference& b) { return a.nats > b.nats; });
  list = without_repeats(std::move(list));
  if (list.size() > kDifferencesMax) list.resize(kDifferencesMax);
  return list;
}

}  // namespace vgyro::gap
