#include "analysis/rest.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Dense>

namespace vgyro::analysis {

namespace {

// Motion is slower than this, or shows in the scatter; slow gyros need longer blocks for so many
// pairs.
constexpr double kBlock_s = 1.0;
constexpr double kPairsMin = 5.0;
// The mean of a block with a smaller share of the usual count is too uncertain to be compared.
constexpr double kFullShare = 0.5;
// One in so many blocks certainly has only the gyros' own noise: motion leaves a part in the
// difference, because scales and delays differ.
constexpr std::size_t kQuietOneIn = 10;
// The mean may scatter so many times as much as the difference: common noise raises the ratio, up
// to three times for a correlation of 0.8.
constexpr double kScatterMost = 4.0;
constexpr double kCommonMost = 3.0;
// It may exceed the usual ratio at rest by this factor, and by so many standard errors of a
// scatter.
constexpr double kSteady = 1.5;
constexpr double kScatterSigmas = 4.0;
// The same factor for one gyro alone, whose noise changes less than the ratio of two; and the least
// number of blocks from which its noise at rest is taken.
constexpr double kSteadyAlone = 1.15;
constexpr std::size_t kAloneBlocksMin = 10;
// A block whose difference scatters more than this factor above the quiet ones is no measure of
// noise.
constexpr double kLively = 3.0;
// The lower decile of a scatter of five values, in units of the true standard deviation.
constexpr double kFifthsDecile = 0.516;
constexpr double kFifthsCount = 5.0;
// Lower decile of a normal distribution, in σ below its mean.
constexpr double kDecileSigmas = 1.2816;
// A coarse sensor's value that lies between two steps scatters by half a step; this is a quarter of
// both sensors' step.
constexpr double kStepShare = 0.25;
// Over one, two and four blocks, the mean may move so many times as far as the difference does, and
// by the sway of a building.
constexpr std::array<std::size_t, 3> kLags{1, 2, 4};
constexpr double kLagSigmas = 5.0;
constexpr double kSway_dps = 0.005;
// Standard deviation of normal values over the median of their magnitudes.
constexpr double kSigmaPerMedian = 1.4826;
// Since the last rest the mean may have moved by this, as in the gateway's calibration, and by the
// drift that two warming gyros share. The drift of one gyro alone shows in the difference.
constexpr double kStill_dps = 0.05;
constexpr double kAlike_dps_s = 1e-3;
constexpr double kAlone = 1.2;
// Largest drift of one gyro alone: beyond it, one gyro is blind and the other one turns.
constexpr double kAloneMost_dps = 2.0;
// Shorter rests are turning points of a motion.
constexpr std::size_t kBlocksMin = 4;
// Next to a motion, this much of a rest may hold its end.
constexpr std::size_t kMarginBlocks = 1;
// Further blocks of an edge, up to this many, are cut while their mean deviates from the next ones
// beyond chance.
constexpr std::array<std::size_t, 4> kEdges{1, 2, 4, 8};
constexpr std::size_t kEdgeMost = 12;
constexpr double kEdgeSigmas = 4.0;
// The configuration says that the recording begins at rest: a rest that begins this early is it.
constexpr double kStart_s = 5.0;

using Blocks = std::vector<RestBlock>;

// Precondition: `values` is not empty.
double quantile(std::vector<double> values, std::size_t one_in) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(values.size() / one_in);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

double median(std::vector<double> values) {
  return values.empty() ? 0.0 : quantile(std::move(values), 2);
}

// Blocks [first, end).
struct Run {
  std::size_t first = 0;
  std::size_t end = 0;
  [[nodiscard]] std::size_t length() const { return end - first; }
};

struct Level {
  double common_dps = 0.0;
  double apart_dps = 0.0;
};

Level level_of(const Blocks& blocks, std::size_t first, std::size_t end) {
  Level level;
  for (std::size_t i = first; i < end; ++i) {
    level.common_dps += blocks[i].common_dps;
    level.apart_dps += blocks[i].apart_dps;
  }
  const auto count = static_cast<double>(end - first);
  return {level.common_dps / count, level.apart_dps / count};
}

// Finds the rests among the blocks of one recording.
class RestSearch {
 public:
  RestSearch(const Blocks& blocks, double block_s, const RestFinder::Settings& settings)
      : blocks_(blocks),
        block_s_(block_s),
        rate_dps_(settings.rate_dps),
        by_each_alone_(settings.by_each_alone),
        own_step_dps_(settings.step_dps),
        step_dps_(std::hypot(settings.step_dps[0], settings.step_dps[1])) {}

