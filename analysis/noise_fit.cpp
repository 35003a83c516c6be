#include "analysis/noise_fit.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

namespace vgyro::analysis {

namespace {

enum Term : std::size_t { kWhite, kWalk, kFlicker, kOther, kTermCount };  // kOther: Q, interpolated
using Mask = unsigned;
constexpr Mask bit(std::size_t term) {
  return 1U << term;
}

// Increase of the cost at a one-sided 95 % upper bound: half the χ².
constexpr double kBoundCost = 1.353;
// An octave is misfitted when its power is off by this share and by this many standard errors.
constexpr double kMisfit = 0.15;
constexpr double kMisfitSigmas = 5.0;
constexpr double kOctaveCountMin = 30.0;
// Flicker noise is not even over the width of the first coefficients' sines: share of its power
// that the j-th one misses, times j. Measured by numerical integration.
constexpr double kFlickerLoss = 0.21;
constexpr double kLogPowerMin = -30.0;  ///< relative to the largest power that the data allow
constexpr double kStepMax = 2.0;
constexpr int kIterationsMax = 200;
constexpr double kTolerance = 1e-9;

// Exponentially correlated drift instead of a walk: gain that each additional parameter needs in
// twice the log likelihood (chance reaches it in one of 140 walks); factor between the correlation
// times that are tried, and the first one in intervals; number of the longest correlation times
// that a record must hold to show that the correlation ends.
constexpr double kMarkovGain = 6.0;
constexpr double kMemoryStep = 1.3;
constexpr double kMemoryIntervals = 20.0;
constexpr double kMemories = 8.0;

using Powers = Eigen::Array<double, kTermCount, 1>;

double flicker_variance_gain() {
  return 2.0 * std::numbers::ln2 / std::numbers::pi;
}

// Share of a walk's power that exponential correlation with this memory leaves; memory 0: all.
double remembered(const PowerBin& bin, double memory_s) {
  if (memory_s <= 0.0) return 1.0;
  const double keeps = std::exp(-bin.interval_s / memory_s);
  return bin.step_gain / (bin.step_gain + (1.0 - keeps) * (1.0 - keeps) / keeps);
}

// Expected power of a coefficient for each term of unit strength.
Powers shapes(const PowerBin& bin, const FitSettings& settings, double memory_s) {
  const double white = bin.step_gain / bin.interval_s * settings.measured_share;
  Powers result;
  result[kWhite] = white;
  result[kWalk] = bin.interval_s * (1.0 - bin.step_gain / 6.0) * remembered(bin, memory_s);
  result[kFlicker] = bin.step_gain / bin.interval_s / (2.0 * std::numbers::pi * bin.frequency_hz) *
                     (1.0 - kFlickerLoss / bin.half_periods);
  if (settings.interpolation_gain < 1.0) {
    const double angle = 2.0 * std::numbers::pi * bin.frequency_hz * settings.interval_s;
    result[kOther] = white * (1.0 - (1.0 - settings.interpolation_gain) * (1.0 - std::cos(angle)));
  } else {
    result[kOther] = bin.step_gain * bin.step_gain / (bin.interval_s * bin.interval_s);
  }
  return result;
}

// Restricted likelihood of the strengths, as half the deviance from a model that fits every bin.
class Likelihood {
 public:
  Likelihood(const std::vector<PowerBin>& bins, double frequency_max_hz,
             const FitSettings& settings, double memory_s = 0.0) {
    for (const PowerBin& bin : bins) {
      if (bin.frequency_hz > frequency_max_hz || bin.power <= 0.0) continue;
      bins_.push_back(bin);
      shapes_.push_back(shapes(bin, settings, memory_s));
      count_ += bin.count;
    }
    largest_.setConstant(std::numeric_limits<double>::infinity());
    // A term cannot have more power than a run of bins has altogether.
    constexpr std::size_t kRun = 8;
    for (std::size_t first = 0; first + kRun <= bins_.size(); first += kRun) {
      Powers expected = Powers::Zero();
      double power = 0.0;
      for (std::size_t i = first; i < first + kRun; ++i) {
        expected += bins_[i].count * shapes_[i];
        power += bins_[i].power;
      }
      largest_ = largest_.min(power / expected);
    }
  }

