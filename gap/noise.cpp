#include "gap/noise.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include <nlopt.hpp>

#include "gap/kinds.h"

namespace vgyro::gap {

namespace {

// Below this a variance is rounding of the arithmetic, not noise: (1e-9 deg/s)².
constexpr double kVarianceMin = 1e-18;
// Times that a fitted correlated term must have room to forget.
constexpr double kMarkovSpans = 8.0;
constexpr std::size_t kTermsMax = 1 + kMarkovMax;
constexpr std::size_t kStatesMax = 2 * kTermsMax;

// The drift filter's states: for each gyro a walk and its Markov terms.
struct States {
  std::size_t count = 0;
  std::array<std::size_t, kStatesMax> gyro{};
  std::array<double, kStatesMax> start_variance{};
  std::array<double, kStatesMax> growth{};      ///< of a walk, per second
  std::array<double, kStatesMax> tau_s{};       ///< 0: a walk
  std::array<double, kStatesMax> stationary{};  ///< of a Markov term
};

States states_of(const PairNoise& noise, const Layout& layout) {
  std::array<bool, 2> used{};
  for (const Block& block : layout.blocks) {
    for (std::size_t gyro = 0; gyro < 2; ++gyro)
      used[gyro] = used[gyro] || share_of(block.channel, gyro) != 0.0;
    if (used[0] && used[1]) break;
  }
  States states;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!used[gyro]) continue;
    const NoiseTerms& terms = noise[gyro];
    states.gyro[states.count] = gyro;
    states.growth[states.count] = terms.walk_dps_rts * terms.walk_dps_rts;
    ++states.count;
    for (const MarkovTerm& term : terms.markov) {
      if (states.count == kStatesMax || term.sigma_dps <= 0.0) continue;
      states.gyro[states.count] = gyro;
      states.tau_s[states.count] = term.tau_s;
      states.stationary[states.count] = term.sigma_dps * term.sigma_dps;
      states.start_variance[states.count] = states.stationary[states.count];
      ++states.count;
    }
  }
  return states;
}

}  // namespace

PairNoise noise_of(const std::vector<model::Effect>& effects) {
  PairNoise noise;
  for (const model::Effect& effect : effects) {
    NoiseTerms& terms = noise[effect.gyro];
    const double value = effect.parameters[0];
    switch (row(effect.kind).random) {
      case Random::kWhite:
        terms.white_dps_rthz = std::hypot(terms.white_dps_rthz, value);
        break;
      case Random::kRatio:
        terms.ratio_rthz = std::hypot(terms.ratio_rthz, value);
        break;
      case Random::kWalk:
        terms.walk_dps_rts = std::hypot(terms.walk_dps_rts, value);
        break;
      case Random::kMarkov:
        terms.markov.push_back({value, effect.parameters[1]});
        break;
      case Random::kRounding:
        terms.step_dps = std::hypot(terms.step_dps, value);
        break;
      case Random::kNone:
        break;
    }
  }
  return noise;
}

namespace {

double white_variance(const std::array<double, 3>& gain, double rate_square, const PairNoise& noise,
                      const Layout& layout) {
  double variance = gain[2] * layout.reference_variance;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (gain[gyro] == 0.0) continue;
    variance += gain[gyro] * noise[gyro].variance(rate_square, layout.interval_s[gyro]);
  }
  return std::max(variance, kVarianceMin);
}

// Variance about its mean of a drift over `seconds`: of a walk K²T/6, of a correlated term its
// variance less that of its mean.
double drift_within(const NoiseTerms& terms, double seconds) {
  double variance = terms.walk_dps_rts * terms.walk_dps_rts * seconds / 6.0;
  for (const MarkovTerm& term : terms.markov) {
    const double x = seconds / term.tau_s;
    const double of_mean =
        x > 1e-3 ? 2.0 / (x * x) * (x - 1.0 + std::exp(-x)) : 1.0 - x / 3.0 + x * x / 12.0;
    variance += term.sigma_dps * term.sigma_dps * (1.0 - of_mean);
  }
  return variance;
}

double drift_within(Channel channel, const PairNoise& noise, double seconds) {
  double variance = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (share_of(channel, gyro) != 0.0) variance += drift_within(noise[gyro], seconds);
  }
  return variance;
}

double seconds_of(const Block& block, const Layout& layout) {
  const std::size_t gyro = block.channel == Channel::kGyro2 ? 1 : 0;
  return block.count * layout.interval_s[gyro];
}

}  // namespace

