#include "analysis/rest.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace vgyro::analysis {

namespace {

constexpr double kBlock_s = 1.0;
// A second moves when the sum of the rates steps by more than this many usual steps of the
// difference, or scatters so much more than the difference does. Correlated noise alone raises the
// sum over the difference: up to ρ = 0.8, three times.
constexpr double kSteps = 10.0;
constexpr double kScatter = 4.0;
// What the sum may wander in a rest: so many times what the difference does, and what two gyros
// that warm up alike may drift.
constexpr double kWander = 6.0;
constexpr double kWander_dps = 0.2;
constexpr double kStep_dps = 0.02;

struct RestBlock {
  double begin_s = 0.0;
  double sum_dps = 0.0;  ///< mean of y₁ + y₂
  double difference_dps = 0.0;
  double sum_scatter_dps = 0.0;  ///< standard deviation
  double difference_scatter_dps = 0.0;
  bool first = false;  ///< of its part
};

RestBlock make_block(const double* first, const double* second, std::size_t count) {
  const auto n = static_cast<Eigen::Index>(count);
  const Eigen::Map<const Eigen::ArrayXd> y1(first, n);
  const Eigen::Map<const Eigen::ArrayXd> y2(second, n);
  const Eigen::ArrayXd sum = y1 + y2;
  const Eigen::ArrayXd difference = y1 - y2;
  RestBlock block;
  block.sum_dps = sum.mean();
  block.difference_dps = difference.mean();
  block.sum_scatter_dps = std::sqrt((sum - block.sum_dps).square().mean());
  block.difference_scatter_dps = std::sqrt((difference - block.difference_dps).square().mean());
  return block;
}

std::vector<RestBlock> blocks_of(const std::array<Series, 2>& paired) {
  const double interval_s = paired[0].interval_s;
  const auto count = static_cast<std::size_t>(std::max(2.0, std::round(kBlock_s / interval_s)));
  std::vector<RestBlock> blocks;
  for (std::size_t p = 0; p < paired[0].parts.size(); ++p) {
    const Part& part = paired[0].parts[p];
    for (std::size_t i = 0; i + count <= part.rate_dps.size(); i += count) {
      RestBlock block = make_block(&part.rate_dps[i], &paired[1].parts[p].rate_dps[i], count);
      block.begin_s = part.begin_s + static_cast<double>(i) * interval_s;
      block.first = i == 0;
      blocks.push_back(block);
    }
  }
  return blocks;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// What is usual for the difference: its step from block to block, and its scatter in a block. A
// rest anywhere is judged by the quieter quarter of the record, motion spoils the rest of it.
struct Usual {
  double step_dps = 0.0;
  double scatter_dps = 0.0;
};

Usual usual_of(const std::vector<RestBlock>& blocks) {
  std::vector<double> steps;
  std::vector<double> scatters;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    scatters.push_back(blocks[i].difference_scatter_dps);
    if (blocks[i].first) continue;
    steps.push_back(std::abs(blocks[i].difference_dps - blocks[i - 1].difference_dps));
  }
  const auto quarter = [](std::vector<double>& values) {
    std::sort(values.begin(), values.end());
    values.resize((values.size() + 1) / 2);
    return median(values);
  };
  // The lower quartile of |normal| is 0.319 σ.
  return {quarter(steps) / 0.319, quarter(scatters)};
}

bool turns(const RestBlock& block, const Usual& usual) {
  return std::abs(block.sum_dps) > 2.0 * MotionSummary::kTurning_dps ||
         block.sum_scatter_dps > kScatter * std::max(usual.scatter_dps, kStep_dps * 1e-3);
}

bool moves(const std::vector<RestBlock>& blocks, std::size_t i, const Usual& usual) {
  const RestBlock& block = blocks[i];
  if (turns(block, usual)) return true;
  if (block.first) return false;
  return std::abs(block.sum_dps - blocks[i - 1].sum_dps) > kSteps * usual.step_dps + kStep_dps;
}

// Extends the rest that begins with block `begin`; one beyond its last block.
std::size_t end_of_rest(const std::vector<RestBlock>& blocks, std::size_t begin,
                        const Usual& usual) {
  std::size_t end = begin;
  double wander_dps = 0.0;
  for (; end < blocks.size(); ++end) {
    if (end == begin ? turns(blocks[end], usual) : moves(blocks, end, usual)) break;
    wander_dps =
        std::max(wander_dps, std::abs(blocks[end].difference_dps - blocks[begin].difference_dps));
    const double limit_dps = kWander * wander_dps + kSteps * usual.step_dps + kWander_dps;
    if (std::abs(blocks[end].sum_dps - blocks[begin].sum_dps) > limit_dps) break;
  }
  return end;
}

}  // namespace

