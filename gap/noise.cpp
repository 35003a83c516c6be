#include "gap/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>
#include <type_traits>
#include <utility>

#include <nlopt.hpp>

#include "gap/kinds.h"

namespace vgyro::gap {

namespace {

// Below this a variance is rounding of the arithmetic, not noise: (1e-9 deg/s)².
constexpr double kVarianceMin = 1e-18;
// Intervals shorter than this part of a term's memory: beyond, a difference of the exponential has
// digits enough, here its series has.
constexpr double kShortMemories = 1e-3;

// Blocks whose white noise is about the same are one sum of squares: half octaves of the rate's
// square above 1 (deg/s)², below which no rate noise shows, and twentieths of the gain.
constexpr double kRateSquareMin = 1.0;
constexpr double kClassesPerOctave = 2.0;
constexpr double kClassesPerGain = 20.0;

// The search is over logarithms, and begins inside its bounds by this margin, with steps of a
// factor of two.
constexpr double kBoundMargin = 0.05;
constexpr double kFirstStep = 0.7;
constexpr double kLogOf0 = 1e-300;
// Of the white noise, where an evaluation costs nothing, and of the drift, where each filters the
// whole recording: there the likelihood need not be known better than a fiftieth of a nat.
constexpr int kFastEvaluations = 150;
constexpr double kFastTolerance = 1e-3;
constexpr int kSlowEvaluations = 60;  ///< for each unknown
constexpr double kSlowTolerance = 2e-2;
// A search that ended early is begun anew where it ended, while that gains more than its own
// tolerance explains; three times was enough.
constexpr int kAgainMax = 4;
constexpr double kAgainGain = 2.5;  ///< times the tolerance
// Drift is fitted by the means of so many blocks first; a memory that may be short then by all.
constexpr double kCoarseBlocks = 5.0;

// Bounds of a fitted logarithm, about that of the density by which samples scatter within their
// blocks; and where the search may begin, times that density. A walk's density is per √s of it.
struct Range {
  double down = 0.0;
  double up = 0.0;
  double start_low = 0.0;
  double start_high = 0.0;
};
// White noise makes all of the scatter or, beside others, next to nothing of it.
constexpr Range kWhiteRange{9.0, 2.0, 1e-3, 3.0};
// Likewise rate noise at the highest rate, which is seldom: it may be three times the mean.
constexpr Range kRatioRange{12.0, 2.0, 1e-3, 1.0};
constexpr double kRatioMost = 3.0;
// A walk shows over minutes far below the white noise of a sample.
constexpr Range kWalkRange{12.0, 1.0, 1e-4, 1.0};
// A correlated term may be far below it, and far above where the white noise is small.
constexpr Range kSigmaRange{9.0, 6.0, 0.1, 0.1};
// Below half a second blocks of a tenth cannot tell it from white noise.
constexpr double kTauMin_s = 0.5;
constexpr double kTauStart_s = 10.0;
// The search for a correlated term climbs one hill: it begins at the best of these memories, with
// the size by which the means scatter, and with little walk beside it.
constexpr std::array kTausTried_s{1.0, 4.0, 16.0, 64.0};
constexpr double kWalkBeside = 0.2;
// A term whose memory is longer than this part of the recording is a bias or a walk: it would never
// be seen to forget. Of a recording however short the bounds stay apart.
constexpr double kMarkovSpans = 8.0;
constexpr double kTauMaxLeast_s = 2.0;
// A cosine that lies on a limit, but for what clocks are off and blocks are uneven, lies beyond it.
constexpr double kFrequencySame = 0.02;

// From one switch-on to the next a gyro's bias is another one: some tenths of a deg/s for a cheap
// sensor. Wider would cost digits and gain nothing.
constexpr double kOtherStart_dps = 1.0;

// Steps from block to block that differ by less have exponentials that follow from each other.
constexpr double kStepGrain_s = 1e-4;
// Blocks of two channels follow each other at so many intervals, and some to spare.
constexpr std::size_t kStepsKept = 8;

// Of a block.
constexpr double kQuickTerm = 0.5;
// Of a mean's white noise this much is left in the filter at the least: it keeps variances above 0.
constexpr double kOwnShare = 0.1;

constexpr std::size_t kTermsMax = 1 + kFlickerTerms + kMarkovMax;
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

// Variance of a correlated term's mean over `seconds`, over its own.
double share_of_mean(const MarkovTerm& term, double seconds) {
  const double x = seconds / term.tau_s;
  return x > kShortMemories ? 2.0 / (x * x) * (x - 1.0 + std::exp(-x))
                            : 1.0 - x / 3.0 + x * x / 12.0;
}

// It forgets within a block: blocks hardly know of each other by it.
bool is_quick(const MarkovTerm& term, double block_s) {
  return term.tau_s < kQuickTerm * block_s;
}

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
    terms.each_correlated([&](const MarkovTerm& term) {
      if (states.count == kStatesMax || term.sigma_dps <= 0.0) return;
      states.gyro[states.count] = gyro;
      states.tau_s[states.count] = term.tau_s;
      states.stationary[states.count] =
          term.sigma_dps * term.sigma_dps *
          (is_quick(term, layout.block_s) ? share_of_mean(term, layout.block_s) : 1.0);
      states.start_variance[states.count] = states.stationary[states.count];
      ++states.count;
    });
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
      case Random::kFlicker:
        terms.flicker_dps = std::hypot(terms.flicker_dps, value);
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
// `without_quick_s`: of a block so long, without what is quick in it; 0: all.
double drift_within(const NoiseTerms& terms, double seconds, double without_quick_s) {
  double variance = terms.walk_dps_rts * terms.walk_dps_rts * seconds / 6.0;
  terms.each_correlated([&](const MarkovTerm& term) {
    if (is_quick(term, without_quick_s)) return;
    variance += term.sigma_dps * term.sigma_dps * (1.0 - share_of_mean(term, seconds));
  });
  return variance;
}

double drift_within(Channel channel, const PairNoise& noise, double seconds,
                    double without_quick_s = 0.0) {
  double variance = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (share_of(channel, gyro) != 0.0)
      variance += drift_within(noise[gyro], seconds, without_quick_s);
  }
  return variance;
}

double seconds_of(const Block& block, const Layout& layout) {
  const std::size_t gyro = block.channel == Channel::kGyro2 ? 1 : 0;
  return block.count * layout.interval_s[gyro];
}

}  // namespace

