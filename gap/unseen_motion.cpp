#include "gap/unseen_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/QR>

namespace vgyro::gap {

namespace {

// Sixth differences: sin¹² of half the angle, which passes a fortieth of the power at a quarter of
// the sampling rate and a half at two fifths.
constexpr std::array kDifference{1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0};
constexpr double kDifferenceNoise = 924.0;  // Σ of their squares
constexpr double kDifferencePeak = 64.0;    // their gain at half the sampling rate
constexpr double kUneven = 0.1;
// Long enough to tell a power to a seventh at 100 Hz, short enough for a bump of the road.
constexpr double kCell_s = 0.5;
// Of all cells this share is quiet for sure, wherever there is any rest; what is above that by less
// than this share is chance.
constexpr double kQuietShare = 0.15;
constexpr double kChanceShare = 0.3;
// Streams are alike in pace up to this ratio.
constexpr double kAlike = 1.5;

// Mean square of the sixth differences in each cell, in units of white noise of one sample.
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

// What is above the quiet cells, as the power that the differences pass whole.
std::vector<double> above_noise(const std::vector<double>& squares) {
  std::vector<double> smooth(squares.size());
  for (std::size_t i = 0; i < squares.size(); ++i) {
    const double before = squares[i > 0 ? i - 1 : i];
    const double behind = squares[std::min(i + 1, squares.size() - 1)];
    smooth[i] = (before + 2.0 * squares[i] + behind) / 4.0;
  }
  const double quiet = quiet_of(smooth);
  for (double& one : smooth) {
    one = one > (1.0 + kChanceShare) * quiet ? (one - quiet) / (kDifferencePeak * kDifferencePeak)
                                             : 0.0;
  }
  return smooth;
}

}  // namespace

double quiet_variance(const SampledCurve& curve) {
  return curve.empty() ? 0.0 : quiet_of(fast_squares(curve)) / kDifferenceNoise;
}

FastMotion::FastMotion(const SampledCurve& a, const SampledCurve& b) {
  if (a.empty() || b.empty()) return;
  if (b.interval_s() > kAlike * a.interval_s()) {
    power_ = above_noise(fast_squares(b));
    return;
  }
  power_ = above_noise(fast_squares(a));
  if (a.interval_s() > kAlike * b.interval_s()) return;
  const std::vector<double> other = above_noise(fast_squares(b));
  power_.resize(std::min(power_.size(), other.size()));
  for (std::size_t i = 0; i < power_.size(); ++i)
    power_[i] = std::min(power_[i], other[i]);
}

double FastMotion::power(double t_s) const {
  const auto cell = static_cast<std::size_t>(std::max(0.0, t_s) / kCell_s);
  return cell < power_.size() ? power_[cell] : 0.0;
}

namespace {

// Unseen motion that is more than this share of the motion itself: what folds into the frequency
// passes for a delay or a low-pass of some per cent.
constexpr double kComparable = 5e-3;
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

// Twice the power is kept where two streams sample a motion half a period apart; and what folds is
// as much again.
constexpr double kShareMost = 4.0;
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
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double weight = 1.0 / (power[i] + typical_power());
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
