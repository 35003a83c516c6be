#include "gap/views.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include <Eigen/Cholesky>
#include <unsupported/Eigen/FFT>

namespace vgyro::gap {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::size_t kSpectrumPoints = 200;
constexpr std::size_t kSegmentMin = 64;
constexpr double kPresentMin = 0.9;  ///< of a stretch that is transformed or averaged
constexpr std::size_t kBins = 24;
constexpr double kBinShareMin = 0.002;
constexpr double kBinSamplesMin = 3.0;  ///< fewer have no scatter of their own
/// Of the largest diagonal element, added to each: above the rounding of a sum over all samples.
constexpr double kSilentShare = 1e-12;
constexpr double kMostOfGain = 0.9;
constexpr std::size_t kCellsMax = 600;

std::size_t power_of_two_from(std::size_t n) {
  std::size_t power = 1;
  while (power < n)
    power *= 2;
  return power;
}

// Periodograms of half-overlapping tapered segments, averaged; empty where no segment is whole.
std::vector<double> averaged_psd(const EvenSeries& series, std::size_t length) {
  std::vector<double> window(length);
  double window_square = 0.0;
  for (std::size_t i = 0; i < length; ++i) {
    const double phase = (static_cast<double>(i) + 0.5) / static_cast<double>(length);
    window[i] = 0.5 - 0.5 * std::cos(2.0 * kPi * phase);
    window_square += window[i] * window[i];
  }
  Eigen::FFT<double> transform;
  std::vector<double> psd(length / 2, 0.0);
  std::vector<double> segment(length);
  std::vector<std::complex<double>> spectrum;
  double segments = 0.0;
  for (std::size_t from = 0; from + length <= series.value.size(); from += length / 2) {
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < length; ++i) {
      sum += series.value[from + i];
      count += series.present[from + i];
    }
    if (count < kPresentMin * static_cast<double>(length)) continue;
    for (std::size_t i = 0; i < length; ++i) {
      segment[i] =
          series.present[from + i] != 0 ? window[i] * (series.value[from + i] - sum / count) : 0.0;
    }
    transform.fwd(spectrum, segment);
    // What is missing is missing in power, too.
    const double scale = series.interval_s * static_cast<double>(length) / (window_square * count);
    for (std::size_t i = 0; i < psd.size(); ++i)
      psd[i] += scale * std::norm(spectrum[i]);
    segments += 1.0;
  }
  if (segments == 0.0) return {};
  for (double& value : psd)
    value /= segments;
  return psd;
}

}  // namespace

double weight_of(Channel channel, std::size_t gyro, Sight sight) {
  const bool difference = channel == Channel::kDifference;
  if (difference ? sight == Sight::kOwn : sight == Sight::kDifference) return 0.0;
  return share_of(channel, gyro);
}

Sight main_sight(const Observations& data, std::size_t gyro) {
  double own = 0.0;
  double difference = 0.0;
  for (const Channel channel : data.channel) {
    own += std::abs(weight_of(channel, gyro, Sight::kOwn));
    difference += std::abs(weight_of(channel, gyro, Sight::kDifference));
  }
  return difference > own ? Sight::kDifference : Sight::kOwn;
}

EvenSeries even_series(const Observations& data, std::size_t gyro, Sight sight,
                       const Eigen::VectorXd& values) {
  EvenSeries series;
  series.interval_s = data.layout.interval_s[sight == Sight::kDifference ? 0 : gyro];
  if (sight == Sight::kBoth) {
    series.interval_s = data.holds[1 - gyro]
                            ? std::max(data.layout.interval_s[0], data.layout.interval_s[1])
                            : data.layout.interval_s[gyro];
  }
  if (data.t_s.empty() || series.interval_s <= 0.0) return series;
  const double end_s = *std::max_element(data.t_s.begin(), data.t_s.end());
  const std::size_t slots = static_cast<std::size_t>(std::max(0.0, end_s) / series.interval_s) + 2;
  series.value.assign(slots, 0.0);
  series.present.assign(slots, 0);
  std::vector<float> count(slots, 0.0F);
  for (std::size_t i = 0; i < data.t_s.size(); ++i) {
    const double weight = weight_of(data.channel[i], gyro, sight);
    if (weight == 0.0) continue;
    const auto slot = std::min(
        slots - 1,
        static_cast<std::size_t>(std::lround(std::max(0.0, data.t_s[i]) / series.interval_s)));
    series.value[slot] += weight * values[static_cast<Eigen::Index>(i)];
    series.present[slot] = 1;
    count[slot] += 1.0F;
  }
  for (std::size_t i = 0; i < slots; ++i) {
    if (count[i] > 1.0F) series.value[i] /= static_cast<double>(count[i]);
  }
  return series;
}