double sample_variance(const Block& block, const PairNoise& noise, const Layout& layout) {
  return white_variance(block.within_gain, block.rate_square, noise, layout) +
         layout.unseen.all * block.motion_power;
}

double mean_variance(const Block& block, const PairNoise& noise, const Layout& layout) {
  return white_variance(block.mean_gain, block.rate_square, noise, layout) +
         layout.unseen.mean * block.motion_power;
}

double within_variance(const Block& block, const PairNoise& noise, const Layout& layout) {
  return sample_variance(block, noise, layout) +
         drift_within(block.channel, noise, seconds_of(block, layout));
}

std::uint32_t cosines_below(const Block& block, double frequency_hz, const Layout& layout) {
  const double of_first_hz = 0.5 / seconds_of(block, layout);
  const double below = std::floor(frequency_hz / of_first_hz - kFrequencySame);
  return static_cast<std::uint32_t>(std::clamp(below, 0.0, static_cast<double>(block.count - 1)));
}

namespace {

double motion_of_cosine(const Block& block, std::uint32_t k, const Layout& layout) {
  const std::vector<double>& share = layout.unseen.cosine;
  if (block.motion_power == 0.0 || share.empty()) return 0.0;
  // Blocks that are longer or shorter than usual have cosines of other frequencies.
  const double usual = k * layout.block_s / seconds_of(block, layout);
  const auto place = static_cast<std::size_t>(std::max(1L, std::lround(usual)));
  return share[std::min(place, share.size()) - 1] * block.motion_power;
}

}  // namespace

double cosine_variance(const Block& block, std::uint32_t k, const PairNoise& noise,
                       const Layout& layout) {
  return white_variance(block.within_gain, block.rate_square, noise, layout) +
         drift_within(block.channel, noise, seconds_of(block, layout)) +
         motion_of_cosine(block, k, layout);
}

