#pragma once

// Is a gyro's raw value a measurement at all? Takes the values in order and finds values that stand
// still where the sensor never did, values at the end of the range, and zeros of a dead band. It
// learns from the sensor itself how long values repeat and how its noise compares with its steps. A
// coarse sensor that repeats at rest is accepted until the other gyro moves; one that never changed
// while the other gyro moved is accepted only after it moves with the other one. O(1) a sample, no
// allocation, and no judgement depends on the time of day.
// Judges one sample at a time; the caller decides how long a finding lasts.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "base/time.h"

namespace vgyro::fusion {

/// What is known of a sensor beforehand.
struct SensorLimits {
  double lowest_dps = -std::numeric_limits<double>::infinity();
  double highest_dps = std::numeric_limits<double>::infinity();
  double dead_band_dps = 0.0;  ///< below this it sends 0; 0: no dead band
  double lattice_dps = 0.0;    ///< its values are multiples of this apart; 0: not known
};

/// Means over blocks of time that follow each other from the first sample on: has the sensor moved,
/// beyond its own noise?
class Movement {
 public:
  struct Level {
    double dps = 0.0;
    double doubt_dps = 0.0;  ///< 6 σ, and twice the change within the block
  };

  explicit Movement(Duration block) : length_(block) {}

  /// A sample from before the open block is ignored.
  void add(TimePoint t, double rate_dps) {
    const Duration since = t - open_.begin;
    const bool inside = open_.count > 0 && since >= Duration::zero() && since < length_;
    if (!inside) return begin_block(t, rate_dps);
    const double step_dps = rate_dps - open_.last_dps;
    ++open_.count;
    open_.sum_dps += rate_dps - open_.first_dps;
    open_.squares += step_dps * step_dps;
    open_.last_dps = rate_dps;
  }
  /// Least difference of the means of the blocks inside [from, until]: each mean moved by 6 σ.
  [[nodiscard]] double between(TimePoint from, TimePoint until) const;
  /// The newest block that ended at or before `t`, unless that was long ago.
  [[nodiscard]] std::optional<Level> before(TimePoint t) const;
  /// The newest block, if it began at or after `t`.
  [[nodiscard]] std::optional<Level> behind(TimePoint t) const;
  /// Is a step of this size from one sample to the next beyond the recent noise?
  [[nodiscard]] bool is_leap(double step_dps) const;
  /// Number of complete blocks so far.
  [[nodiscard]] std::uint64_t blocks() const { return closed_; }

 private:
  static constexpr std::size_t kBlocks = 8;
  static constexpr int kSamplesMin = 3;
  struct MovementBlock {
    TimePoint begin;
    int count = 0;
    double first_dps = 0.0;
    double sum_dps = 0.0;  ///< less first_dps for each sample, so that rounding loses nothing
    double last_dps = 0.0;
    double squares = 0.0;  ///< Σ of squared steps from sample to sample
    [[nodiscard]] double mean_dps() const { return first_dps + sum_dps / count; }
    [[nodiscard]] double mean_sigma_dps() const;
    [[nodiscard]] Level level() const;
  };
  [[gnu::cold, gnu::noinline]] void begin_block(TimePoint t, double rate_dps);
  /// 0: the newest.
  [[nodiscard]] const MovementBlock& past(std::size_t i) const {
    return done_[(next_ + 2 * kBlocks - 1 - i) % kBlocks];
  }

  Duration length_;
  std::array<MovementBlock, kBlocks> done_;
  std::size_t next_ = 0;
  std::uint64_t closed_ = 0;
  MovementBlock open_;
};

/// The sensor's resolution: the smallest recent difference between successive values. A message may
/// carry far finer steps than the sensor makes.
class ValueStep {
 public:
  /// Coarser than any usable sensor: the step until the values show a smaller one.
  static constexpr double kUnknown_dps = 0.5;

  explicit ValueStep(double lattice_dps) : lattice_dps_(lattice_dps), dps_(worked_out_dps()) {}

  void change(double from_dps, double to_dps);
  [[nodiscard]] bool any() const { return seen_ > 0; }
  [[nodiscard]] double dps() const { return dps_; }

 private:
  [[nodiscard]] double worked_out_dps() const;
  /// Two buckets make the memory: the last 2048 to 4096 changes.
  static constexpr std::uint32_t kBucket = 2048;
  /// Fewer changes than this may all be large.
  static constexpr std::uint32_t kEnough = 8;

  double lattice_dps_;
  double smallest_dps_ = std::numeric_limits<double>::infinity();
  double smallest_before_dps_ = std::numeric_limits<double>::infinity();
  std::uint32_t in_bucket_ = 0;
  std::uint32_t seen_ = 0;  ///< up to kEnough
  double dps_;              ///< cached worked_out_dps(): read at every pair, seldom changed
};

/// How a healthy sensor's values follow each other.
class Habit {
 public:
  /// The value differs from the one before.
  void change(double from_dps, double to_dps);
  /// A run of `times` equal values has ended.
  void repeated(std::uint64_t times);
  /// A run begins, with or without a leap.
  void begins_run(bool leapt);