  [[nodiscard]] std::vector<Run> run() {
    set_quiet();
    mark_steady();
    if (by_each_alone_) unmark_unsteady_alone();
    set_lags();
    set_bends();
    std::vector<Run> runs;
    for (const Run& run : steady_runs()) {
      const Run inner = trimmed(run);
      if (inner.length() > 0) runs.push_back(inner);
    }
    return of_one_level(runs);
  }

 private:
  [[nodiscard]] std::size_t size() const { return blocks_.size(); }

  // Scatter of the difference where nothing moves. Two gyros at their limits do not scatter at all,
  // so turning blocks are left out if there are any others.
  void set_quiet() {
    std::vector<double> scatters;
    std::vector<double> slow;
    const auto turning = [&](const RestBlock& block) {
      return turns({block.common_dps, block.apart_dps});
    };
    const bool all = std::all_of(blocks_.begin(), blocks_.end(), turning);
    for (const RestBlock& block : blocks_) {
      if (!all && turning(block)) continue;
      scatters.push_back(block.apart_scatter_dps);
      slow.push_back(block.apart_slow_dps);
    }
    quiet_dps_ = std::max(quantile(std::move(scatters), kQuietOneIn) / decile_of_scatter(),
                          kStepShare * step_dps_);
    slow_dps_ =
        std::max(quantile(std::move(slow), kQuietOneIn) / kFifthsDecile, kStepShare * step_dps_);
    std::vector<double> ratios;
    for (const RestBlock& block : blocks_) {
      if (block.common_scatter_dps <= kScatterMost * quiet_dps_)
        ratios.push_back(block.common_scatter_dps / std::max(block.apart_scatter_dps, quiet_dps_));
    }
    common_ = std::clamp(median(std::move(ratios)), 1.0, kCommonMost);
  }

  // The lower decile of a scatter of as many values as a block has, in units of the true standard
  // deviation.
  [[nodiscard]] double decile_of_scatter() const {
    std::vector<double> counts;
    for (const RestBlock& block : blocks_)
      counts.push_back(block.count);
    const double freedom = median(std::move(counts)) - 1.0;
    return std::max(kFifthsDecile, 1.0 - kDecileSigmas / std::sqrt(2.0 * freedom));
  }

  void mark_steady() {
    steady_.assign(size(), 0);
    for (std::size_t i = 0; i < size(); ++i) {
      const RestBlock& block = blocks_[i];
      // Motion is slow, so it stands out more in the means of fifths than in the samples.
      const bool steady =
          block.common_scatter_dps <= kScatterMost * quiet_dps_ &&
          is_steady(block.common_scatter_dps, block.apart_scatter_dps, quiet_dps_, block.count) &&
          is_steady(block.common_slow_dps, block.apart_slow_dps, slow_dps_, kFifthsCount);
      if (steady) steady_[i] = 1;
    }
  }

  // At rest a gyro scatters by its own noise: a larger scatter is motion that the other gyro's
  // noise hides.
  void unmark_unsteady_alone() {
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      std::vector<double> scatters;
      std::vector<double> slow;
      for (std::size_t i = 0; i < size(); ++i) {
        // A gyro at its limit does not scatter.
        if (steady_[i] == 0 || turns({blocks_[i].common_dps, blocks_[i].apart_dps})) continue;
        scatters.push_back(blocks_[i].own_scatter_dps[gyro]);
        slow.push_back(blocks_[i].own_slow_dps[gyro]);
      }
      if (scatters.size() < kAloneBlocksMin) continue;
      const double least_dps = kStepShare * own_step_dps_[gyro];
      const double quiet_dps = std::max(quantile(scatters, kQuietOneIn), least_dps);
      const double slow_dps = std::max(quantile(slow, kQuietOneIn), least_dps);
      for (std::size_t i = 0; i < size(); ++i) {
        const RestBlock& block = blocks_[i];
        if (block.own_scatter_dps[gyro] >
                most_alone(quiet_dps / decile_of_scatter(), block.count) ||
            block.own_slow_dps[gyro] > most_alone(slow_dps / kFifthsDecile, kFifthsCount))
          steady_[i] = 0;
      }
    }
  }