Matrix slowest_cosines(std::uint32_t samples, std::uint32_t cosines) {
  Matrix matrix(cosines, samples);
  const double norm = std::sqrt(2.0 / samples);
  for (std::uint32_t k = 0; k < cosines; ++k) {
    for (std::uint32_t i = 0; i < samples; ++i)
      matrix(k, i) = norm * std::cos(std::numbers::pi * (k + 1) * (i + 0.5) / samples);
  }
  return matrix;
}

namespace {

// The cosines of blocks one after the other: most are as long as the last.
class Cosines {
 public:
  const Matrix& of(const Block& block) {
    if (matrix_.cols() != block.count || matrix_.rows() != block.kept)
      matrix_ = slowest_cosines(block.count, block.kept);
    return matrix_;
  }

 private:
  Matrix matrix_;
};

bool is_all_kept(const Block& block) {
  return block.motion_power == 0.0;
}

}  // namespace

Matrix block_means(const Matrix& columns, const Layout& layout) {
  Matrix means(static_cast<Eigen::Index>(layout.blocks.size()), columns.cols());
  for (std::size_t b = 0; b < layout.blocks.size(); ++b) {
    const Block& block = layout.blocks[b];
    means.row(static_cast<Eigen::Index>(b)) =
        columns.middleRows(block.first, block.count).colwise().mean();
  }
  return means;
}

namespace {

// The Kalman filter of at most N drift states: one covariance, and a mean of the states for each
// column, because all columns have the same noise. It runs some thousand times in a search over the
// noise: N is known when it is compiled, and states that are not there are zeros.
template <int N>
class DriftFilter {
 public:
  DriftFilter(const States& states, Eigen::Index columns)
      : states_(states),
        width_(columns),
        count_(static_cast<int>(states.count)),
        x_(Columns::Zero(N, columns)) {
    for (int i = 0; i < count_; ++i) {
      const auto at = static_cast<std::size_t>(i);
      p_(i, i) = states_.start_variance[at];
      walk_[i] = states_.growth[at];
      stationary_[i] = states_.stationary[at];
      rate_[i] = is_walk(i) ? 0.0 : 1.0 / states_.tau_s[at];
      for (const Channel channel : {Channel::kGyro1, Channel::kGyro2, Channel::kDifference})
        share_[static_cast<std::size_t>(channel)][i] = share_of(channel, states_.gyro[at]);
    }
  }

  /// A further recording: nothing is left of the drift but what the gyros are.
  void begin_anew() {
    p_.setZero();
    for (int i = 0; i < count_; ++i) {
      p_(i, i) = is_walk(i) ? kOtherStart_dps * kOtherStart_dps
                            : states_.start_variance[static_cast<std::size_t>(i)];
    }
    x_.setZero();
  }

  void predict(double step_s) {
    set_step(step_s);
    p_.array() *= (decay_ * decay_.transpose()).array();
    p_.diagonal() += growth_;
    x_.array().colwise() *= decay_.array();
  }

  // Observations of a channel, one for each column → normalised innovations, in place; the states
  // take them in. Returns the innovations' variance; `variance` is what the observation has beside
  // the drift.
  double take(Channel channel, double variance, double* observation) {
    const Vector& share = share_[static_cast<std::size_t>(channel)];
    Vector gain;
    gain.noalias() = p_.lazyProduct(share);
    variance = std::max(variance + share.dot(gain), kVarianceMin);
    const double scale = 1.0 / std::sqrt(variance);
    gain *= scale;
    p_ -= gain.lazyProduct(gain.transpose());
    for (Eigen::Index c = 0; c < width_; ++c) {
      observation[c] = scale * (observation[c] - share.dot(x_.col(c)));
      x_.col(c) += observation[c] * gain;
    }
    return variance;
  }

 private:
  using Vector = Eigen::Matrix<double, N, 1>;
  using Columns = Eigen::Matrix<double, N, Eigen::Dynamic>;

  struct Near {
    std::size_t grain = static_cast<std::size_t>(-1);
    double step_s = 0.0;
    Vector decay = Vector::Zero();
  };

  [[nodiscard]] bool is_walk(int state) const {
    return states_.tau_s[static_cast<std::size_t>(state)] == 0.0;
  }