Curve spectrum_curve(const EvenSeries& series, std::string label) {
  Curve curve;
  curve.label = std::move(label);
  std::size_t length = power_of_two_from(std::max<std::size_t>(series.value.size() / 8, 1));
  std::vector<double> psd;
  for (; length >= kSegmentMin && psd.empty(); length /= 2)
    psd = averaged_psd(series, length);
  if (psd.empty()) return curve;
  const double resolution_hz = 0.5 / (static_cast<double>(psd.size()) * series.interval_s);
  // The lowest two hold what the taper makes of the mean.
  const double ratio =
      std::pow(static_cast<double>(psd.size()) / 2.0, 1.0 / static_cast<double>(kSpectrumPoints));
  double edge = 2.0;
  for (std::size_t i = 2; i < psd.size();) {
    edge = std::max(edge * ratio, static_cast<double>(i) + 0.5);
    double sum = 0.0;
    double place = 0.0;
    double count = 0.0;
    for (; i < psd.size() && static_cast<double>(i) < edge; ++i) {
      sum += psd[i];
      place += static_cast<double>(i);
      count += 1.0;
    }
    if (count == 0.0) continue;
    curve.x.push_back(place / count * resolution_hz);
    curve.y.push_back(std::sqrt(sum / count));
  }
  return curve;
}

Curve allan_curve(const EvenSeries& series, std::string label) {
  Curve curve;
  curve.label = std::move(label);
  const std::size_t n = series.value.size();
  std::vector<double> sum(n + 1, 0.0);
  std::vector<double> count(n + 1, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    sum[i + 1] = sum[i] + series.value[i];
    count[i + 1] = count[i] + series.present[i];
  }
  std::size_t last = 0;
  // NOLINTNEXTLINE(clang-analyzer-security.FloatLoopCounter): it grows by a factor
  for (double wish = 1.0; wish <= static_cast<double>(n) / 3.0; wish *= std::sqrt(2.0)) {
    const auto m = static_cast<std::size_t>(std::lround(wish));
    if (m == last) continue;
    last = m;
    const double least = kPresentMin * static_cast<double>(m);
    const std::size_t stride = std::max<std::size_t>(1, m / 16);
    double squares = 0.0;
    double terms = 0.0;
    for (std::size_t i = 0; i + 2 * m <= n; i += stride) {
      const double first = count[i + m] - count[i];
      const double second = count[i + 2 * m] - count[i + m];
      if (first < least || second < least) continue;
      const double step = (sum[i + 2 * m] - sum[i + m]) / second - (sum[i + m] - sum[i]) / first;
      squares += step * step;
      terms += 1.0;
    }
    // A handful of terms says nothing yet.
    if (terms * static_cast<double>(stride) < static_cast<double>(m) || terms < 4.0) continue;
    curve.x.push_back(static_cast<double>(m) * series.interval_s);
    curve.y.push_back(std::sqrt(0.5 * squares / terms));
  }
  return curve;
}

double allan_deviation(const NoiseTerms& terms, double interval_s, double rate_square,
                       double tau_s) {
  double variance = terms.variance(rate_square, interval_s) * interval_s / tau_s +
                    terms.walk_dps_rts * terms.walk_dps_rts * tau_s / 3.0;
  terms.each_correlated([&](const MarkovTerm& term) {
    const double x = tau_s / term.tau_s;
    // 2σ²/x² (… ) loses its digits for small x, where the term is a random walk.
    const double shape = x < 1e-3
                             ? x / 3.0 * 2.0
                             : (2.0 * x - 3.0 + 4.0 * std::exp(-x) - std::exp(-2.0 * x)) / (x * x);
    variance += term.sigma_dps * term.sigma_dps * shape;
  });
  return std::sqrt(variance);
}