double sample_variance(const Block& block, const PairNoise& noise, const Layout& layout) {
  return white_variance(block.within_gain, block.rate_square, noise, layout);
}

double mean_variance(const Block& block, const PairNoise& noise, const Layout& layout) {
  return white_variance(block.mean_gain, block.rate_square, noise, layout);
}

double within_variance(const Block& block, const PairNoise& noise, const Layout& layout) {
  return sample_variance(block, noise, layout) +
         drift_within(block.channel, noise, seconds_of(block, layout));
}

Matrix block_means(const Matrix& columns, const Layout& layout) {
  Matrix means(static_cast<Eigen::Index>(layout.blocks.size()), columns.cols());
  for (std::size_t b = 0; b < layout.blocks.size(); ++b) {
    const Block& block = layout.blocks[b];
    means.row(static_cast<Eigen::Index>(b)) =
        columns.middleRows(block.first, block.count).colwise().mean();
  }
  return means;
}

double whiten_means(Matrix& means, const Layout& layout, const PairNoise& noise, Part part) {
  const States states = states_of(noise, layout);
  const std::size_t n = states.count;
  std::array<std::array<double, kStatesMax>, kStatesMax> p{};
  for (std::size_t i = 0; i < n; ++i)
    p[i][i] = states.start_variance[i];
  Matrix x = Matrix::Zero(static_cast<Eigen::Index>(n), means.cols());
  const auto width = static_cast<std::size_t>(means.cols());
  std::array<double, kStatesMax> h{};
  std::array<double, kStatesMax> ph{};
  double log_likelihood = 0.0;
  double last_s = 0.0;
  for (std::size_t b = 0; b < layout.blocks.size(); ++b) {
    const Block& block = layout.blocks[b];
    const double step_s = std::max(0.0, block.t_s - last_s);
    last_s = std::max(last_s, block.t_s);
    for (std::size_t i = 0; i < n; ++i) {
      if (states.tau_s[i] == 0.0) {
        p[i][i] += states.growth[i] * step_s;
        continue;
      }
      const double decay = std::exp(-step_s / states.tau_s[i]);
      for (std::size_t j = 0; j < n; ++j) {
        p[i][j] *= decay;
        p[j][i] *= decay;
      }
      p[i][i] += states.stationary[i] * (1.0 - decay * decay);
      x.row(static_cast<Eigen::Index>(i)) *= decay;
    }
    for (std::size_t i = 0; i < n; ++i)
      h[i] = share_of(block.channel, states.gyro[i]);
    // A mean's increments are less than those of the drift at its middle, by as much as the drift
    // scatters within a block: then both variance and covariance of the means are right.
    double s = mean_variance(block, noise, layout) -
               drift_within(block.channel, noise, seconds_of(block, layout));
    double* const innovation = means.data() + b * width;
    for (std::size_t i = 0; i < n; ++i) {
      ph[i] = 0.0;
      for (std::size_t j = 0; j < n; ++j)
        ph[i] += p[i][j] * h[j];
      s += h[i] * ph[i];
      if (h[i] == 0.0) continue;
      const double* const state = x.data() + i * width;
      for (std::size_t c = 0; c < width; ++c)
        innovation[c] -= h[i] * state[c];
    }
    s = std::max(s, kVarianceMin);
    for (std::size_t i = 0; i < n; ++i) {
      const double gain = ph[i] / s;
      double* const state = x.data() + i * width;
      for (std::size_t c = 0; c < width; ++c)
        state[c] += gain * innovation[c];
      for (std::size_t j = 0; j <= i; ++j) {
        p[i][j] -= gain * ph[j];
        p[j][i] = p[i][j];
      }
    }
    if (counts(block, part)) {
      log_likelihood -= 0.5 * std::log(s);
    }
    const double scale = counts(block, part) ? 1.0 / std::sqrt(s) : 0.0;
    for (std::size_t c = 0; c < width; ++c)
      innovation[c] *= scale;
  }
  return log_likelihood;
}

double whiten_within(Matrix& columns, const Layout& layout, const PairNoise& noise, Part part) {
  double log_likelihood = 0.0;
  for (const Block& block : layout.blocks) {
    auto rows = columns.middleRows(block.first, block.count);
    if (!counts(block, part)) {
      rows.setZero();
      continue;
    }
    const double variance = within_variance(block, noise, layout);
    const Eigen::RowVectorXd mean = rows.colwise().mean();
    rows = (rows.rowwise() - mean) / std::sqrt(variance);
    log_likelihood -= 0.5 * static_cast<double>(block.count - 1) * std::log(variance);
  }
  return log_likelihood;
}