  // An exponential is dear: it is known from one of the last few steps, which was about as long.
  void set_step(double step_s) {
    const auto grain = static_cast<std::size_t>(step_s / kStepGrain_s);
    Near& near = near_[grain % near_.size()];
    if (near.grain != grain) {
      near.grain = grain;
      near.step_s = step_s;
      for (int i = 0; i < count_; ++i)
        near.decay[i] = std::exp(-step_s * rate_[i]);
    }
    // Its series to the third power: less than a grain is short beside every memory of which
    // something is left after a step.
    const Vector x = (step_s - near.step_s) * rate_;
    decay_ = near.decay.array() * (1.0 - x.array() * (1.0 - x.array() * (0.5 - x.array() / 6.0)));
    growth_ = walk_.array() * step_s + stationary_.array() * (1.0 - decay_.array().square());
  }

  const States& states_;
  Eigen::Index width_;
  int count_;
  Eigen::Matrix<double, N, N> p_ = Eigen::Matrix<double, N, N>::Zero();
  Columns x_;
  std::array<Vector, 3> share_{Vector::Zero(), Vector::Zero(), Vector::Zero()};  // by channel
  Vector rate_ = Vector::Zero();  // 1/τ; of a walk 0
  Vector walk_ = Vector::Zero();
  Vector stationary_ = Vector::Zero();
  Vector decay_ = Vector::Zero();  // by the present step, as growth_
  Vector growth_ = Vector::Zero();
  std::array<Near, kStepsKept> near_;
};

// −½ Σ log of variances: a logarithm of some together is one.
class HalfLogs {
 public:
  void add(double variance) {
    product_ *= variance;
    if (product_ > kProductMin && product_ < 1.0 / kProductMin) return;
    close();
  }
  double sum() {
    close();
    return sum_;
  }

 private:
  // Far from what a double cannot hold, with one more variance in it.
  static constexpr double kProductMin = 1e-200;

  void close() {
    sum_ -= 0.5 * std::log(product_);
    product_ = 1.0;
  }

  double sum_ = 0.0;
  double product_ = 1.0;
};

// drift_within of blocks one after the other, without quick terms: it is dear, and most are as long
// as the last.
class BlockDrift {
 public:
  BlockDrift(const PairNoise& noise, const Layout& layout) : noise_(noise), layout_(layout) {}

  double variance(const Block& block) {
    Last& last = last_[static_cast<std::size_t>(block.channel)];
    if (block.count != last.count) {
      last.count = block.count;
      last.variance =
          drift_within(block.channel, noise_, seconds_of(block, layout_), layout_.block_s);
    }
    return last.variance;
  }

 private:
  struct Last {
    std::uint32_t count = 0;  // of no block
    double variance = 0.0;
  };

  const PairNoise& noise_;
  const Layout& layout_;
  std::array<Last, 3> last_{};  // by channel
};

template <int N>
double whiten_means(Matrix& means, const Layout& layout, const PairNoise& noise, Part part,
                    const States& states) {
  const auto width = static_cast<std::size_t>(means.cols());
  DriftFilter<N> filter(states, means.cols());
  BlockDrift drift(noise, layout);
  HalfLogs logs;
  double last_s = 0.0;
  for (std::size_t b = 0; b < layout.blocks.size(); ++b) {
    const Block& block = layout.blocks[b];
    if (block.begins) {
      filter.begin_anew();
      last_s = block.t_s;
    }
    filter.predict(std::max(0.0, block.t_s - last_s));
    last_s = std::max(last_s, block.t_s);
    // A mean's increments are less than those of the drift at its middle, by as much as the drift
    // scatters within a block: then both variance and covariance of the means are right.
    // Of quick terms the states are means themselves.
    const double white = mean_variance(block, noise, layout);
    const double own_variance = std::max(white - drift.variance(block), kOwnShare * white);
    double* const innovation = means.data() + b * width;
    const double variance = filter.take(block.channel, own_variance, innovation);
    if (counts(block, part)) {
      logs.add(variance);
    } else {
      std::fill(innovation, innovation + width, 0.0);
    }
  }
  return logs.sum();
}

template <int N>
using Most = std::integral_constant<int, N>;

}  // namespace

