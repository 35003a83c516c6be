#include "fusion/sensor_watch.h"

#include <algorithm>
#include <cmath>

namespace vgyro::fusion {

namespace {

// A limit is reached from here on: quantisation may leave the last fraction out.
constexpr double kLimitShare = 0.999;
// No sensor clips below; a slow turn has flat tops.
constexpr double kClipMin_dps = 5.0;

// A fine sensor repeats a value with a probability below 0.15: fifty in a row are no chance.
constexpr std::uint64_t kStuckSamples = 50;
constexpr Duration kStuckTime = std::chrono::milliseconds(250);
constexpr std::uint64_t kClipSamples = 8;
// Beyond the longest run that it has ever shown by this.
constexpr std::uint64_t kRunFactor = 10;
constexpr std::uint64_t kClipRunFactor = 4;

// How much the other gyro must have moved while this one stood still. Sensors that hold an exact
// zero at standstill do so up to some tenths of a deg/s.
constexpr double kMovement_dps = 0.5;
constexpr double kMovementSteps = 3.0;
constexpr std::uint64_t kUnmovedSamples = 5;
// A filter, or a source slower than the bus, may lag behind by this or by its longest run.
constexpr Duration kLagMin = std::chrono::milliseconds(250);
constexpr Duration kLagMax = std::chrono::seconds(1);
// Behind a pause nothing is said of the time in it.
constexpr Duration kPause = std::chrono::seconds(1);

constexpr std::uint64_t kBlocksToKnow = 30;
constexpr double kFineSteps = 3.0;
// One block in 34 of a fine sensor looks coarse by chance.
constexpr std::uint64_t kCoarseShare = 10;
// White noise has 23 of 30, smooth motion a few.
constexpr int kTurnsMin = 12;

std::int64_t block_of(TimePoint t) {
  return to_ns(t) / Movement::kBlock.count();
}

}  // namespace

// --- movement ------------------------------------------------------------------------------------

double Movement::Block::mean_sigma_dps() const {
  return std::sqrt(squares / (2.0 * (count - 1)) / count);
}

void Movement::add(TimePoint t, double rate_dps) {
  const std::int64_t index = block_of(t);
  if (index < open_.index) return;
  if (index > open_.index) {
    if (open_.count >= kSamplesMin) {
      done_[next_] = open_;
      next_ = (next_ + 1) % kBlocks;
    }
    open_ = {index, 1, rate_dps, 0.0, rate_dps, 0.0};
    return;
  }
  ++open_.count;
  open_.sum_dps += rate_dps - open_.first_dps;
  open_.squares += (rate_dps - open_.last_dps) * (rate_dps - open_.last_dps);
  open_.last_dps = rate_dps;
}

double Movement::between(TimePoint from, TimePoint until) const {
  constexpr double kSigmas = 6.0;
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (const Block& block : done_) {
    if (block.count == 0) continue;
    const TimePoint begin{block.index * kBlock};
    if (begin < from || begin + kBlock > until) continue;
    const double doubt = kSigmas * block.mean_sigma_dps();
    lowest = std::min(lowest, block.mean_dps() + doubt);
    highest = std::max(highest, block.mean_dps() - doubt);
  }
  return std::max(0.0, highest - lowest);
}

// --- step ----------------------------------------------------------------------------------------

void ValueStep::change(double from_dps, double to_dps) {
  // A float's last digits are no step.
  constexpr double kRounding = 1e-9;
  const double size_dps = std::abs(to_dps - from_dps);
  if (size_dps <= kRounding * std::max(std::abs(from_dps), std::abs(to_dps))) return;
  seen_ = std::min(seen_ + 1, kEnough);
  smallest_dps_ = std::min(smallest_dps_, size_dps);
  if (++in_bucket_ < kBucket) return;
  smallest_before_dps_ = smallest_dps_;
  smallest_dps_ = std::numeric_limits<double>::infinity();
  in_bucket_ = 0;
}

double ValueStep::dps() const {
  double step_dps = std::min(smallest_dps_, smallest_before_dps_);
  if (seen_ < kEnough) step_dps = std::min(step_dps, std::max(kUnknown_dps, lattice_dps_));
  if (lattice_dps_ == 0.0) return step_dps;
  return std::max(std::round(step_dps / lattice_dps_), 1.0) * lattice_dps_;
}

// --- habit ---------------------------------------------------------------------------------------

// Second differences: steady motion, even fast, hardly shows in them.
void Habit::change(double from_dps, double to_dps) {
  const double step = to_dps - from_dps;
  const double bend = step - step_before_;
  step_before_ = step;
  if (changes_++ == 0) return;
  bends_ += bend * bend;
  if (bend * bend_before_ < 0.0) ++turns_;
  if (bend != 0.0) {
    bend_before_ = bend;
    smallest_ = std::min(smallest_, std::abs(bend));
  }
  if (changes_ == kChangesPerBlock) close_block();
}

void Habit::close_block() {
  // Of white noise they have six times its variance.
  const double noise_dps = std::sqrt(bends_ / (6.0 * (kChangesPerBlock - 1)));
  ++blocks_;
  if (noise_dps <= kFineSteps * smallest_ || turns_ < kTurnsMin) ++coarse_blocks_;
  if (std::isfinite(smallest_)) {
    step_dps_ = step_known_ ? step_dps_ + (smallest_ - step_dps_) / 8.0 : smallest_;
    step_known_ = true;
  }
  changes_ = 0;
  turns_ = 0;
  bends_ = 0.0;
  bend_before_ = 0.0;
  smallest_ = std::numeric_limits<double>::infinity();
}

bool Habit::fine() const {
  return blocks_ >= kBlocksToKnow && coarse_blocks_ * kCoarseShare <= blocks_;
}

// --- watch ---------------------------------------------------------------------------------------

SensorWatch::Finding SensorWatch::judge(TimePoint t, double rate_dps, const SensorWatch* other) {
  follow(t, rate_dps);
  if (at_a_limit(rate_dps)) {
    run_is_fault_ = true;
    return Finding::kSaturated;
  }
  if (stands_still(t, rate_dps, other)) {
    run_is_fault_ = true;
    return Finding::kStuck;
  }
  return rate_dps == 0.0 && limits_.dead_band_dps > 0.0 ? Finding::kBlind : Finding::kSound;
}

void SensorWatch::follow(TimePoint t, double rate_dps) {
  movement_.add(t, rate_dps);
  const bool paused = any_ && t - last_ > kPause;
  if (any_ && !paused && rate_dps == last_dps_) {
    ++run_;
  } else {
    if (any_ && !run_is_fault_) {
      habit_.repeated(run_);
      longest_run_time_ = std::max(longest_run_time_, last_ - run_begin_);
    }
    if (any_) peak_dps_ = std::max(peak_dps_, std::abs(last_dps_));
    if (any_ && rate_dps != last_dps_) {
      step_.change(last_dps_, rate_dps);
      if (!paused) habit_.change(last_dps_, rate_dps);
    }
    run_ = 1;
    run_begin_ = t;
    run_is_fault_ = false;
  }
  last_dps_ = rate_dps;
  last_ = any_ ? std::max(last_, t) : t;
  any_ = true;
}

bool SensorWatch::clipped(double rate_dps) const {
  return std::abs(rate_dps) >= std::max(peak_dps_, kClipMin_dps) && habit_.fine() &&
         run_ >= std::max(kClipSamples, kClipRunFactor * habit_.longest_run());
}

bool SensorWatch::at_a_limit(double rate_dps) {
  // A bound at zero is where a magnitude begins, not where a sensor ends.
  if (limits_.highest_dps > 0.0 && rate_dps >= kLimitShare * limits_.highest_dps) return true;
  if (limits_.lowest_dps < 0.0 && rate_dps <= kLimitShare * limits_.lowest_dps) return true;
  if (std::abs(rate_dps) * kLimitShare > clip_dps_) {
    clip_dps_ = std::numeric_limits<double>::infinity();  // it can say more: it was stuck there
  }
  if (clipped(rate_dps)) clip_dps_ = std::abs(rate_dps);
  return std::abs(rate_dps) >= kLimitShare * clip_dps_;
}

bool SensorWatch::stands_still(TimePoint t, double rate_dps, const SensorWatch* other) {
  if (run_is_fault_) return true;
  if (habit_.fine() && run_ >= std::max(kStuckSamples, kRunFactor * habit_.longest_run()) &&
      run_time(t) >= kStuckTime) {
    return true;
  }
  // The other one's movement is looked at once in a block: it changes no more often.
  if (other == nullptr || run_ < kUnmovedSamples || block_of(t) == asked_block_) return false;
  asked_block_ = block_of(t);
  const double hidden_dps = rate_dps == 0.0 ? 2.0 * limits_.dead_band_dps : 0.0;
  const Duration lag = std::clamp(longest_run_time_, kLagMin, kLagMax);
  return other->movement_.between(run_begin_, t - lag) >
         std::max(kMovement_dps, kMovementSteps * habit_.step_dps()) + hidden_dps;
}

}  // namespace vgyro::fusion