  /// The noise is far above the steps in nearly all blocks, so equal values in a row are chance.
  [[nodiscard]] bool fine() const;
  [[nodiscard]] std::uint64_t longest_run() const { return longest_run_; }
  /// Probability of a run of so many equal values, on the large side.
  [[nodiscard]] double chance_of_run(std::uint64_t times) const;
  /// False for a source that is slower than the bus: it leaps all the time.
  [[nodiscard]] bool leaps_are_rare() const;
  /// Smallest step between values, on the large side while little is known.
  [[nodiscard]] double step_dps() const { return step_dps_; }

 private:
  static constexpr int kChangesPerBlock = 32;
  static constexpr std::uint64_t kBucket = 256;  ///< samples
  [[gnu::cold, gnu::noinline]] void close_block();

  int changes_ = 0;
  double step_before_ = 0.0;
  double bend_before_ = 0.0;
  int turns_ = 0;       ///< second differences with the opposite sign of the one before
  double bends_ = 0.0;  ///< Σ of squared second differences
  /// Smallest second difference that is not 0.
  double smallest_ = std::numeric_limits<double>::infinity();
  bool step_known_ = false;
  std::uint64_t blocks_ = 0;
  std::uint64_t coarse_blocks_ = 0;
  std::uint64_t longest_run_ = 1;
  std::uint64_t runs_ = 0;
  std::uint64_t leaps_ = 0;
  std::uint64_t in_bucket_ = 0;
  std::uint64_t repeats_in_bucket_ = 0;
  double samples_ = 0.0;
  double repeats_ = 1.0;          ///< share of samples that repeat the one before
  double repeats_of_late_ = 1.0;  ///< the same, in the last bucket
  double step_dps_ = 0.5;         ///< coarser than any usable sensor
};

class SensorWatch {
 public:
  explicit SensorWatch(const SensorLimits& limits) : limits_(limits), step_(limits.lattice_dps) {}

  enum class Finding : std::uint8_t {
    kSound,
    kSaturated,  ///< at the end of the range, known or found
    kStuck,      ///< the value stands still and should change
    kStanding,   ///< the value stands still for some samples; may still be chance
    kBlind       ///< 0 inside the dead band: the rate is anything smaller
  };
  /// The next sample. `other` is the watch of a healthy gyro that turns with this one, or null.
  Finding judge(TimePoint t, double rate_dps, const SensorWatch* other);

  /// Smallest recent difference between values: ValueStep::dps().
  [[nodiscard]] double step_dps() const { return step_.dps(); }
  /// False while the sensor has sent only one value: it may be dead.
  [[nodiscard]] bool ever_changed() const { return step_.any(); }

 private:
  void follow(TimePoint t, double rate_dps);
  void begin_run(TimePoint t, double rate_dps, bool paused);
  void end_run(TimePoint t, double rate_dps, bool paused);
  [[nodiscard]] bool at_a_limit(double rate_dps);
  [[nodiscard]] bool at_the_top(double rate_dps) const;
  // Called only in runs that are long enough.
  [[nodiscard]] [[gnu::cold, gnu::noinline]] bool clipped(double rate_dps) const;
  [[nodiscard]] [[gnu::cold, gnu::noinline]] bool repeats_too_long(TimePoint t) const;
  [[nodiscard]] [[gnu::cold, gnu::noinline]] bool stays_behind(TimePoint t, double rate_dps,
                                                               const SensorWatch& other);
  [[nodiscard]] bool left_the_other(double rate_dps, const SensorWatch& other) const;
  [[nodiscard]] [[gnu::cold, gnu::noinline]] bool is_no_chance(TimePoint t,
                                                               const SensorWatch* other) const;
  [[nodiscard]] [[gnu::cold, gnu::noinline]] bool moves_with(TimePoint t,
                                                             const SensorWatch& other) const;
  [[nodiscard]] double unseen_dps(double rate_dps) const;
  [[nodiscard]] Duration run_time(TimePoint t) const { return t - run_begin_; }

  SensorLimits limits_;
  Movement movement_{std::chrono::milliseconds(500)};
  Movement quick_{std::chrono::milliseconds(100)};
  Habit habit_;
  ValueStep step_;
  bool any_ = false;
  double last_dps_ = 0.0;
  TimePoint last_;
  TimePoint run_begin_;
  std::uint64_t run_ = 0;      ///< equal values in a row, this one included
  bool run_is_fault_ = false;  ///< found saturated or stuck
  bool leapt_ = false;         ///< into this run
  Duration longest_run_time_{0};
  std::uint64_t asked_ = 0;        ///< blocks of the other gyro that were judged
  std::uint64_t asked_quick_ = 0;  ///< quick blocks of the other gyro that were judged
  bool unproven_ = false;          ///< dead from the start, until it moves with the other gyro
  TimePoint alive_since_;          ///< time of its first change
  double peak_dps_ = 0.0;          ///< largest magnitude before this run
  /// Magnitude at which it was found to clip.
  double clip_dps_ = std::numeric_limits<double>::infinity();
};

}  // namespace vgyro::fusion