double whiten_means(Matrix& means, const Layout& layout, const PairNoise& noise, Part part) {
  const States states = states_of(noise, layout);
  const auto with = [&](auto most) {
    return whiten_means<decltype(most)::value>(means, layout, noise, part, states);
  };
  // Even numbers: the machine works on two at a time.
  if (states.count <= 2) return with(Most<2>());
  if (states.count <= 4) return with(Most<4>());
  if (states.count <= 6) return with(Most<6>());
  if (states.count <= 8) return with(Most<8>());
  if (states.count <= 10) return with(Most<10>());
  if (states.count <= 14) return with(Most<14>());
  return with(Most<kStatesMax>());
}

double whiten_within(Matrix& columns, const Layout& layout, const PairNoise& noise, Part part) {
  Cosines cosines;
  double log_likelihood = 0.0;
  for (const Block& block : layout.blocks) {
    auto rows = columns.middleRows(block.first, block.count);
    if (!counts(block, part)) {
      rows.setZero();
      continue;
    }
    if (is_all_kept(block)) {
      const double variance = within_variance(block, noise, layout);
      const Eigen::RowVectorXd mean = rows.colwise().mean();
      rows = (rows.rowwise() - mean) / std::sqrt(variance);
      log_likelihood -= 0.5 * static_cast<double>(block.count - 1) * std::log(variance);
      continue;
    }
    const Matrix slow = cosines.of(block) * rows;
    rows.setZero();
    for (std::uint32_t k = 0; k < block.kept; ++k) {
      const double variance = cosine_variance(block, k + 1, noise, layout);
      rows.row(k) = slow.row(k) / std::sqrt(variance);
      log_likelihood -= 0.5 * std::log(variance);
    }
  }
  return log_likelihood;
}

namespace {

// Classes of what spans many octaves; 0 is one of its own.
int octave_class(double value) {
  constexpr int kLeast = -100;
  return value > 0.0 ? std::max(kLeast, static_cast<int>(std::floor(2.0 * std::log2(value))))
                     : kLeast - 1;
}

}  // namespace

template <class Columns>
void turn_within(Columns& columns, const Layout& layout) {
  Cosines cosines;
  for (const Block& block : layout.blocks) {
    auto rows = columns.middleRows(block.first, block.count);
    if (is_all_kept(block)) {
      const auto mean = rows.colwise().mean().eval();
      rows = rows.rowwise() - mean;
      continue;
    }
    const auto slow = (cosines.of(block).template cast<typename Columns::Scalar>() * rows).eval();
    rows.setZero();
    rows.topRows(block.kept) = slow;
  }
}
template void turn_within(Matrix& columns, const Layout& layout);
template void turn_within(FloatMatrix& columns, const Layout& layout);

Eigen::VectorXd within_weights(const Layout& layout, const PairNoise& noise, Part part) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.samples));
  for (const Block& block : layout.blocks) {
    if (!counts(block, part)) continue;
    auto rows = weights.segment(block.first, block.count);
    if (is_all_kept(block)) {
      rows.setConstant(1.0 / within_variance(block, noise, layout));
      continue;
    }
    for (std::uint32_t k = 0; k < block.kept; ++k)
      rows[k] = 1.0 / cosine_variance(block, k + 1, noise, layout);
  }
  return weights;
}

namespace {

// Sums by classes of about the same variance.
class Bins {
 public:
  void add(const Block& block, double freedom, double squares, double motion, double seconds) {
    const int rate_class =
        block.rate_square < kRateSquareMin
            ? 0
            : 1 + static_cast<int>(kClassesPerOctave * std::log2(block.rate_square));
    const int gain_class =
        static_cast<int>(kClassesPerGain * (block.within_gain[0] + block.within_gain[1]));
    WithinBin& bin =
        bins_[{static_cast<int>(block.channel), rate_class, gain_class, octave_class(motion)}];
    bin.channel = block.channel;
    bin.rate_square += freedom * block.rate_square;
    for (std::size_t i = 0; i < bin.gain.size(); ++i)
      bin.gain[i] += freedom * block.within_gain[i];
    bin.motion += freedom * motion;
    bin.seconds += freedom * seconds;
    bin.freedom += freedom;
    bin.squares += squares;
  }