MotionSummary find_motion(const std::array<Series, 2>& paired) {
  MotionSummary motion;
  const std::vector<RestBlock> blocks = blocks_of(paired);
  if (blocks.empty()) return motion;
  std::vector<double> sums;
  sums.reserve(blocks.size());
  for (const RestBlock& block : blocks)
    sums.push_back(block.sum_dps);
  const double usual_sum_dps = median(sums);
  for (const RestBlock& block : blocks) {
    motion.turned_up_to_dps =
        std::max(motion.turned_up_to_dps, 0.5 * std::abs(block.sum_dps - usual_sum_dps));
  }
  if (0.5 * std::abs(usual_sum_dps) > MotionSummary::kTurning_dps) {
    motion.turned_up_to_dps += 0.5 * std::abs(usual_sum_dps);
  }
  const Usual usual = usual_of(blocks);
  Stretch longest;
  for (std::size_t begin = 0; begin < blocks.size();) {
    const std::size_t end = end_of_rest(blocks, begin, usual);
    if (end > begin) {
      const Stretch stretch{blocks[begin].begin_s, blocks[end - 1].begin_s + kBlock_s};
      if (stretch.seconds() > longest.seconds()) longest = stretch;
      motion.at_rest = begin == 0 && end == blocks.size();
    }
    begin = std::max(end, begin + 1);
  }
  if (motion.at_rest || longest.seconds() >= MotionSummary::kRestMin_s) motion.rest = longest;
  return motion;
}

namespace {

// Means over so long are regressed: noise in the common rate would pass for mismatch, and motion is
// slower than most of it.
constexpr double kMean_s = 1.0;
// Beyond this it is no mismatch of two gyros, and nothing is taken off.
constexpr double kScaleMax = 0.2;

std::vector<std::array<double, 2>> means_of(const std::vector<double>& y1,
                                            const std::vector<double>& y2, std::size_t count) {
  std::vector<std::array<double, 2>> means(y1.size() / count);
  for (std::size_t i = 0; i < means.size() * count; ++i) {
    means[i / count][0] += y1[i] / static_cast<double>(count);
    means[i / count][1] += y2[i] / static_cast<double>(count);
  }
  return means;
}

// Steps of the difference against steps of the common rate and of its derivative: biases and slow
// drifts have no say in them.
std::optional<Mismatch> fit_mismatch(const std::array<Series, 2>& paired) {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  const double interval_s = paired[0].interval_s;
  const auto count = static_cast<std::size_t>(std::max(1.0, std::round(kMean_s / interval_s)));
  const double mean_s = static_cast<double>(count) * interval_s;
  for (std::size_t p = 0; p < paired[0].parts.size(); ++p) {
    const auto y = means_of(paired[0].parts[p].rate_dps, paired[1].parts[p].rate_dps, count);
    const auto common = [&](std::size_t i) { return 0.5 * (y[i][0] + y[i][1]); };
    for (std::size_t i = 1; i + 2 < y.size(); ++i) {
      const double slope_step =
          (common(i + 2) - common(i) - common(i + 1) + common(i - 1)) / (2.0 * mean_s);
      const Eigen::Vector2d regressors{common(i + 1) - common(i), slope_step};
      normal += regressors * regressors.transpose();
      right += regressors * (y[i + 1][0] - y[i + 1][1] - y[i][0] + y[i][1]);
    }
  }
  const Eigen::Vector2d solution = normal.ldlt().solve(right);
  if (!solution.allFinite() || std::abs(solution[0]) > kScaleMax) return std::nullopt;
  return Mismatch{solution[0], solution[1]};
}

}  // namespace

Difference difference(const std::array<Series, 2>& paired, const MotionSummary& motion) {
  Difference result{{paired[0].interval_s, {}, paired[0].filled_share}, {}};
  if (!motion.at_rest) result.removed = fit_mismatch(paired);
  const Mismatch mismatch = result.removed.value_or(Mismatch{});
  const double per_step = mismatch.lag_s / (2.0 * paired[0].interval_s);
  for (std::size_t p = 0; p < paired[0].parts.size(); ++p) {
    const std::vector<double>& y1 = paired[0].parts[p].rate_dps;
    const std::vector<double>& y2 = paired[1].parts[p].rate_dps;
    const auto common = [&](std::size_t i) { return 0.5 * (y1[i] + y2[i]); };
    Part part{paired[0].parts[p].begin_s, std::vector<double>(y1.size())};
    for (std::size_t i = 0; i < y1.size(); ++i) {
      const std::size_t before = i == 0 ? 0 : i - 1;
      const std::size_t after = std::min(i + 1, y1.size() - 1);
      part.rate_dps[i] =
          y1[i] - y2[i] - mismatch.scale * common(i) - per_step * (common(after) - common(before));
    }
    result.series.parts.push_back(std::move(part));
  }
  return result;
}

}  // namespace vgyro::analysis