  [[nodiscard]] double count() const { return count_; }
  [[nodiscard]] const Powers& largest() const { return largest_; }

  struct Value {
    double cost = 0.0;
    double ramp = 0.0;
    double ramp_information = 0.0;
    Eigen::Vector4d gradient = Eigen::Vector4d::Zero();     ///< with respect to the logarithms
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();  ///< Fisher, by the logarithms
  };
  [[nodiscard]] Value at(const Powers& strength) const {
    Value value;
    double cross = 0.0;
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      const double expected = (strength * shapes_[i]).sum();
      value.ramp_information += bins_[i].ramp_power / expected;
      cross += bins_[i].cross / expected;
    }
    value.ramp = cross / value.ramp_information;
    for (std::size_t i = 0; i < bins_.size(); ++i)
      add(bins_[i], strength * shapes_[i], value);
    value.cost += 0.5 * std::log(value.ramp_information);
    return value;
  }

  struct Misfit {
    double log_ratio = 0.0;
    double frequency_hz = 0.0;
    bool serious = false;
  };
  // The octave whose power disagrees most with the model.
  [[nodiscard]] Misfit worst_octave(const Powers& strength, double ramp, double top_hz) const {
    std::array<double, 40> count{};
    std::array<double, 40> ratio{};
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      const double below_top = std::log2(top_hz / bins_[i].frequency_hz);
      const auto octave = static_cast<std::size_t>(std::clamp(below_top, 0.0, 39.0));
      count[octave] += bins_[i].count;
      ratio[octave] += residual_power(bins_[i], ramp) / (strength * shapes_[i]).sum();
    }
    Misfit worst;
    for (std::size_t octave = 0; octave < count.size(); ++octave) {
      if (count[octave] < kOctaveCountMin) continue;
      const double off = ratio[octave] / count[octave];
      if (std::abs(std::log(off)) <= std::abs(worst.log_ratio)) continue;
      const bool serious = std::abs(std::log(off)) > kMisfit &&
                           std::abs(off - 1.0) > kMisfitSigmas * std::sqrt(2.0 / count[octave]);
      if (worst.serious && !serious) continue;
      worst = {std::log(off), top_hz * std::exp2(-static_cast<double>(octave) - 0.5), serious};
    }
    return worst;
  }

 private:
  static double residual_power(const PowerBin& bin, double ramp) {
    return bin.power - 2.0 * ramp * bin.cross + ramp * ramp * bin.ramp_power;
  }

  static void add(const PowerBin& bin, const Powers& parts, Value& value) {
    const double expected = parts.sum();
    const double power = residual_power(bin, value.ramp);
    value.cost +=
        0.5 * (bin.count * (std::log(expected * bin.count / bin.power) - 1.0) + power / expected);
    const Eigen::Vector4d share = (parts / expected).matrix();
    const double ramp_share = bin.ramp_power / expected / value.ramp_information;
    value.gradient += 0.5 * (bin.count - power / expected - ramp_share) * share;
    value.information += 0.5 * bin.count * share * share.transpose();
  }

  std::vector<PowerBin> bins_;
  std::vector<Powers> shapes_;
  double count_ = 0.0;
  Powers largest_;
};

struct Solution {
  Mask mask = 0;
  Powers strength = Powers::Zero();
  Likelihood::Value value;
};