std::vector<WithinBin> within_bins(const Eigen::VectorXd& residual, const Layout& layout,
                                   Part part) {
  std::map<std::tuple<int, int, int>, WithinBin> bins;
  for (const Block& block : layout.blocks) {
    if (!counts(block, part) || block.count < 2) continue;
    const auto values = residual.segment(block.first, block.count);
    const double squares = (values.array() - values.mean()).square().sum();
    const int rate_class =
        block.rate_square < 1.0 ? 0 : 1 + static_cast<int>(2.0 * std::log2(block.rate_square));
    const int gain_class = static_cast<int>(20.0 * (block.within_gain[0] + block.within_gain[1]));
    WithinBin& bin = bins[{static_cast<int>(block.channel), rate_class, gain_class}];
    const double freedom = static_cast<double>(block.count - 1);
    bin.channel = block.channel;
    bin.rate_square += freedom * block.rate_square;
    for (std::size_t i = 0; i < bin.gain.size(); ++i)
      bin.gain[i] += freedom * block.within_gain[i];
    bin.seconds += freedom * seconds_of(block, layout);
    bin.freedom += freedom;
    bin.squares += squares;
  }
  std::vector<WithinBin> list;
  for (auto& [key, bin] : bins) {
    bin.rate_square /= bin.freedom;
    for (double& gain : bin.gain)
      gain /= bin.freedom;
    bin.seconds /= bin.freedom;
    list.push_back(bin);
  }
  return list;
}

double within_log_likelihood(const std::vector<WithinBin>& bins, const PairNoise& noise,
                             const Layout& layout) {
  double sum = 0.0;
  for (const WithinBin& bin : bins) {
    const double variance = white_variance(bin.gain, bin.rate_square, noise, layout) +
                            drift_within(bin.channel, noise, bin.seconds);
    sum -= 0.5 * (bin.freedom * std::log(variance) + bin.squares / variance);
  }
  return sum;
}

double means_log_likelihood(const Eigen::VectorXd& means, const Layout& layout,
                            const PairNoise& noise, Part part) {
  Matrix column = means;
  const double log_likelihood = whiten_means(column, layout, noise, part);
  return log_likelihood - 0.5 * column.squaredNorm();
}

double log_likelihood(const Eigen::VectorXd& residual, const Layout& layout, const PairNoise& noise,
                      Part part) {
  return within_log_likelihood(within_bins(residual, layout, part), noise, layout) +
         means_log_likelihood(block_means(residual, layout).col(0), layout, noise, part);
}

namespace {

struct Unknown {
  enum class What : std::uint8_t { kWhite, kRatio, kWalk, kSigma, kTau };
  std::size_t gyro = 0;
  What what = What::kWhite;
  double low = 0.0;  ///< of the logarithm
  double high = 0.0;
};

double& value_of(PairNoise& noise, const Unknown& unknown) {
  NoiseTerms& terms = noise[unknown.gyro];
  switch (unknown.what) {
    case Unknown::What::kWhite:
      return terms.white_dps_rthz;
    case Unknown::What::kRatio:
      return terms.ratio_rthz;
    case Unknown::What::kWalk:
      return terms.walk_dps_rts;
    case Unknown::What::kSigma:
      return terms.markov.back().sigma_dps;
    case Unknown::What::kTau:
      break;
  }
  return terms.markov.back().tau_s;
}

// Maximises over the logarithms of the unknowns. What lies at its lower bound is set to 0.
template <class LogLikelihood>
double maximise(PairNoise& noise, const std::vector<Unknown>& unknowns, int evaluations,
                double tolerance, const LogLikelihood& log_likelihood_of) {
  if (unknowns.empty()) return log_likelihood_of(noise);
  const auto count = static_cast<unsigned>(unknowns.size());
  std::vector<double> x(count);
  std::vector<double> low(count);
  std::vector<double> high(count);
  for (unsigned i = 0; i < count; ++i) {
    low[i] = unknowns[i].low;
    high[i] = unknowns[i].high;
    x[i] = std::clamp(std::log(std::max(value_of(noise, unknowns[i]), 1e-300)), low[i] + 0.05,
                      high[i] - 0.05);
  }
  struct Context {
    PairNoise noise;
    const std::vector<Unknown>* unknowns;
    const LogLikelihood* log_likelihood_of;
  } context{noise, &unknowns, &log_likelihood_of};
  const auto apply = [](const std::vector<double>& at, Context& to) {
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Unknown& unknown = (*to.unknowns)[i];
      value_of(to.noise, unknown) = std::exp(at[i]);
    }
  };
  nlopt::opt search(nlopt::LN_SBPLX, count);
  search.set_lower_bounds(low);
  search.set_upper_bounds(high);
  search.set_initial_step(0.7);
  search.set_ftol_abs(tolerance);
  search.set_maxeval(evaluations);
  struct Call {
    Context* context;
    decltype(apply)* apply_to;
  } call{&context, &apply};
  search.set_max_objective(
      [](const std::vector<double>& at, std::vector<double>&, void* data) {
        Call& c = *static_cast<Call*>(data);
        (*c.apply_to)(at, *c.context);
        return (*c.context->log_likelihood_of)(c.context->noise);
      },
      &call);
  double best = 0.0;
  try {
    search.optimize(x, best);
  } catch (const std::exception&) {
    // The best point so far is in x.
  }
  apply(x, context);
  noise = context.noise;
  return log_likelihood_of(noise);
}

}  // namespace