double noise_psd(const NoiseTerms& terms, double interval_s, double rate_square,
                 double frequency_hz) {
  const double omega = 2.0 * kPi * frequency_hz;
  double psd = terms.variance(rate_square, interval_s) * interval_s +
               terms.walk_dps_rts * terms.walk_dps_rts / (omega * omega);
  terms.each_correlated([&](const MarkovTerm& term) {
    const double x = omega * term.tau_s;
    psd += 2.0 * term.sigma_dps * term.sigma_dps * term.tau_s / (1.0 + x * x);
  });
  return psd;
}

double mean_rate_square(const Observations& data, std::size_t gyro) {
  double sum = 0.0;
  double count = 0.0;
  for (const Block& block : data.layout.blocks) {
    if (share_of(block.channel, gyro) == 0.0) continue;
    sum += block.count * block.rate_square;
    count += block.count;
  }
  return count > 0.0 ? sum / count : 0.0;
}

Eigen::VectorXd simulate_residual(const Observations& data, const PairNoise& noise,
                                  std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<std::uint32_t> order(data.t_s.size());
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return data.t_s[a] < data.t_s[b]; });
  std::vector<std::array<double, 3>> gain(data.t_s.size());
  for (const Block& block : data.layout.blocks)
    std::fill_n(gain.begin() + block.first, block.count, block.within_gain);
  std::array<double, 2> walk{};
  std::array<std::vector<double>, 2> correlated;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    noise[gyro].each_correlated([&](const MarkovTerm& term) {
      correlated[gyro].push_back(term.sigma_dps * normal(random));
    });
  }
  Eigen::VectorXd residual(data.size());
  double last_s = 0.0;
  for (const std::uint32_t i : order) {
    const double step_s = std::max(0.0, data.t_s[i] - last_s);
    last_s = std::max(last_s, data.t_s[i]);
    double value = 0.0;
    double variance = gain[i][2] * data.layout.reference_variance;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (!data.holds[gyro]) continue;
      const NoiseTerms& terms = noise[gyro];
      walk[gyro] += terms.walk_dps_rts * std::sqrt(step_s) * normal(random);
      double drift = walk[gyro];
      std::size_t k = 0;
      terms.each_correlated([&](const MarkovTerm& term) {
        double& state = correlated[gyro][k++];
        const double decay = std::exp(-step_s / term.tau_s);
        state = decay * state + term.sigma_dps * std::sqrt(1.0 - decay * decay) * normal(random);
        drift += state;
      });
      const double rate_dps = data.rate[gyro][i].value;
      value += share_of(data.channel[i], gyro) * drift;
      variance += gain[i][gyro] * terms.variance(rate_dps * rate_dps, data.layout.interval_s[gyro]);
    }
    residual[static_cast<Eigen::Index>(i)] = value + std::sqrt(variance) * normal(random);
  }
  return residual;
}

PairNoise usable_noise(const Observations& data, const std::vector<model::Effect>& effects,
                       const Eigen::VectorXd& residual) {
  PairNoise noise = noise_of(effects);
  std::array<Freedom, 2> free;
  bool silent = false;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const bool unknown =
        data.holds[gyro] && noise[gyro].white_dps_rthz <= 0.0 && noise[gyro].ratio_rthz <= 0.0;
    free[gyro] = {unknown, unknown, unknown && noise[gyro].walk_dps_rts <= 0.0, false};
    silent = silent || unknown;
  }
  if (!silent) return noise;
  return fit_pair_noise(residual, data.layout, noise, free, data.holds, Part::kAll).noise;
}

std::vector<double> block_gains(const Layout& layout, const PairNoise& noise,
                                const Eigen::VectorXd& without, const Eigen::VectorXd& with) {
  Matrix columns(without.size(), 2);
  columns.col(0) = without;
  columns.col(1) = with;
  Matrix means = block_means(columns, layout);
  whiten_within(columns, layout, noise, Part::kAll);
  whiten_means(means, layout, noise, Part::kAll);
  std::vector<double> gains(layout.blocks.size());
  for (std::size_t b = 0; b < gains.size(); ++b) {
    const auto rows = columns.middleRows(layout.blocks[b].first, layout.blocks[b].count);
    const auto mean = means.row(static_cast<Eigen::Index>(b));
    gains[b] = 0.5 * (rows.col(0).squaredNorm() - rows.col(1).squaredNorm() + mean[0] * mean[0] -
                      mean[1] * mean[1]);
  }
  return gains;
}

