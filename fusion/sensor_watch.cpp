#include "fusion/sensor_watch.h"

#include <algorithm>
#include <cmath>

namespace vgyro::fusion {

namespace {

// Share of a limit from which it counts as reached: quantisation may leave out the last fraction.
constexpr double kLimitShare = 0.999;
// No sensor clips below this; a slow turn has flat tops.
constexpr double kClipMin_dps = 5.0;

// A fine sensor repeats a value with a probability below 0.15: fifty in a row are not chance.
constexpr std::uint64_t kStuckSamples = 50;
constexpr Duration kStuckTime = std::chrono::milliseconds(250);
constexpr std::uint64_t kClipSamples = 8;
// Factors over the longest run that the sensor has shown.
constexpr std::uint64_t kRunFactor = 10;
constexpr std::uint64_t kClipRunFactor = 4;

// A run of equal values less likely than this is not chance while something moves.
constexpr double kChance = 1e-6;
// A healthy sensor leaps into a run with less than this probability.
constexpr double kLeapChance = 1e-3;
constexpr std::uint64_t kRunMin = 3;
// Motion that has just ended counts too: a value that froze in it is still frozen.
constexpr Duration kMovedLately = std::chrono::milliseconds(1500);

// How much the other gyro must have moved while this one stood still. Sensors that hold an exact
// zero at standstill do so up to some tenths of a deg/s.
constexpr double kMovement_dps = 0.5;
constexpr double kMovementSteps = 3.0;
constexpr std::uint64_t kUnmovedSamples = 5;
// A filter, or a source slower than the bus, may lag behind by this or by its longest run.
constexpr Duration kLagMin = std::chrono::milliseconds(250);
constexpr Duration kLagMax = std::chrono::seconds(1);
// A sensor that has never changed gets less time: it has not shown yet that it is alive.
constexpr Duration kLagUnproven = std::chrono::milliseconds(80);
// A gyro moves with the other one if it moves by this share of it, within the blocks' memory.
constexpr double kTogether = 0.5;
constexpr Duration kTogetherWithin = std::chrono::seconds(6);
// A longer pause ends a run: nothing is known of the time in it.
constexpr Duration kPause = std::chrono::seconds(1);

constexpr std::uint64_t kBlocksToKnow = 30;
constexpr double kFineSteps = 3.0;
// One block in 34 of a fine sensor looks coarse by chance.
constexpr std::uint64_t kCoarseShare = 10;
// Changes of direction in a block: white noise has 23 of 30, smooth motion a few.
constexpr int kTurnsMin = 12;

// A sensor that has not repeated a value in a thousand samples may still do so.
constexpr double kRepeatsMin = 0.02;
// The share of repeats is a random sample, and changes with vibration.
constexpr double kRepeatsMargin = 1.5;
constexpr double kRepeatsMemory = 4096.0;

constexpr double kSigmas = 6.0;

}  // namespace

// --- movement ------------------------------------------------------------------------------------

double Movement::MovementBlock::mean_sigma_dps() const {
  return std::sqrt(squares / (2.0 * (count - 1)) / count);
}

Movement::Level Movement::MovementBlock::level() const {
  // The rate may have moved as much between blocks as within this one.
  return {mean_dps(), kSigmas * mean_sigma_dps() + 2.0 * std::abs(last_dps - first_dps)};
}

void Movement::begin_block(TimePoint t, double rate_dps) {
  if (open_.count > 0 && t < open_.begin) return;
  if (open_.count >= kSamplesMin) {
    done_[next_] = open_;
    next_ = (next_ + 1) % kBlocks;
    ++closed_;
  }
  open_ = {t, 1, rate_dps, 0.0, rate_dps, 0.0};
}

double Movement::between(TimePoint from, TimePoint until) const {
  double lowest = std::numeric_limits<double>::infinity();
  double highest = -lowest;
  for (const MovementBlock& block : done_) {
    if (block.count == 0 || block.begin < from || block.begin + length_ > until) continue;
    const double doubt = kSigmas * block.mean_sigma_dps();
    lowest = std::min(lowest, block.mean_dps() + doubt);
    highest = std::max(highest, block.mean_dps() - doubt);
  }
  return std::max(0.0, highest - lowest);
}

std::optional<Movement::Level> Movement::before(TimePoint t) const {
  constexpr int kOldMost = 5;  // blocks
  for (std::size_t i = 0; i < kBlocks; ++i) {
    const MovementBlock& block = past(i);
    if (block.count == 0 || block.begin + kOldMost * length_ < t) break;
    if (block.begin + length_ <= t) return block.level();
  }
  return std::nullopt;
}

std::optional<Movement::Level> Movement::behind(TimePoint t) const {
  const MovementBlock& newest = past(0);
  if (newest.count == 0 || newest.begin < t) return std::nullopt;
  return newest.level();
}

bool Movement::is_leap(double step_dps) const {
  const double beyond_dps = std::abs(step_dps) - kMovement_dps;
  if (beyond_dps <= 0.0) return false;
  const MovementBlock& newest = past(0);
  if (newest.count == 0) return false;
  return beyond_dps * beyond_dps > kSigmas * kSigmas * newest.squares / (newest.count - 1);
}

// --- step ----------------------------------------------------------------------------------------

void ValueStep::change(double from_dps, double to_dps) {
  // A float's last digits are no step.
  constexpr double kRounding = 1e-9;
  const double size_dps = std::abs(to_dps - from_dps);
  if (size_dps <= kRounding * std::max(std::abs(from_dps), std::abs(to_dps))) return;
  const bool news = seen_ < kEnough || size_dps < smallest_dps_;
  seen_ = std::min(seen_ + 1, kEnough);
  smallest_dps_ = std::min(smallest_dps_, size_dps);
  const bool full = ++in_bucket_ == kBucket;
  if (full) {
    smallest_before_dps_ = smallest_dps_;
    smallest_dps_ = std::numeric_limits<double>::infinity();
    in_bucket_ = 0;
  }
  if (news || full) dps_ = worked_out_dps();
}

double ValueStep::worked_out_dps() const {
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

void Habit::repeated(std::uint64_t times) {
  longest_run_ = std::max(longest_run_, times);
  // All of them but the first one repeat.
  repeats_in_bucket_ += times - 1;
  in_bucket_ += times;
  if (in_bucket_ < kBucket) return;
  const auto count = static_cast<double>(in_bucket_);
  repeats_of_late_ = static_cast<double>(repeats_in_bucket_) / count;
  const double known = std::min(samples_, kRepeatsMemory);
  repeats_ = (repeats_ * known + static_cast<double>(repeats_in_bucket_)) / (known + count);
  samples_ += count;
  in_bucket_ = 0;
  repeats_in_bucket_ = 0;
}

void Habit::begins_run(bool leapt) {
  ++runs_;
  if (leapt) ++leaps_;
}

bool Habit::leaps_are_rare() const {
  constexpr std::uint64_t kRunsToKnow = 200;
  constexpr std::uint64_t kRare = 100;
  return runs_ >= kRunsToKnow && leaps_ * kRare <= runs_;
}

double Habit::chance_of_run(std::uint64_t times) const {
  const double repeats =
      std::clamp(kRepeatsMargin * std::max(repeats_, repeats_of_late_), kRepeatsMin, 1.0);
  return std::pow(repeats, static_cast<double>(times - 1));
}

void Habit::close_block() {
  // Second differences of white noise have six times its variance.
  const double noise_dps = std::sqrt(bends_ / (6.0 * (kChangesPerBlock - 1)));
  // Smooth motion far above the steps does not show the noise.
  const bool coarse = noise_dps <= kFineSteps * smallest_;
  if (coarse || turns_ >= kTurnsMin) ++blocks_;
  if (coarse) ++coarse_blocks_;
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
  // The expensive checks run only in long runs of equal values, which a healthy sensor hardly ever
  // has.
  const bool behind =
      run_ >= kUnmovedSamples && other != nullptr && stays_behind(t, rate_dps, *other);
  if (behind && !step_.any()) unproven_ = true;
  if (unproven_ && other != nullptr && moves_with(t, *other)) unproven_ = false;
  if (behind || unproven_ || (run_ >= kStuckSamples && repeats_too_long(t))) {
    run_is_fault_ = true;
    return Finding::kStuck;
  }
  const bool no_chance = run_ >= kRunMin && !run_is_fault_ && is_no_chance(t, other);
  if (no_chance && at_the_top(rate_dps)) {
    run_is_fault_ = true;
    clip_dps_ = std::abs(rate_dps);
    return Finding::kSaturated;
  }
  if (run_is_fault_ || no_chance) {
    run_is_fault_ = true;
    return run_time(t) < kStuckTime ? Finding::kStanding : Finding::kStuck;
  }
  return rate_dps == 0.0 && limits_.dead_band_dps > 0.0 ? Finding::kBlind : Finding::kSound;
}

void SensorWatch::follow(TimePoint t, double rate_dps) {
  const bool paused = any_ && t - last_ > kPause;
  if (any_ && !paused && rate_dps == last_dps_) {
    ++run_;
  } else {
    begin_run(t, rate_dps, paused);
  }
  movement_.add(t, rate_dps);
  quick_.add(t, rate_dps);
  last_dps_ = rate_dps;
  last_ = any_ ? std::max(last_, t) : t;
  any_ = true;
}

void SensorWatch::begin_run(TimePoint t, double rate_dps, bool paused) {
  if (any_) end_run(t, rate_dps, paused);
  leapt_ = any_ && !paused && quick_.is_leap(rate_dps - last_dps_);
  habit_.begins_run(leapt_);
  run_ = 1;
  run_begin_ = t;
  run_is_fault_ = false;
}

// This sample differs from those before, or comes after a pause.
void SensorWatch::end_run(TimePoint t, double rate_dps, bool paused) {
  if (!run_is_fault_) {
    habit_.repeated(run_);
    longest_run_time_ = std::max(longest_run_time_, last_ - run_begin_);
  }
  peak_dps_ = std::max(peak_dps_, std::abs(last_dps_));
  if (rate_dps == last_dps_) return;
  if (!step_.any()) alive_since_ = t;
  step_.change(last_dps_, rate_dps);
  if (!paused) habit_.change(last_dps_, rate_dps);
}

bool SensorWatch::at_the_top(double rate_dps) const {
  return std::abs(rate_dps) >= std::max(peak_dps_, kClipMin_dps);
}

bool SensorWatch::clipped(double rate_dps) const {
  return at_the_top(rate_dps) && habit_.fine() && run_ >= kClipRunFactor * habit_.longest_run();
}

bool SensorWatch::at_a_limit(double rate_dps) {
  // A bound at zero is the beginning of a magnitude, not the end of a sensor's range.
  if (limits_.highest_dps > 0.0 && rate_dps >= kLimitShare * limits_.highest_dps) return true;
  if (limits_.lowest_dps < 0.0 && rate_dps <= kLimitShare * limits_.lowest_dps) return true;
  if (std::abs(rate_dps) * kLimitShare > clip_dps_) {
    clip_dps_ = std::numeric_limits<double>::infinity();  // it reaches more, so it was stuck there,
                                                          // not clipped
  }
  if (run_ >= kClipSamples && clipped(rate_dps)) clip_dps_ = std::abs(rate_dps);
  return std::abs(rate_dps) >= kLimitShare * clip_dps_;
}

bool SensorWatch::repeats_too_long(TimePoint t) const {
  return habit_.fine() && run_ >= kRunFactor * habit_.longest_run() && run_time(t) >= kStuckTime;
}

// How far the other gyro may move before this one must have seen it.
double SensorWatch::unseen_dps(double rate_dps) const {
  const double hidden_dps = rate_dps == 0.0 ? 2.0 * limits_.dead_band_dps : 0.0;
  return std::max(kMovement_dps, kMovementSteps * habit_.step_dps()) + hidden_dps;
}

// The other gyro moves and this one does not. Evaluated only when the other gyro has a new block.
bool SensorWatch::stays_behind(TimePoint t, double rate_dps, const SensorWatch& other) {
  if (other.quick_.blocks() != asked_quick_) {
    asked_quick_ = other.quick_.blocks();
    const bool dead = !step_.any();
    if (dead && other.quick_.between(run_begin_, t - kLagUnproven) > unseen_dps(rate_dps)) {
      return true;
    }
    if (left_the_other(rate_dps, other)) return true;
  }
  if (other.movement_.blocks() == asked_) return false;
  asked_ = other.movement_.blocks();
  const Duration lag = std::clamp(longest_run_time_, kLagMin, kLagMax);
  return other.movement_.between(run_begin_, t - lag) > unseen_dps(rate_dps);
}

// This gyro has leapt to a value and keeps it; the other one, which is alive, has not moved as far.
bool SensorWatch::left_the_other(double rate_dps, const SensorWatch& other) const {
  if (!leapt_ || !habit_.leaps_are_rare() || other.run_ >= kUnmovedSamples) return false;
  const auto before = quick_.before(run_begin_);
  const auto other_before = other.quick_.before(run_begin_);
  const auto other_now = other.quick_.behind(run_begin_ + kLagMin);
  if (!before || !other_before || !other_now) return false;
  const double doubt_dps = before->doubt_dps + other_before->doubt_dps + other_now->doubt_dps;
  const double gone_dps = rate_dps - before->dps - (other_now->dps - other_before->dps);
  return std::abs(gone_dps) > unseen_dps(rate_dps) + doubt_dps;
}

// Too many equal values for chance while something moves. At rest a sensor may fall quiet.
bool SensorWatch::is_no_chance(TimePoint t, const SensorWatch* other) const {
  if (!habit_.fine()) return false;
  const bool leapt = leapt_ && habit_.leaps_are_rare();
  if (habit_.chance_of_run(run_) > (leapt ? kChance / kLeapChance : kChance)) return false;
  const TimePoint from = run_begin_ - kMovedLately;
  return leapt || movement_.between(from, t) > kMovement_dps ||
         (other != nullptr && other->movement_.between(from, t) > kMovement_dps);
}

// A dead gyro has come to life, and moves as the other one does.
bool SensorWatch::moves_with(TimePoint t, const SensorWatch& other) const {
  if (!step_.any()) return false;
  const TimePoint from = std::max(alive_since_, t - kTogetherWithin);
  const double own_dps = movement_.between(from, t);
  const double other_dps = other.movement_.between(from, t);
  return other_dps > kMovement_dps && own_dps >= kTogether * other_dps &&
         own_dps * kTogether <= other_dps;
}

}  // namespace vgyro::fusion
