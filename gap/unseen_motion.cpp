#include "gap/unseen_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <numeric>
#include <span>

#include <Eigen/QR>
#include <unsupported/Eigen/FFT>

namespace vgyro::gap {

namespace {

// Fourth differences: sin⁸ of half the angle, which passes a sixteenth of the power at a quarter of
// the sampling rate and 7e-5 at a tenth. A gyro's own filter leaves something of that.
constexpr std::array kDifference{1.0, -4.0, 6.0, -4.0, 1.0};
constexpr double kDifferencePeak = 16.0;  // their gain at half the sampling rate
constexpr double kUneven = 0.1;
// Short enough for a stretch of bad road.
constexpr double kCell_s = 1.0;
// Of all cells this share is quiet for sure, wherever there is any rest.
constexpr double kQuietShare = 0.15;
constexpr double kQuietSigmas = -1.04;  // what that share of a Gaussian lies below
constexpr double kQuietLeast = 0.1;     // where that would be next to nothing
// A cell is above the noise by so many standard errors in the stream that shows motion best, and
// not by chance in the other one.
constexpr double kAboveSigmas = 4.0;
constexpr double kOtherSigmas = 1.5;
// Independent values in a cell and its neighbours, over the samples in it: differences depend on
// each other.
constexpr double kFreedomShare = 0.8;
// Streams are alike in pace up to this ratio.
constexpr double kAlike = 1.5;

// Mean square of the fourth differences in each cell.
std::vector<double> fast_squares(const SampledCurve& curve) {
  const auto cells = static_cast<std::size_t>(std::max(0.0, curve.to_s()) / kCell_s) + 1;
  std::vector<double> squares(cells, 0.0);
  std::vector<double> count(cells, 0.0);
  const auto t_s = curve.times_s();
  const auto value = curve.values();
  const double span_s = curve.interval_s() * (kDifference.size() - 1);
  for (std::size_t i = 0; i + kDifference.size() <= value.size(); ++i) {
    const std::size_t last = i + kDifference.size() - 1;
    if (std::abs(t_s[last] - t_s[i] - span_s) > kUneven * curve.interval_s()) continue;
    double sum = 0.0;
    for (std::size_t k = 0; k < kDifference.size(); ++k)
      sum += kDifference[k] * value[i + k];
    const double middle_s = std::max(0.0, 0.5 * (t_s[i] + t_s[last]));
    const auto cell = std::min(cells - 1, static_cast<std::size_t>(middle_s / kCell_s));
    squares[cell] += sum * sum;
    count[cell] += 1.0;
  }
  for (std::size_t cell = 0; cell < cells; ++cell) {
    // A cell without differences goes on as the last.
    if (count[cell] > 0.0)
      squares[cell] /= count[cell];
    else
      squares[cell] = cell > 0 ? squares[cell - 1] : 0.0;
  }
  return squares;
}

double quiet_of(std::vector<double> squares) {
  std::sort(squares.begin(), squares.end());
  return squares[static_cast<std::size_t>(kQuietShare * static_cast<double>(squares.size() - 1))];
}

// What a stream shows of fast motion, by cells.
struct Shown {
  std::vector<double> power;   ///< above the noise, as the differences pass it whole
  std::vector<double> sigmas;  ///< how far above chance