namespace {

void place_in_time(const Layout& layout, double seconds, const std::vector<double>& gains,
                   Where& where) {
  const double cell_s = std::max(1.0, seconds / static_cast<double>(kCellsMax));
  const auto cells = static_cast<std::size_t>(seconds / cell_s) + 1;
  std::vector<double> until(cells + 1, 0.0);
  for (std::size_t b = 0; b < gains.size(); ++b) {
    const double place = std::max(0.0, layout.blocks[b].t_s) / cell_s;
    until[std::min(cells - 1, static_cast<std::size_t>(place)) + 1] += gains[b];
  }
  std::partial_sum(until.begin(), until.end(), until.begin());
  where.from_s = 0.0;
  where.to_s = seconds;
  if (until.back() <= 0.0) return;
  std::size_t shortest = cells;
  for (std::size_t from = 0; from < cells; ++from) {
    for (std::size_t to = from + 1; to <= cells && to - from < shortest; ++to) {
      if (until[to] - until[from] < kMostOfGain * until.back()) continue;
      shortest = to - from;
      where.from_s = cell_s * static_cast<double>(from);
      where.to_s = std::min(seconds, cell_s * static_cast<double>(to));
    }
  }
}

}  // namespace

Where where_of(const Observations& data, std::size_t gyro, const PairNoise& noise, double seconds,
               const std::vector<double>& gains, const Eigen::VectorXd& shape) {
  Where where;
  place_in_time(data.layout, seconds, gains, where);
  EvenSeries series = even_series(data, gyro, Sight::kBoth, shape);
  const std::size_t length = power_of_two_from(series.value.size());
  series.value.resize(length, 0.0);
  Eigen::FFT<double> transform;
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, series.value);
  const double resolution_hz = 1.0 / (static_cast<double>(length) * series.interval_s);
  const double rate_square = mean_rate_square(data, gyro);
  std::vector<double> until(length / 2 + 1, 0.0);
  for (std::size_t i = 0; i < length / 2; ++i) {
    const double frequency_hz = std::max(static_cast<double>(i), 0.25) * resolution_hz;
    double psd = 0.0;
    for (std::size_t k = 0; k < 2; ++k) {
      if (data.holds[k])
        psd += noise_psd(noise[k], data.layout.interval_s[k], rate_square, frequency_hz);
    }
    const double weight = i == 0 ? 0.5 : 1.0;
    until[i + 1] = until[i] + weight * std::norm(spectrum[i]) / std::max(psd, 1e-300);
  }
  where.high_hz = 0.5 / series.interval_s;
  if (until.back() <= 0.0) return where;
  std::size_t narrowest = length;
  for (std::size_t from = 0, to = 0; from < length / 2; ++from) {
    while (to < length / 2 && until[to] - until[from] < kMostOfGain * until.back())
      ++to;
    if (until[to] - until[from] < kMostOfGain * until.back()) break;
    if (to - from >= narrowest) continue;
    narrowest = to - from;
    where.low_hz = static_cast<double>(from) * resolution_hz;
    where.high_hz = static_cast<double>(to) * resolution_hz;
  }
  if (where.low_hz < 2.0 / seconds) where.low_hz = 0.0;
  return where;
}

namespace {

// Which samples of a gyro fall into which bin of what they are shown against.
class Binning {
 public:
  Binning(const Observations& data, std::size_t gyro, const std::vector<double>& against)
      : data_(data), gyro_(gyro), against_(against) {
    for (std::size_t i = 0; i < against_.size(); ++i) {
      if (!shows(i)) continue;
      low_ = std::min(low_, against_[i]);
      high_ = std::max(high_, against_[i]);
      seen_ += 1.0;
    }
  }

  /// What it is shown against does not change, or nothing shows: there are no bins.
  [[nodiscard]] bool empty() const { return !(high_ > low_); }