// Fisher scoring with Marquardt's damping, in logarithms of the strengths. The Fisher information
// is needed for σ anyway.
Solution solve(const Likelihood& likelihood, Mask mask, Powers strength, Mask fixed = 0) {
  for (std::size_t term = 0; term < kTermCount; ++term)
    if ((mask & bit(term)) == 0) strength[static_cast<Eigen::Index>(term)] = 0.0;
  Solution best{mask, strength, likelihood.at(strength)};
  double damping = 1e-3;
  for (int i = 0; i < kIterationsMax && damping < 1e9; ++i) {
    Eigen::Matrix4d curvature = best.value.information;
    Eigen::Vector4d slope = best.value.gradient;
    for (Eigen::Index term = 0; term < 4; ++term) {
      const Mask own = bit(static_cast<std::size_t>(term));
      if ((mask & own) == 0 || (fixed & own) != 0) {
        curvature.row(term).setZero();
        curvature.col(term).setZero();
        slope[term] = 0.0;
      }
      curvature(term, term) = curvature(term, term) * (1.0 + damping) + 1e-9;
    }
    const Eigen::Array4d step =
        (-curvature.ldlt().solve(slope)).array().cwiseMax(-kStepMax).cwiseMin(kStepMax);
    const Powers floor = likelihood.largest() * std::exp(kLogPowerMin);
    Powers next = best.strength * step.exp();
    for (Eigen::Index term = 0; term < 4; ++term)
      if (best.strength[term] > 0.0) next[term] = std::max(next[term], floor[term]);
    const Likelihood::Value value = likelihood.at(next);
    if (!(value.cost < best.value.cost)) {
      damping *= 10.0;
      continue;
    }
    const double gain = best.value.cost - value.cost;
    best.strength = next;
    best.value = value;
    damping = std::max(damping * 0.2, 1e-9);
    if (gain < kTolerance) break;
  }
  return best;
}

// The set of terms that the Bayesian information criterion prefers.
Solution select(const Likelihood& likelihood, Mask allowed) {
  std::optional<Solution> best;
  double best_score = 0.0;
  for (Mask mask = 1; mask < bit(kTermCount); ++mask) {
    if ((mask & ~allowed) != 0) continue;
    const Solution solution = solve(likelihood, mask, 0.5 * likelihood.largest());
    const double score =
        2.0 * solution.value.cost + std::popcount(mask) * std::log(likelihood.count());
    if (best && score >= best_score) continue;
    best = solution;
    best_score = score;
  }
  return *best;
}

double upper_bound(const Likelihood& likelihood, const Solution& chosen, std::size_t term) {
  const auto index = static_cast<Eigen::Index>(term);
  Powers start = chosen.strength;
  start[index] = 0.5 * likelihood.largest()[index];
  const Mask mask = chosen.mask | bit(term);
  const Solution best = solve(likelihood, mask, start);
  const double least = std::min(chosen.value.cost, best.value.cost);
  // If the likelihood has a maximum here, it falls on both sides: the bound is above the maximum.
  double low = kLogPowerMin;
  if (best.value.cost < chosen.value.cost)
    low = std::max(low, std::log(best.strength[index] / likelihood.largest()[index]));
  double high = 3.0;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    Powers strength = chosen.strength;
    strength[index] = likelihood.largest()[index] * std::exp(middle);
    const double cost = solve(likelihood, mask, strength, bit(term)).value.cost;
    (cost < least + kBoundCost ? low : high) = middle;
  }
  return likelihood.largest()[index] * std::exp(high);
}

Eigen::Matrix4d covariance(const Solution& solution) {
  Eigen::Matrix4d information = solution.value.information;
  for (Eigen::Index term = 0; term < 4; ++term) {
    if ((solution.mask & bit(static_cast<std::size_t>(term))) != 0) continue;
    information.row(term).setZero();
    information.col(term).setZero();
    information(term, term) = 1.0;
  }
  return information.inverse();
}