  [[nodiscard]] double clearness() const {
    double sum = 0.0;
    for (const double one : sigmas)
      sum += std::max(0.0, one);
    return sum;
  }
};

Shown shown_by(const SampledCurve& curve) {
  const std::vector<double> squares = fast_squares(curve);
  const double freedom = std::max(2.0, kFreedomShare * kCell_s / curve.interval_s());
  const double sigma = std::sqrt(2.0 / freedom);
  std::vector<double> smooth(squares.size());
  for (std::size_t i = 0; i < squares.size(); ++i) {
    const double before = squares[i > 0 ? i - 1 : i];
    const double behind = squares[std::min(i + 1, squares.size() - 1)];
    smooth[i] = (before + 2.0 * squares[i] + behind) / 4.0;
  }
  const double noise = quiet_of(smooth) / std::max(kQuietLeast, 1.0 + kQuietSigmas * sigma);
  Shown shown;
  for (const double one : smooth) {
    shown.power.push_back(std::max(0.0, one - noise) / (kDifferencePeak * kDifferencePeak));
    shown.sigmas.push_back(noise > 0.0 ? (one / noise - 1.0) / sigma : 0.0);
  }
  return shown;
}

}  // namespace

namespace {

// Stretches of so many samples, half overlapping, have a spectrum each.
constexpr std::size_t kStretch = 128;
// Of the quietest of the stretches, the lowest frequencies are noise: both are shares. What is
// chosen by one half of the frequencies, or of the stretches, is measured in the other half, or
// the choice would make it smaller. The lowest bins, which drift and motion fill whatever the
// window, are left out.
constexpr double kQuieter = 0.25;
constexpr double kLowest = 0.25;
constexpr std::size_t kSlowBins = 4;
// Neighbouring bins depend on each other: the halves are of such groups in turn.
constexpr std::size_t kGroup = 10;

// Power of a stretch by frequency, that of white noise being its variance.
std::vector<double> power_of(std::span<const double> values, Eigen::FFT<double>& transform) {
  std::vector<double> windowed(kStretch);
  double squares = 0.0;
  const double origin = values[0];
  const double slope = (values[kStretch - 1] - origin) / (kStretch - 1.0);
  for (std::size_t i = 0; i < kStretch; ++i) {
    const auto at = static_cast<double>(i);
    const double window = std::pow(std::sin(std::numbers::pi * (at + 0.5) / kStretch), 4);
    windowed[i] = window * (values[i] - origin - slope * at);
    squares += window * window;
  }
  std::vector<std::complex<double>> spectrum;
  transform.fwd(spectrum, windowed);
  std::vector<double> power;
  for (std::size_t i = kSlowBins; i < kStretch / 2; ++i)
    power.push_back(std::norm(spectrum[i]) / squares);
  return power;
}

using Spectra = std::vector<std::vector<double>>;

// The quietest stretches by the groups of one parity.
Spectra quietest(Spectra spectra, std::size_t parity) {
  const auto level = [&](const std::vector<double>& power) {
    double sum = 0.0;
    for (std::size_t i = 0; i < power.size(); ++i)
      sum += (i / kGroup) % 2 == parity ? power[i] : 0.0;
    return sum;
  };
  std::stable_sort(spectra.begin(), spectra.end(),
                   [&](const auto& a, const auto& b) { return level(a) < level(b); });
  spectra.resize(2 + static_cast<std::size_t>(kQuieter * static_cast<double>(spectra.size() - 2)));
  return spectra;
}

// Mean of the groups of the other parity, over every second stretch.
std::vector<double> mean_of(const Spectra& spectra, std::size_t parity, std::size_t first) {
  std::vector<double> mean;
  for (std::size_t i = 0; i < spectra.front().size(); ++i) {
    if ((i / kGroup) % 2 == parity) continue;
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t k = first; k < spectra.size(); k += 2, count += 1.0)
      sum += spectra[k][i];
    mean.push_back(sum / count);
  }
  return mean;
}

// Mean of `values` where `by` is lowest.
double lowest(const std::vector<double>& values, const std::vector<double>& by) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return by[a] < by[b]; });
  order.resize(1 + static_cast<std::size_t>(kLowest * static_cast<double>(order.size() - 1)));
  double sum = 0.0;
  for (const std::size_t i : order)
    sum += values[i] / static_cast<double>(order.size());
  return sum;
}

}  // namespace

double quiet_variance(const SampledCurve& curve) {
  if (curve.times_s().size() < kStretch) return 0.0;
  Eigen::FFT<double> transform;
  Spectra spectra;
  const double span_s = curve.interval_s() * (kStretch - 1);
  for (std::size_t i = 0; i + kStretch <= curve.times_s().size(); i += kStretch / 2) {
    const double lasts_s = curve.times_s()[i + kStretch - 1] - curve.times_s()[i];
    if (std::abs(lasts_s - span_s) < curve.interval_s())
      spectra.push_back(power_of(curve.values().subspan(i, kStretch), transform));
  }
  if (spectra.size() < 2) return 0.0;
  double variance = 0.0;
  for (std::size_t parity = 0; parity < 2; ++parity) {
    const Spectra quiet = quietest(spectra, parity);
    const std::array halves{mean_of(quiet, parity, 0), mean_of(quiet, parity, 1)};
    variance += 0.25 * (lowest(halves[0], halves[1]) + lowest(halves[1], halves[0]));
  }
  return variance;
}