NoiseFitResult fit_pair_noise(const Eigen::VectorXd& residual, const Layout& layout,
                              const PairNoise& start, const std::array<Freedom, 2>& free,
                              const std::array<bool, 2>& used, Part part) {
  NoiseFitResult result{start, 0.0};
  const std::vector<WithinBin> bins = within_bins(residual, layout, part);
  std::vector<Unknown> fast;
  std::vector<Unknown> slow;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!used[gyro]) continue;
    // The search needs a sane start: what the samples scatter within their blocks.
    double freedom = 0.0;
    double squares = 0.0;
    double rate_square = 0.0;
    for (const WithinBin& bin : bins) {
      if (bin.gain[gyro] == 0.0) continue;
      freedom += bin.freedom;
      squares += bin.squares / (bin.gain[0] + bin.gain[1]);
      rate_square = std::max(rate_square, bin.rate_square);
    }
    const double density = std::sqrt(std::max(squares / std::max(freedom, 1.0), kVarianceMin) *
                                     layout.interval_s[gyro]);
    NoiseTerms& terms = result.noise[gyro];
    if (free[gyro].white) {
      terms.white_dps_rthz = std::clamp(terms.white_dps_rthz, density * 1e-3, density * 3.0);
      fast.push_back(
          {gyro, Unknown::What::kWhite, std::log(density) - 9.0, std::log(density) + 2.0});
    }
    if (free[gyro].ratio && rate_square > 1.0) {
      const double most = 3.0 * density / std::sqrt(rate_square);
      terms.ratio_rthz = std::clamp(terms.ratio_rthz, most * 1e-3, most);
      fast.push_back({gyro, Unknown::What::kRatio, std::log(most) - 12.0, std::log(most) + 2.0});
    }
    if (free[gyro].walk) {
      terms.walk_dps_rts = std::clamp(terms.walk_dps_rts, density * 1e-4, density);
      slow.push_back(
          {gyro, Unknown::What::kWalk, std::log(density) - 12.0, std::log(density) + 1.0});
    }
    if (free[gyro].markov) {
      terms.markov.push_back({density * 0.1, 10.0});
      slow.push_back(
          {gyro, Unknown::What::kSigma, std::log(density) - 9.0, std::log(density) + 6.0});
      // A term whose memory is longer than this is a bias or a walk: it would never be seen to
      // forget.
      const double seconds = layout.blocks.empty() ? 1.0 : layout.blocks.back().t_s;
      slow.push_back({gyro, Unknown::What::kTau, std::log(0.5),
                      std::log(std::max(2.0, seconds / kMarkovSpans))});
    }
  }
  const auto within = [&](const PairNoise& noise) {
    return within_log_likelihood(bins, noise, layout);
  };
  maximise(result.noise, fast, 150, 1e-3, within);
  const Eigen::VectorXd means = block_means(residual, layout).col(0);
  const auto both = [&](const PairNoise& noise) {
    return within_log_likelihood(bins, noise, layout) +
           means_log_likelihood(means, layout, noise, part);
  };
  result.log_likelihood =
      maximise(result.noise, slow, 60 * static_cast<int>(slow.size()), 2e-2, both);
  // A correlated term of short memory shares its variance with the white noise.
  if ((free[0].markov || free[1].markov) && !fast.empty()) {
    maximise(result.noise, fast, 150, 1e-3, within);
    result.log_likelihood =
        maximise(result.noise, slow, 60 * static_cast<int>(slow.size()), 2e-2, both);
  }
  return result;
}

}  // namespace vgyro::gap