  static double most_alone(double quiet_dps, double count) {
    return quiet_dps * (kSteadyAlone + kScatterSigmas / std::sqrt(2.0 * (count - 1.0)));
  }

  // Is the scatter of `count` values that of rest, where the difference scatters by `quiet_dps`?
  [[nodiscard]] bool is_steady(double common_dps, double apart_dps, double quiet_dps,
                               double count) const {
    const double own_dps = std::clamp(apart_dps, quiet_dps, kLively * quiet_dps);
    const double factor = kSteady + kScatterSigmas / std::sqrt(2.0 * (count - 1.0));
    return common_dps <= factor * common_ * own_dps;
  }

  // Usual change of the difference over each lag.
  void set_lags() {
    for (std::size_t k = 0; k < kLags.size(); ++k) {
      std::vector<double> moves;
      for (std::size_t i = kLags[k]; i < size(); ++i) {
        if (steady_[i] + steady_[i - kLags[k]] == 2)
          moves.push_back(std::abs(blocks_[i].apart_dps - blocks_[i - kLags[k]].apart_dps));
      }
      lag_dps_[k] = kSigmaPerMedian * median(std::move(moves));
    }
  }

  [[nodiscard]] bool goes_on(const Run& run, std::size_t i) const {
    for (std::size_t k = 0; k < kLags.size(); ++k) {
      if (i < run.first + kLags[k]) break;
      const RestBlock& before = blocks_[i - kLags[k]];
      const double most_dps = kLagSigmas * common_ * lag_dps_[k] + kSway_dps + 0.5 * step_dps_;
      // Nothing is known across a hole.
      if (blocks_[i].from_s - before.from_s > (static_cast<double>(kLags[k]) + 0.5) * block_s_)
        continue;
      if (std::abs(blocks_[i].common_dps - before.common_dps) > most_dps) return false;
    }
    const RestBlock& first = blocks_[run.first];
    return is_near({first.common_dps, first.apart_dps},
                   {blocks_[i].common_dps, blocks_[i].apart_dps}, blocks_[i].from_s - first.from_s);
  }

  // May two gyros at rest have drifted from one level to the other?
  [[nodiscard]] bool is_near(const Level& one, const Level& other, double apart_s) const {
    const double common_dps = std::abs(one.common_dps - other.common_dps);
    const double alone_dps = std::abs(one.apart_dps - other.apart_dps);
    const double noise_dps = kLagSigmas * common_ * lag_dps_[0] + 0.5 * step_dps_;
    return common_dps <= kStill_dps + noise_dps + kAlike_dps_s * apart_s +
                             kAlone * std::min(alone_dps, 0.5 * kAloneMost_dps);
  }

  [[nodiscard]] std::vector<Run> steady_runs() const {
    std::vector<Run> runs;
    for (std::size_t first = 0; first < size();) {
      if (steady_[first] == 0) {
        ++first;
        continue;
      }
      Run run{first, first + 1};
      while (run.end < size() && steady_[run.end] != 0 && goes_on(run, run.end))
        ++run.end;
      if (run.length() >= kBlocksMin) runs.push_back(run);
      first = run.end;
    }
    return runs;
  }

  // The second difference of three means in a row, each of so many blocks: it leaves drift out.
  template <class At>
  static double bend_of(std::size_t width, const At& value_at) {
    double sum_dps = 0.0;
    for (std::size_t k = 0; k < width; ++k)
      sum_dps += value_at(k) - 2.0 * value_at(width + k) + value_at(2 * width + k);
    return sum_dps / static_cast<double>(width);
  }