  /// Where the bins large enough to show stand. Precondition: not empty.
  std::vector<double> choose() {
    std::array<double, kBins> count{};
    std::array<double, kBins> sum{};
    for (std::size_t i = 0; i < against_.size(); ++i) {
      if (!shows(i)) continue;
      count[bin_of(i)] += 1.0;
      sum[bin_of(i)] += against_[i];
    }
    std::vector<double> at;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      column_[bin] = -1;
      if (count[bin] < std::max(kBinSamplesMin, kBinShareMin * seen_)) continue;
      column_[bin] = static_cast<Eigen::Index>(at.size());
      at.push_back(sum[bin] / count[bin]);
    }
    return at;
  }

  /// Of the chosen bins; −1: of none. Precondition: chosen.
  [[nodiscard]] Eigen::Index column_of(std::size_t i) const {
    return shows(i) ? column_[bin_of(i)] : -1;
  }

 private:
  [[nodiscard]] bool shows(std::size_t i) const {
    return share_of(data_.channel[i], gyro_) != 0.0 && std::isfinite(against_[i]);
  }
  [[nodiscard]] std::size_t bin_of(std::size_t i) const {
    const double place = (against_[i] - low_) / (high_ - low_) * static_cast<double>(kBins);
    return std::min(kBins - 1, static_cast<std::size_t>(place));
  }

  const Observations& data_;
  std::size_t gyro_;
  const std::vector<double>& against_;
  double low_ = std::numeric_limits<double>::infinity();
  double high_ = -std::numeric_limits<double>::infinity();
  double seen_ = 0.0;
  std::array<Eigen::Index, kBins> column_{};
};

// A column for each bin, then the residuals.
Matrix bin_columns(const Observations& data, std::size_t gyro, const Binning& binning,
                   Eigen::Index width, const std::vector<const Eigen::VectorXd*>& residuals,
                   const std::vector<double>& unit) {
  const auto wanted = static_cast<Eigen::Index>(residuals.size());
  Matrix columns = Matrix::Zero(data.size(), width + wanted);
  for (Eigen::Index k = 0; k < wanted; ++k)
    columns.col(width + k) = *residuals[static_cast<std::size_t>(k)];
  for (std::size_t i = 0; i < data.t_s.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double share = share_of(data.channel[i], gyro);
    if (share == 0.0) continue;
    const Eigen::Index place = binning.column_of(i);
    // Samples of bins too small to show take no part.
    if (place < 0) columns.row(row).setZero();
    if (place < 0) continue;
    columns(row, place) = share * (unit.empty() ? 1.0 : unit[i]);
  }
  return columns;
}

}  // namespace

Bins binned(const Observations& data, std::size_t gyro, const PairNoise& noise,
            const std::vector<const Eigen::VectorXd*>& residuals,
            const std::vector<double>& against, const std::vector<double>& unit) {
  Bins bins;
  bins.value.resize(residuals.size());
  Binning binning(data, gyro, against);
  if (binning.empty()) return bins;
  bins.at = binning.choose();
  const auto width = static_cast<Eigen::Index>(bins.at.size());
  const auto wanted = static_cast<Eigen::Index>(residuals.size());
  Matrix columns = bin_columns(data, gyro, binning, width, residuals, unit);
  Matrix means = block_means(columns, data.layout);
  whiten_within(columns, data.layout, noise, Part::kAll);
  whiten_means(means, data.layout, noise, Part::kAll);
  const Eigen::MatrixXd gram = columns.transpose() * columns + means.transpose() * means;
  Eigen::MatrixXd normal = gram.topLeftCorner(width, width);
  // What says nothing of a bin leaves it at zero with a large error instead of a division by zero.
  normal.diagonal().array() += kSilentShare * normal.diagonal().maxCoeff();
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  const Eigen::MatrixXd covariance = solver.solve(Eigen::MatrixXd::Identity(width, width));
  const Eigen::MatrixXd value = solver.solve(gram.topRightCorner(width, wanted));
  for (Eigen::Index i = 0; i < width; ++i) {
    bins.sigma.push_back(std::sqrt(std::max(0.0, covariance(i, i))));
    for (Eigen::Index k = 0; k < wanted; ++k)
      bins.value[static_cast<std::size_t>(k)].push_back(value(i, k));
  }
  return bins;
}

}  // namespace vgyro::gap