Estimate estimate(const Likelihood& likelihood, const Solution& chosen, std::size_t term) {
  Estimate result;
  const auto index = static_cast<Eigen::Index>(term);
  result.resolved = (chosen.mask & bit(term)) != 0;
  if (!result.resolved) {
    result.below = std::sqrt(upper_bound(likelihood, chosen, term));
    return result;
  }
  result.value = std::sqrt(chosen.strength[index]);
  // σ of the logarithm of a square.
  result.sigma = 0.5 * result.value * std::sqrt(covariance(chosen)(index, index));
  return result;
}

// White noise of both gyros together: the one that was interpolated and the one that was not.
Estimate whole_white(const Likelihood& likelihood, const Solution& chosen) {
  if ((chosen.mask & (bit(kWhite) | bit(kOther))) == 0) return estimate(likelihood, chosen, kWhite);
  Eigen::Vector4d by_logarithm = Eigen::Vector4d::Zero();
  double sum = 0.0;
  for (const std::size_t term : {kWhite, kOther}) {
    if ((chosen.mask & bit(term)) == 0) continue;
    const auto index = static_cast<Eigen::Index>(term);
    by_logarithm[index] = chosen.strength[index];
    sum += chosen.strength[index];
  }
  Estimate result;
  result.resolved = true;
  result.value = std::sqrt(sum);
  result.sigma =
      0.5 / result.value * std::sqrt(by_logarithm.dot(covariance(chosen) * by_logarithm));
  return result;
}

NoiseFit result_of(const Likelihood& likelihood, const Solution& chosen, bool interpolated,
                   bool asks_other) {
  NoiseFit fit;
  fit.white_dps_rthz =
      interpolated ? whole_white(likelihood, chosen) : estimate(likelihood, chosen, kWhite);
  fit.walk_dps_rts = estimate(likelihood, chosen, kWalk);
  fit.flicker_dps = estimate(likelihood, chosen, kFlicker);
  if (asks_other && !interpolated) fit.quantisation_deg = estimate(likelihood, chosen, kOther);
  fit.ramp_dps_s = chosen.value.ramp;
  fit.ramp_sigma_dps_s = 1.0 / std::sqrt(chosen.value.ramp_information);
  return fit;
}

}  // namespace

namespace {

// An exponentially correlated drift, if it makes the record much likelier than the chosen terms.
struct Forgetting {
  double memory_s = 0.0;
  Solution solution;
};
std::optional<Forgetting> forgetting(const std::vector<PowerBin>& bins, double top_hz,
                                     const FitSettings& settings, const Solution& chosen) {
  if ((chosen.mask & (bit(kWalk) | bit(kFlicker))) == 0) return {};
  double lowest_hz = top_hz;
  for (const PowerBin& bin : bins)
    lowest_hz = std::min(lowest_hz, bin.frequency_hz / bin.half_periods);
  // The first coefficient has one half period, which fills the record.
  const double longest_s = 0.5 / lowest_hz / kMemories;
  const auto score = [](const Solution& solution, int more) {
    return 2.0 * solution.value.cost + kMarkovGain * (std::popcount(solution.mask) + more);
  };
  double best_score = score(chosen, 0);
  std::optional<Forgetting> best;
  for (double memory_s = kMemoryIntervals * settings.interval_s; memory_s <= longest_s;
       memory_s *= kMemoryStep) {
    const Likelihood other(bins, top_hz, settings, memory_s);
    const Mask alone = (chosen.mask | bit(kWhite) | bit(kWalk)) & ~bit(kFlicker);
    for (const Mask mask : {alone, alone | bit(kFlicker)}) {
      const Solution solution = solve(other, mask, 0.5 * other.largest());
      if (score(solution, 1) >= best_score) continue;
      best_score = score(solution, 1);
      best = Forgetting{memory_s, solution};
    }
  }
  return best;
}

// K is then only a bound: a walk of the record is no more than the drift over short times.
void set_markov(const Forgetting& forgetting, NoiseFit& fit) {
  const Estimate walk = fit.walk_dps_rts;
  fit.markov = Markov{walk.value * std::sqrt(0.5 * forgetting.memory_s), forgetting.memory_s};
  fit.walk_dps_rts = {.below = walk.value + 2.0 * walk.sigma};
}

}  // namespace