  // Usual bend of the difference, and of each gyro.
  void set_bends() {
    for (std::size_t e = 0; e < kEdges.size(); ++e) {
      bend_dps_[e] = usual_bend([](const RestBlock& block) { return block.apart_dps; }, kEdges[e]);
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        own_bend_dps_[gyro][e] =
            usual_bend([&](const RestBlock& block) { return block.own_dps(gyro); }, kEdges[e]);
      }
    }
  }

  template <class Value>
  [[nodiscard]] double usual_bend(const Value& value_of, std::size_t width) const {
    std::vector<double> bends;
    std::size_t steady = 0;
    for (std::size_t i = 0; i < size(); ++i) {
      const bool rests = steady_[i] != 0 && !turns({blocks_[i].common_dps, blocks_[i].apart_dps});
      steady = rests ? steady + 1 : 0;
      if (steady < 3 * width) continue;
      bends.push_back(
          std::abs(bend_of(width, [&](std::size_t k) { return value_of(blocks_[i - k]); })));
    }
    return kSigmaPerMedian * median(std::move(bends));
  }

  // How many blocks of an edge deviate from those inside: `at(k)` is the k-th from the edge.
  template <class At>
  [[nodiscard]] std::size_t off_edge(std::size_t length, const At& at) const {
    std::size_t off = 0;
    for (std::size_t e = 0; e < kEdges.size(); ++e) {
      const std::size_t width = kEdges[e];
      if (off + 3 * width > length || off + width > kEdgeMost) break;
      if (is_off(e, [&](std::size_t k) -> const RestBlock& { return at(off + k); })) off += width;
    }
    return off;
  }

  template <class At>
  [[nodiscard]] bool is_off(std::size_t e, const At& at) const {
    const std::size_t width = kEdges[e];
    const double common_dps = bend_of(width, [&](std::size_t k) { return at(k).common_dps; });
    const double apart_dps = bend_of(width, [&](std::size_t k) { return at(k).apart_dps; });
    if (std::abs(common_dps) >
        kEdgeSigmas * common_ * bend_dps_[e] + std::abs(apart_dps) + kSway_dps + 0.5 * step_dps_)
      return true;
    for (std::size_t gyro = 0; gyro < 2 && by_each_alone_; ++gyro) {
      const double own_dps = bend_of(width, [&](std::size_t k) { return at(k).own_dps(gyro); });
      if (std::abs(own_dps) > kEdgeSigmas * own_bend_dps_[gyro][e] + 0.5 * own_step_dps_[gyro])
        return true;
    }
    return false;
  }

  // The run without blocks that may hold the end of a motion; at the recording's own ends there is
  // none.
  [[nodiscard]] Run trimmed(const Run& run) const {
    const auto from_front = [&](std::size_t k) -> const RestBlock& {
      return blocks_[run.first + k];
    };
    const auto from_back = [&](std::size_t k) -> const RestBlock& {
      return blocks_[run.end - 1 - k];
    };
    std::size_t front = off_edge(run.length(), from_front);
    std::size_t back = off_edge(run.length(), from_back);
    if (run.first > 0) front += kMarginBlocks;
    if (run.end < size()) back += kMarginBlocks;
    if (front + back >= run.length()) return {};
    return {run.first + front, run.end - back};
  }

  [[nodiscard]] bool turns(const Level& level) const {
    const double first_dps = level.common_dps + level.apart_dps - rate_dps_;
    const double second_dps = level.common_dps - level.apart_dps - rate_dps_;
    if (first_dps * second_dps < 0.0) return false;
    const double smaller_dps = std::min(std::abs(first_dps), std::abs(second_dps));
    return smaller_dps > MotionSummary::kTurning_dps;
  }