namespace {

// The curve at the instants of a slower one, where it has samples: what folds there folds here.
SampledCurve at_instants(const SampledCurve& curve, const SampledCurve& slower) {
  std::vector<double> t_s;
  std::vector<double> value;
  for (const double t : slower.times_s()) {
    if (curve.hole_at(t, kAlike * curve.interval_s())) continue;
    t_s.push_back(t);
    value.push_back(curve.value_at(t));
  }
  return {t_s, value};
}

}  // namespace

FastMotion::FastMotion(const SampledCurve& a, const SampledCurve& b) {
  if (a.empty() || b.empty()) return;
  if (b.interval_s() > kAlike * a.interval_s()) {
    set(at_instants(a, b), b);
  } else if (a.interval_s() > kAlike * b.interval_s()) {
    set(a, at_instants(b, a));
  } else {
    set(a, b);
  }
}

void FastMotion::set(const SampledCurve& a, const SampledCurve& b) {
  if (a.empty() || b.empty()) return;
  Shown best = shown_by(a);
  Shown other = shown_by(b);
  if (other.clearness() > best.clearness()) std::swap(best, other);
  power_.assign(std::min(best.power.size(), other.power.size()), 0.0);
  for (std::size_t i = 0; i < power_.size(); ++i) {
    if (best.sigmas[i] > kAboveSigmas && other.sigmas[i] > kOtherSigmas) power_[i] = best.power[i];
  }
}

double FastMotion::power(double t_s) const {
  const auto cell = static_cast<std::size_t>(std::max(0.0, t_s) / kCell_s);
  return cell < power_.size() ? power_[cell] : 0.0;
}

namespace {

// Unseen motion that is more than this share of the motion itself: what folds into the frequency
// passes for a delay or a low-pass of some per cent.
constexpr double kComparable = 1e-3;
// Of blocks with more samples the first cosines are enough: they hold what can be compared.
constexpr std::uint32_t kCosinesMost = 63;
// Blocks that follow each other, in their length.
constexpr double kNext = 1.5;

// One observed square, and the power of the motion there.
struct Seen {
  double square = 0.0;  ///< mean, (deg/s)²
  double freedom = 0.0;
  double power = 0.0;
};

// Of the power that the differences show a filter may have left a tenth; what folds comes on top.
constexpr double kShareMost = 40.0;
// Below this many standard errors, or this share of the noise where it is strongest, it is nothing.
constexpr double kShareSigmas = 3.0;
constexpr double kNoiseShareMin = 0.02;
constexpr int kTurns = 6;

// Share g of the power in: square = noise + g·power, by likelihood of the squares (they scatter by
// their own size).
double share_of_power(const std::vector<Seen>& list) {
  double noise = 0.0;
  double freedom = 0.0;
  double power_most = 0.0;
  for (const Seen& seen : list) {
    if (seen.power == 0.0) noise += seen.square * seen.freedom, freedom += seen.freedom;
    power_most = std::max(power_most, seen.power);
  }
  if (power_most == 0.0 || freedom == 0.0) return 0.0;
  noise /= freedom;
  double share = 0.0;
  double share_sigma = 0.0;
  for (int turn = 0; turn < kTurns; ++turn) {
    double gram[2][2] = {};
    double right[2] = {};
    for (const Seen& seen : list) {
      const double expected = noise + share * seen.power;
      const double weight = 0.5 * seen.freedom / (expected * expected);
      gram[0][0] += weight;
      gram[0][1] += weight * seen.power;
      gram[1][1] += weight * seen.power * seen.power;
      right[0] += weight * seen.square;
      right[1] += weight * seen.power * seen.square;
    }
    const double determinant = gram[0][0] * gram[1][1] - gram[0][1] * gram[0][1];
    if (determinant <= 0.0) return 0.0;
    share = std::max(0.0, (gram[0][0] * right[1] - gram[0][1] * right[0]) / determinant);
    const double level = (gram[1][1] * right[0] - gram[0][1] * right[1]) / determinant;
    if (level > 0.0) noise = level;
    share_sigma = std::sqrt(gram[0][0] / determinant);
  }
  const bool any =
      share > kShareSigmas * share_sigma && share * power_most > kNoiseShareMin * noise;
  return any ? std::min(share, kShareMost) : 0.0;
}

// The k-th cosines of all blocks in motion, and what of the first column no other explains.
struct Cosine {
  std::vector<Eigen::Vector3d> values;
  std::vector<double> power;