  [[nodiscard]] std::vector<WithinBin> means() {
    std::vector<WithinBin> list;
    for (auto& [key, bin] : bins_) {
      bin.rate_square /= bin.freedom;
      for (double& gain : bin.gain)
        gain /= bin.freedom;
      bin.motion /= bin.freedom;
      bin.seconds /= bin.freedom;
      list.push_back(bin);
    }
    return list;
  }

 private:
  std::map<std::tuple<int, int, int, int>, WithinBin> bins_;
};

}  // namespace

std::vector<WithinBin> within_bins(const Eigen::VectorXd& residual, const Layout& layout,
                                   Part part) {
  Bins bins;
  Cosines cosines;
  for (const Block& block : layout.blocks) {
    if (!counts(block, part) || block.count < 2) continue;
    const auto values = residual.segment(block.first, block.count);
    const double seconds = seconds_of(block, layout);
    if (is_all_kept(block)) {
      bins.add(block, block.count - 1.0, (values.array() - values.mean()).square().sum(), 0.0,
               seconds);
      continue;
    }
    const Eigen::VectorXd slow = cosines.of(block) * values;
    for (std::uint32_t k = 0; k < block.kept; ++k) {
      const double motion = motion_of_cosine(block, k + 1, layout);
      bins.add(block, 1.0, slow[k] * slow[k], motion, seconds);
    }
  }
  return bins.means();
}

double within_log_likelihood(const std::vector<WithinBin>& bins, const PairNoise& noise,
                             const Layout& layout) {
  double sum = 0.0;
  for (const WithinBin& bin : bins) {
    const double variance = white_variance(bin.gain, bin.rate_square, noise, layout) + bin.motion +
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
  enum class What : std::uint8_t { kWhite, kRatio, kWalk, kFlicker, kSigma, kTau };
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
    case Unknown::What::kFlicker:
      return terms.flicker_dps;
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
    x[i] = std::clamp(std::log(std::max(value_of(noise, unknowns[i]), kLogOf0)),
                      low[i] + kBoundMargin, high[i] - kBoundMargin);
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
  // Quadratic models need a third of a simplex's looks; they need two directions at least.
  nlopt::opt search(count > 1 ? nlopt::LN_BOBYQA : nlopt::LN_SBPLX, count);
  search.set_lower_bounds(low);
  search.set_upper_bounds(high);
  search.set_initial_step(kFirstStep);
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
  double best = std::numeric_limits<double>::lowest();
  // A model that fits badly ends a search early: begun anew it finds what is left.
  for (int again = 0; again < kAgainMax; ++again) {
    const double before = best;
    try {
      search.optimize(x, best);
    } catch (const std::exception&) {
      // The best point so far is in x.
    }
    if (count == 1 || best - before < kAgainGain * tolerance) break;
    for (unsigned i = 0; i < count; ++i)
      x[i] = std::clamp(x[i], low[i] + kBoundMargin, high[i] - kBoundMargin);
  }
  apply(x, context);
  noise = context.noise;
  return log_likelihood_of(noise);
}

// What samples scatter by within the blocks that a gyro is in.
struct Scatter {
  double density_dps_rthz = 0.0;
  double rate_square = 0.0;  // the highest of a bin, (deg/s)²
};

Scatter scatter_of(const std::vector<WithinBin>& bins, std::size_t gyro, double interval_s) {
  double freedom = 0.0;
  double squares = 0.0;
  Scatter scatter;
  for (const WithinBin& bin : bins) {
    if (bin.gain[gyro] == 0.0) continue;
    freedom += bin.freedom;
    const double expected = bin.freedom * bin.motion;
    squares += std::max(0.0, bin.squares - expected) / (bin.gain[0] + bin.gain[1]);
    scatter.rate_square = std::max(scatter.rate_square, bin.rate_square);
  }
  scatter.density_dps_rthz =
      std::sqrt(std::max(squares / std::max(freedom, 1.0), kVarianceMin) * interval_s);
  return scatter;
}

// Makes one term free: gives it a sane start, and bounds.
void set_free(double& value, std::size_t gyro, Unknown::What what, double typical,
              const Range& range, std::vector<Unknown>& unknowns) {
  value = std::clamp(value, typical * range.start_low, typical * range.start_high);
  unknowns.push_back({gyro, what, std::log(typical) - range.down, std::log(typical) + range.up});
}

void set_white_free(NoiseTerms& terms, std::size_t gyro, const Scatter& scatter,
                    const Freedom& free, std::vector<Unknown>& unknowns) {
  const double density = scatter.density_dps_rthz;
  if (free.white)
    set_free(terms.white_dps_rthz, gyro, Unknown::What::kWhite, density, kWhiteRange, unknowns);
  if (free.ratio && scatter.rate_square > kRateSquareMin) {
    const double most = kRatioMost * density / std::sqrt(scatter.rate_square);
    set_free(terms.ratio_rthz, gyro, Unknown::What::kRatio, most, kRatioRange, unknowns);
  }
}

void set_drift_free(NoiseTerms& terms, std::size_t gyro, double density, double seconds,
                    const Freedom& free, std::vector<Unknown>& unknowns) {
  if (free.walk)
    set_free(terms.walk_dps_rts, gyro, Unknown::What::kWalk, density, kWalkRange, unknowns);
  if (free.flicker)
    set_free(terms.flicker_dps, gyro, Unknown::What::kFlicker, density, kSigmaRange, unknowns);
  if (!free.markov) return;
  terms.markov.push_back({0.0, kTauStart_s});
  set_free(terms.markov.back().sigma_dps, gyro, Unknown::What::kSigma, density, kSigmaRange,
           unknowns);
  unknowns.push_back({gyro, Unknown::What::kTau, std::log(kTauMin_s),
                      std::log(std::max(kTauMaxLeast_s, seconds / kMarkovSpans))});
}

}  // namespace