  // The most certain rest: the first, if the recording begins with it, else the longest.
  [[nodiscard]] std::size_t surest(const std::vector<Run>& runs,
                                   const std::vector<Level>& levels) const {
    std::size_t best = runs.size();
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (turns(levels[k])) continue;
      if (blocks_[runs[k].first].from_s < blocks_.front().from_s + kStart_s) return k;
      if (best == runs.size() || runs[k].length() > runs[best].length()) best = k;
    }
    return best;
  }

  // From the most certain rest to both sides: each rest whose level agrees with the last one within
  // drift.
  [[nodiscard]] std::vector<Run> of_one_level(const std::vector<Run>& runs) const {
    std::vector<Level> levels;
    for (const Run& run : runs)
      levels.push_back(level_of(blocks_, run.first, run.end));
    const std::size_t sure = surest(runs, levels);
    if (sure == runs.size()) return {};
    std::vector<std::uint8_t> rests(runs.size(), 0);
    rests[sure] = 1;
    const auto judge = [&](std::size_t k, std::size_t& last) {
      const double apart_s =
          std::abs(blocks_[runs[k].first].from_s - blocks_[runs[last].first].from_s);
      if (!is_near(levels[last], levels[k], apart_s)) return;
      rests[k] = 1;
      last = k;
    };
    std::size_t last = sure;
    for (std::size_t k = sure + 1; k < runs.size(); ++k)
      judge(k, last);
    last = sure;
    for (std::size_t k = sure; k-- > 0;)
      judge(k, last);
    std::vector<Run> resting;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (rests[k] != 0) resting.push_back(runs[k]);
    }
    return resting;
  }

  const Blocks& blocks_;
  double block_s_;
  double rate_dps_;
  bool by_each_alone_;
  std::array<double, 2> own_step_dps_;
  double step_dps_;  ///< of both gyros together
  double quiet_dps_ = 0.0;
  double slow_dps_ = 0.0;  ///< usual scatter of the means of fifths
  double common_ = 1.0;    ///< scatter of the mean over that of the difference, at rest
  std::array<double, kLags.size()> lag_dps_{};
  std::array<double, kEdges.size()> bend_dps_{};
  std::array<std::array<double, kEdges.size()>, 2> own_bend_dps_{};
  std::vector<std::uint8_t> steady_;
};

}  // namespace

RestFinder::RestFinder(const Settings& settings)
    : settings_(settings),
      block_s_(
          std::max(kBlock_s, std::ceil(kPairsMin * settings.interval_s / kBlock_s) * kBlock_s)) {}

void RestFinder::add(double t_s, const std::array<double, 2>& rate_dps) {
  const double from_s = block_s_ * std::floor(t_s / block_s_);
  if (from_s != open_.from_s) {
    close_block();
    open_ = {};
    open_.from_s = from_s;
    fifths_ = {};
  }
  // Sums about the first value keep the digits of the squares.
  const double common_dps = 0.5 * (rate_dps[0] + rate_dps[1]);
  const double apart_dps = 0.5 * (rate_dps[0] - rate_dps[1]);
  if (open_.count == 0.0) pivot_ = {common_dps, apart_dps};
  const double x = common_dps - pivot_[0];
  const double y = apart_dps - pivot_[1];
  open_.count += 1.0;
  open_.common_dps += x;
  open_.apart_dps += y;
  open_.common_scatter_dps += x * x;
  open_.apart_scatter_dps += y * y;
  open_.own_scatter_dps[0] += (x + y) * (x + y);
  open_.own_scatter_dps[1] += (x - y) * (x - y);
  const double share = (t_s - from_s) / block_s_ * static_cast<double>(kFifths);
  Sums& fifth = fifths_[std::min(kFifths - 1, static_cast<std::size_t>(share))];
  fifth.count += 1.0;
  fifth.common_dps += x;
  fifth.apart_dps += y;
}

// Sums about a pivot → means and scatters about it.
RestBlock RestFinder::closed(const RestBlock& open, const std::array<Sums, kFifths>& fifths) {
  RestBlock block = open;
  const auto scatter = [&](double mean, double squares) {
    return std::sqrt(std::max(0.0, squares / block.count - mean * mean));
  };
  block.common_dps /= block.count;
  block.apart_dps /= block.count;
  block.common_scatter_dps = scatter(block.common_dps, open.common_scatter_dps);
  block.apart_scatter_dps = scatter(block.apart_dps, open.apart_scatter_dps);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    block.own_scatter_dps[gyro] = scatter(block.own_dps(gyro), open.own_scatter_dps[gyro]);
  double cells = 0.0;
  for (const Sums& fifth : fifths) {
    if (fifth.count == 0.0) continue;
    cells += 1.0;
    const double common_off = fifth.common_dps / fifth.count - block.common_dps;
    const double apart_off = fifth.apart_dps / fifth.count - block.apart_dps;
    block.common_slow_dps += common_off * common_off;
    block.apart_slow_dps += apart_off * apart_off;
    block.own_slow_dps[0] += (common_off + apart_off) * (common_off + apart_off);
    block.own_slow_dps[1] += (common_off - apart_off) * (common_off - apart_off);
  }
  for (double* square : {&block.common_slow_dps, &block.apart_slow_dps, &block.own_slow_dps[0],
                         &block.own_slow_dps[1]})
    *square = std::sqrt(*square / cells);
  return block;
}