  [[nodiscard]] std::vector<Seen> leftovers() const {
    Eigen::Matrix2d gram = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    const double typical = typical_power();
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double weight = 1.0 / (power[i] + typical);
      const Eigen::Vector2d motion = values[i].tail<2>();
      gram += weight * motion * motion.transpose();
      right += weight * motion * values[i][0];
    }
    const Eigen::Vector2d share = gram.completeOrthogonalDecomposition().solve(right);
    std::vector<Seen> list;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double left = values[i][0] - share.dot(values[i].tail<2>());
      list.push_back({left * left, 1.0, power[i]});
    }
    return list;
  }
  [[nodiscard]] double typical_power() const {
    double sum = 0.0;
    for (const double one : power)
      sum += one;
    return power.empty() ? 0.0 : sum / static_cast<double>(power.size());
  }
  [[nodiscard]] double motion() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i)
      sum += power[i] > 0.0 ? values[i][1] * values[i][1] : 0.0;
    return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
  }
};

// By the first of the usual block's cosines.
std::vector<Cosine> cosines_of(const Matrix& columns, const Layout& layout,
                               std::uint32_t usual_count) {
  std::vector<Cosine> cosines(usual_count - 1);
  const Matrix table = slowest_cosines(usual_count, usual_count - 1);
  for (const Block& block : layout.blocks) {
    if (!block.compared || block.held_out || block.count != usual_count) continue;
    const Matrix values = table * columns.middleRows(block.first, block.count);
    for (std::size_t k = 0; k < cosines.size(); ++k) {
      cosines[k].values.emplace_back(values.row(static_cast<Eigen::Index>(k)).transpose());
      cosines[k].power.push_back(block.motion_power);
    }
  }
  return cosines;
}

// Half the squares of the steps from one block's mean to the next.
std::vector<Seen> steps_of(const Matrix& columns, const Layout& layout) {
  std::vector<Seen> list;
  const Block* before = nullptr;
  double mean_before = 0.0;
  for (const Block& block : layout.blocks) {
    if (!block.compared || block.held_out) continue;
    const double mean = columns.col(0).segment(block.first, block.count).mean();
    if (before != nullptr && before->channel == block.channel &&
        block.t_s - before->t_s < kNext * layout.block_s) {
      const double step = mean - mean_before;
      list.push_back({0.5 * step * step, 1.0, 0.5 * (block.motion_power + before->motion_power)});
    }
    before = &block;
    mean_before = mean;
  }
  return list;
}

std::uint32_t usual_count(const Layout& layout) {
  std::map<std::uint32_t, std::size_t> times;
  for (const Block& block : layout.blocks)
    if (block.compared) ++times[block.count];
  std::uint32_t usual = 0;
  for (const auto& [count, number] : times)
    if (usual == 0 || number > times[usual]) usual = count;
  return std::min(usual, kCosinesMost + 1);
}

}  // namespace

void learn_unseen_motion(const Matrix& columns, Layout& layout) {
  layout.unseen = {};
  const std::uint32_t count = usual_count(layout);
  if (count < 2) return;
  UnseenMotion& unseen = layout.unseen;
  for (const Cosine& cosine : cosines_of(columns, layout, count)) {
    const double share = share_of_power(cosine.leftovers());
    unseen.all += share / (count - 1.0);
    if (unseen.lost_hz > 0.0) continue;
    const auto k = static_cast<double>(unseen.cosine.size() + 1);
    if (share * cosine.typical_power() > kComparable * cosine.motion() && share > 0.0)
      unseen.lost_hz = 0.5 * k / layout.block_s;
    else
      unseen.cosine.push_back(share);
  }
  unseen.mean = share_of_power(steps_of(columns, layout));
  const bool any = unseen.all > 0.0 || unseen.mean > 0.0;
  for (Block& block : layout.blocks) {
    block.kept = block.count - 1;
    if (!any) block.motion_power = 0.0;
    if (block.motion_power > 0.0 && unseen.lost_hz > 0.0)
      block.kept = cosines_below(block, unseen.lost_hz, layout);
  }
}

}  // namespace vgyro::gap