namespace {

// Means of some blocks that follow each other: a drift of seconds and more is as plain in them, and
// a filter over them costs a part.
struct CoarseMeans {
  Layout layout;
  Eigen::VectorXd means;
};

class Coarsening {
 public:
  Coarsening(const Layout& layout, const Eigen::VectorXd& means) : from_(layout), means_(means) {
    coarse_.layout.interval_s = layout.interval_s;
    coarse_.layout.reference_variance = layout.reference_variance;
    coarse_.layout.unseen = layout.unseen;
    coarse_.layout.block_s = kCoarseBlocks * layout.block_s;
  }

  CoarseMeans of_all() {
    for (std::size_t b = 0; b < from_.blocks.size(); ++b) {
      const Block& block = from_.blocks[b];
      const double cell = std::floor(block.t_s / coarse_.layout.block_s);
      if (cell != cell_ || block.begins) close();
      cell_ = cell;
      begins_ = begins_ || block.begins;
      Open& open = open_[static_cast<std::size_t>(block.channel)];
      if (open.block.count > 0 && open.block.held_out != block.held_out) close(open);
      add(block, means_[static_cast<Eigen::Index>(b)], open);
    }
    close();
    coarse_.means = Eigen::Map<const Eigen::VectorXd>(means_of_.data(),
                                                      static_cast<Eigen::Index>(means_of_.size()));
    return std::move(coarse_);
  }

 private:
  // Sums weighed by counts, until it is closed.
  struct Open {
    Block block;
    double mean = 0.0;
  };

  static void add(const Block& block, double mean, Open& open) {
    const auto weight = static_cast<double>(block.count);
    Block& sum = open.block;
    sum.channel = block.channel;
    sum.held_out = block.held_out;
    sum.count += block.count;
    sum.t_s += weight * block.t_s;
    sum.rate_square += weight * block.rate_square;
    for (std::size_t i = 0; i < sum.mean_gain.size(); ++i)
      sum.mean_gain[i] += weight * weight * block.mean_gain[i];
    sum.motion_power += weight * weight * block.motion_power;
    open.mean += weight * mean;
  }

  // Channels follow each other block by block, as the gyros' samples do at rest.
  void close() {
    for (Open& open : open_)
      close(open);
  }