void RestFinder::close_block() {
  if (open_.count < kPairsMin) return;
  RestBlock block = closed(open_, fifths_);
  block.common_dps += pivot_[0];
  block.apart_dps += pivot_[1];
  blocks_.push_back(block);
}

std::vector<RestPart> RestFinder::find() {
  close_block();
  open_ = {};
  if (blocks_.empty()) return {};
  std::vector<double> counts;
  for (const RestBlock& block : blocks_)
    counts.push_back(block.count);
  const double least = kFullShare * median(std::move(counts));
  const auto is_poor = [&](const RestBlock& block) { return block.count < least; };
  blocks_.erase(std::remove_if(blocks_.begin(), blocks_.end(), is_poor), blocks_.end());
  std::vector<RestPart> parts;
  std::size_t number = 0;
  for (const auto& run : RestSearch(blocks_, block_s_, settings_).run()) {
    for (std::size_t i = run.first; i < run.end; ++i) {
      const Stretch stretch{blocks_[i].from_s, blocks_[i].from_s + block_s_};
      const bool goes_on =
          i > run.first && stretch.from_s < parts.back().stretch.to_s + 0.5 * block_s_;
      if (goes_on) {
        parts.back().stretch.to_s = stretch.to_s;
      } else {
        parts.push_back({stretch, number});
      }
    }
    ++number;
  }
  return parts;
}

MotionSummary find_motion(const std::array<Series, 2>& paired,
                          const std::array<double, 2>& step_dps) {
  RestFinder finder({.interval_s = paired[0].interval_s, .step_dps = step_dps});
  for (std::size_t p = 0; p < paired[0].parts.size(); ++p) {
    const Part& part = paired[0].parts[p];
    for (std::size_t i = 0; i < part.rate_dps.size(); ++i) {
      finder.add(part.begin_s + static_cast<double>(i) * paired[0].interval_s,
                 {part.rate_dps[i], paired[1].parts[p].rate_dps[i]});
    }
  }
  const std::vector<RestPart> parts = finder.find();
  MotionSummary motion;
  const std::vector<RestBlock>& blocks = finder.blocks();
  if (blocks.empty()) return motion;
  std::vector<double> means;
  for (const RestBlock& block : blocks)
    means.push_back(block.common_dps);
  const double usual_dps = median(means);
  for (const double mean_dps : means)
    motion.turned_up_to_dps = std::max(motion.turned_up_to_dps, std::abs(mean_dps - usual_dps));
  if (std::abs(usual_dps) > MotionSummary::kTurning_dps)
    motion.turned_up_to_dps += std::abs(usual_dps);
  Stretch longest;
  Stretch rest;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const bool same = k > 0 && parts[k].rest == parts[k - 1].rest;
    rest = {same ? rest.from_s : parts[k].stretch.from_s, parts[k].stretch.to_s};
    if (rest.seconds() > longest.seconds()) longest = rest;
  }
  motion.at_rest = !parts.empty() && longest.from_s <= blocks.front().from_s &&
                   longest.to_s >= blocks.back().from_s + 0.5 * finder.block_s();
  if (motion.at_rest || longest.seconds() >= MotionSummary::kRestMin_s) motion.rest = longest;
  return motion;
}

namespace {

// Means over this time are regressed: in shorter ones, noise in the common rate would look like a
// mismatch, and motion is mostly slower.
constexpr double kMean_s = 1.0;
// A larger scale is not a mismatch of two gyros, and nothing is removed.
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

// Regresses steps of the difference on steps of the common rate and of its derivative, so that
// biases and slow drifts cancel.
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
