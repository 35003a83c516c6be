#include "gap/noise_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace vgyro::gap {

namespace {

using model::Kind;

// Of a logarithm, for the curvature of the likelihood: white noise is known to a per cent, drift to
// some ten.
constexpr double kWhiteStep = 0.005;
constexpr double kDriftStep = 0.1;
// Of a drift that had less than so many times to forget nobody can say that it ever will.
constexpr double kForgottenTimes = 16.0;

Freedom only(Random part) {
  return {part == Random::kWhite, part == Random::kRatio, part == Random::kWalk,
          part == Random::kMarkov, part == Random::kFlicker};
}

// The sizes of a part, the one that was added last where there are several.
double& size_of(NoiseTerms& terms, Random part) {
  switch (part) {
    case Random::kWhite:
      return terms.white_dps_rthz;
    case Random::kRatio:
      return terms.ratio_rthz;
    case Random::kWalk:
      return terms.walk_dps_rts;
    case Random::kFlicker:
      return terms.flicker_dps;
    case Random::kMarkov:
      return terms.markov.back().sigma_dps;
    case Random::kRounding:
      return terms.step_dps;
    case Random::kNone:
      break;
  }
  assert(false);
  return terms.white_dps_rthz;
}

// Densities add in squares; a further correlated term stands by itself.
double beyond(NoiseTerms now, NoiseTerms then, Random part) {
  const double size = size_of(now, part);
  if (part == Random::kMarkov) return size;
  const double known = size_of(then, part);
  return std::sqrt(std::max(0.0, size * size - known * known));
}

// What of the logarithm of size and memory the data leave open, by the likelihood's curvature.
class Curvature {
 public:
  Curvature(const Eigen::VectorXd& residual, const Regression& regression, const PairNoise& top,
            std::size_t gyro, Random part)
      : residual_(residual), regression_(regression), top_(top), gyro_(gyro), part_(part) {}

  /// Relative σ of the size, and of the memory where there is one.
  [[nodiscard]] std::array<double, 2> sigmas() const {
    const double h = part_ == Random::kWhite ? kWhiteStep : kDriftStep;
    const double top = at(0.0, 0.0);
    const double of_first = -(at(h, 0.0) - 2.0 * top + at(-h, 0.0)) / (h * h);
    if (part_ != Random::kMarkov) return {relative(of_first), 0.0};
    const double of_second = -(at(0.0, h) - 2.0 * top + at(0.0, -h)) / (h * h);
    const double of_both = -(at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h * h);
    const double determinant = of_first * of_second - of_both * of_both;
    return {relative(determinant / of_second), relative(determinant / of_first)};
  }

 private:
  static double relative(double curvature) {
    return curvature > 0.0 ? 1.0 / std::sqrt(curvature) : 1.0;
  }

  [[nodiscard]] double at(double first, double second) const {
    PairNoise trial = top_;
    size_of(trial[gyro_], part_) *= std::exp(first);
    if (part_ == Random::kMarkov) trial[gyro_].markov.back().tau_s *= std::exp(second);
    return log_likelihood(residual_, regression_.data().layout, trial, regression_.part());
  }

  const Eigen::VectorXd& residual_;
  const Regression& regression_;
  const PairNoise& top_;
  std::size_t gyro_;
  Random part_;
};

// Flicker and correlated drifts share what a model file can hold: one at the least is the
// flicker's.
bool has_room(const NoiseTerms& known, Random part) {
  const std::size_t held = known.markov.size() + (known.flicker_dps > 0.0 ? 1 : 0);
  if (part == Random::kMarkov) return held < kMarkovNamedMax;
  return part != Random::kFlicker || known.flicker_dps > 0.0 || held < kMarkovNamedMax;
}

std::optional<NoiseFound> free_one(const Regression& regression, const Eigen::VectorXd& residual,
                                   const PairNoise& model, std::size_t gyro, const KindRow& its) {
  const Layout& layout = regression.data().layout;
  const Random part = its.random;
  if (!has_room(model[gyro], part)) return {};
  std::array<Freedom, 2> free;
  free[0] = free[1] = only(Random::kNone);
  free[gyro] = only(part);
  const NoiseFitResult with =
      fit_pair_noise(residual, layout, model, free, regression.data().holds, regression.part());
  NoiseFound one;
  one.terms = with.noise[gyro];
  Found& found = one.found;
  found.statistic =
      2.0 * (with.log_likelihood - log_likelihood(residual, layout, model, regression.part()));
  found.penalty = its.penalty;
  found.effect.gyro = gyro;
  found.effect.kind = its.kind;
  const double size = beyond(one.terms, model[gyro], part);
  if (size <= 0.0) return {};
  found.effect.parameters[0] = size;
  const auto relative = Curvature(residual, regression, with.noise, gyro, part).sigmas();
  // d(beyond)/d(total) = total/beyond
  const double total = size_of(one.terms, part);
  found.sigma[0] = relative[0] * total * total / size;
  if (part == Random::kMarkov) {
    found.effect.parameters[1] = one.terms.markov.back().tau_s;
    found.sigma[1] = relative[1] * found.effect.parameters[1];
  }
  return one;
}

// What a correlated drift is before it forgets.
Reading walk_like(const model::Effect& markov) {
  const double density = markov.parameters[0] * std::sqrt(2.0 / markov.parameters[1]);
  return {Kind::kRateRandomWalk, markov.gyro, {density}};
}

void name_rivals(const std::vector<std::pair<double, Reading>>& seen, double seconds, Found& best) {
  for (const auto& [adjusted, reading] : seen) {
    if (reading.kind == best.effect.kind && reading.gyro == best.effect.gyro) continue;
    if (adjusted > best.adjusted() - kLead) best.ambiguous_with.push_back(reading);
  }
  if (row(best.effect.kind).random == Random::kMarkov &&
      best.effect.parameters[1] > seconds / kForgottenTimes)
    best.ambiguous_with.push_back(walk_like(best.effect));
}

// In the order in which equals are preferred: the plainest first.
constexpr std::array kOrder{Kind::kWhiteNoise, Kind::kRateNoise, Kind::kRateRandomWalk,
                            Kind::kBiasInstability, Kind::kGaussMarkov};

}  // namespace

std::optional<NoiseFound> find_noise(const std::vector<NoiseQuestion>& questions,
                                     const PairNoise& model, const std::array<bool, 2>& may) {
  std::optional<NoiseFound> best;
  std::vector<std::pair<double, Reading>> seen;
  double seconds = 0.0;
  for (const NoiseQuestion& question : questions) {
    const Regression& regression = *question.regression;
    seconds = regression.data().about.seconds;
    const Eigen::VectorXd residual = regression.residual(question.terms);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!regression.data().holds[gyro] || !may[gyro]) continue;
      for (const Kind kind : kOrder) {
        auto one = free_one(regression, residual, model, gyro, row(kind));
        if (!one) continue;
        seen.emplace_back(one->found.adjusted(), reading_of(one->found.effect));
        if (!best || one->found.adjusted() > best->found.adjusted()) best = std::move(one);
      }
    }
  }
  if (best) name_rivals(seen, seconds, best->found);
  return best;
}

}  // namespace vgyro::gap