std::optional<NoiseFit> fit_noise(const std::vector<PowerBin>& bins, const FitSettings& settings) {
  const bool interpolated = settings.interpolation_gain < 1.0;
  std::optional<NoiseFit> fit;
  const double whole_hz = 0.5 / settings.interval_s;
  for (double top_hz = whole_hz;; top_hz *= 0.5) {
    const Likelihood likelihood(bins, top_hz, settings);
    if (likelihood.count() < kCoefficientsMin) return fit;
    const bool limited = top_hz < whole_hz;
    // Power that grows with the frequency inside a limited band is not quantisation.
    const bool asks_other = interpolated || !limited;
    const Mask all = bit(kTermCount) - 1;
    const Solution walking = select(likelihood, asks_other ? all : all & ~bit(kOther));
    const auto forgets = forgetting(bins, top_hz, settings, walking);
    const Likelihood judge =
        forgets ? Likelihood(bins, top_hz, settings, forgets->memory_s) : likelihood;
    const Solution chosen = forgets ? forgets->solution : walking;
    const auto worst = judge.worst_octave(chosen.strength, chosen.value.ramp, top_hz);
    fit = result_of(judge, chosen, interpolated, asks_other);
    if (forgets) set_markov(*forgets, *fit);
    fit->frequency_max_hz = top_hz;
    fit->limited = limited;
    fit->describes = !worst.serious;
    fit->worst_ratio = std::exp(worst.log_ratio);
    fit->worst_hz = worst.frequency_hz;
    if (!worst.serious) return fit;
  }
}

double Markov::walk_dps_rts() const {
  return sigma_dps * std::sqrt(2.0 / tau_s);
}

double Markov::variance(double at_s) const {
  // Below a thousandth of the memory the difference of the terms has no digits left.
  const double x = at_s / tau_s;
  constexpr double kShort = 1e-3;
  if (x < kShort) return 2.0 / 3.0 * sigma_dps * sigma_dps * x;
  return sigma_dps * sigma_dps / (x * x) *
         (2.0 * x - 3.0 + 4.0 * std::exp(-x) - std::exp(-2.0 * x));
}

double NoiseFit::variance(NoiseKind kind, double tau_s) const {
  switch (kind) {
    case NoiseKind::kQuantisation:
      return 3.0 * quantisation_deg.value * quantisation_deg.value / (tau_s * tau_s);
    case NoiseKind::kWhite:
      return white_dps_rthz.value * white_dps_rthz.value / tau_s;
    case NoiseKind::kFlicker:
      return flicker_variance_gain() * flicker_dps.value * flicker_dps.value;
    case NoiseKind::kWalk:
      return walk_dps_rts.value * walk_dps_rts.value * tau_s / 3.0 +
             (markov ? markov->variance(tau_s) : 0.0);
  }
  return 0.0;
}

double NoiseFit::variance(double tau_s) const {
  return variance(NoiseKind::kQuantisation, tau_s) + variance(NoiseKind::kWhite, tau_s) +
         variance(NoiseKind::kFlicker, tau_s) + variance(NoiseKind::kWalk, tau_s);
}

NoiseKind NoiseFit::dominant(double tau_s) const {
  NoiseKind best = NoiseKind::kWhite;
  for (const NoiseKind kind : {NoiseKind::kQuantisation, NoiseKind::kFlicker, NoiseKind::kWalk})
    if (variance(kind, tau_s) > variance(best, tau_s)) best = kind;
  return best;
}

double NoiseFit::ramp_significance() const {
  return ramp_sigma_dps_s > 0.0 ? std::abs(ramp_dps_s) / ramp_sigma_dps_s : 0.0;
}

}  // namespace vgyro::analysis