  void close(Open& open) {
    Block& block = open.block;
    if (block.count == 0) return;
    const auto count = static_cast<double>(block.count);
    block.t_s /= count;
    block.rate_square /= count;
    for (double& gain : block.mean_gain)
      gain /= count * count;
    block.motion_power /= count * count;
    block.begins = std::exchange(begins_, false);
    coarse_.layout.blocks.push_back(block);
    means_of_.push_back(open.mean / count);
    open = {};
  }

  const Layout& from_;
  const Eigen::VectorXd& means_;
  CoarseMeans coarse_;
  std::vector<double> means_of_;
  std::array<Open, 3> open_;  // by channel
  double cell_ = -1.0;
  bool begins_ = false;  // what is closed next is a recording's first
};

// Standard deviation of the means that a gyro is in.
double scatter_of_means(const CoarseMeans& coarse, std::size_t gyro) {
  double count = 0.0;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t b = 0; b < coarse.layout.blocks.size(); ++b) {
    if (share_of(coarse.layout.blocks[b].channel, gyro) == 0.0) continue;
    const double mean = coarse.means[static_cast<Eigen::Index>(b)];
    count += 1.0;
    sum += mean;
    squares += mean * mean;
  }
  count = std::max(count, 1.0);
  return std::sqrt(std::max(squares / count - sum / count * sum / count, kVarianceMin));
}

// Where the search for the newest correlated term begins: where it was, or at a memory that is
// likelier.
template <class LogLikelihood>
void set_likely_memory(PairNoise& noise, std::size_t gyro, const Freedom& free, double sigma_dps,
                       const LogLikelihood& log_likelihood_of) {
  PairNoise trial = noise;
  if (free.walk) trial[gyro].walk_dps_rts *= kWalkBeside;
  double top = log_likelihood_of(noise);
  for (const double tau_s : kTausTried_s) {
    trial[gyro].markov.back() = {sigma_dps, tau_s};
    const double now = log_likelihood_of(trial);
    if (now <= top) continue;
    top = now;
    noise = trial;
  }
}

}  // namespace

NoiseFitResult fit_pair_noise(const Eigen::VectorXd& residual, const Layout& layout,
                              const PairNoise& start, const std::array<Freedom, 2>& free,
                              const std::array<bool, 2>& used, Part part) {
  NoiseFitResult result{start, 0.0};
  const std::vector<WithinBin> bins = within_bins(residual, layout, part);
  const double seconds = layout.blocks.empty() ? 1.0 : layout.blocks.back().t_s;
  std::vector<Unknown> fast;
  std::vector<Unknown> slow;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!used[gyro]) continue;
    const Scatter scatter = scatter_of(bins, gyro, layout.interval_s[gyro]);
    NoiseTerms& terms = result.noise[gyro];
    set_white_free(terms, gyro, scatter, free[gyro], fast);
    set_drift_free(terms, gyro, scatter.density_dps_rthz, seconds, free[gyro], slow);
  }
  const Eigen::VectorXd means = block_means(residual, layout).col(0);
  const auto within = [&](const PairNoise& noise) {
    return within_log_likelihood(bins, noise, layout);
  };
  const auto both = [&](const PairNoise& noise) {
    return within(noise) + means_log_likelihood(means, layout, noise, part);
  };
  const CoarseMeans coarse = Coarsening(layout, means).of_all();
  const auto coarsely = [&](const PairNoise& noise) {
    return within(noise) + means_log_likelihood(coarse.means, coarse.layout, noise, part);
  };
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (used[gyro] && free[gyro].markov)
      set_likely_memory(result.noise, gyro, free[gyro], scatter_of_means(coarse, gyro), coarsely);
  }
  const int evaluations = kSlowEvaluations * static_cast<int>(slow.size());
  const auto fit_once = [&](const auto& log_likelihood_of) {
    maximise(result.noise, fast, kFastEvaluations, kFastTolerance, within);
    maximise(result.noise, slow, evaluations, kSlowTolerance, log_likelihood_of);
  };
  fit_once(coarsely);
  // A correlated term of short memory shares its variance with the white noise; and from where the
  // search begins size and memory are a long way for one go.
  if (free[0].markov || free[1].markov) fit_once(both);
  result.log_likelihood = both(result.noise);
  return result;
}

}  // namespace vgyro::gap
