#pragma once

// Two gyros' samples, each at its own rate and phase, become pairs at common instants. One gyro
// paces: pairs have its stamps. The other one is converted to these instants: by linear
// interpolation between its two neighbours, or, if it is at least kAverageRatio times faster, by
// the mean of its interpolant over one pace interval, so that no information is lost and nothing
// aliases. A pair is complete with the first sample of the other gyro at or after it; this wait is
// the latency. Readings that are known to come late are dated back first. The pacing gyro is chosen
// from the first samples, and again when a gyro keeps a different pace. Buffers are bounded; a
// sample that can no longer be paired is counted, never used.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "base/time.h"

namespace vgyro::fusion {

struct AlignedPair {
  TimePoint t;         ///< the instant that both rates refer to
  TimePoint complete;  ///< stamp, not dated back, of the sample that completed the pair
  std::array<double, 2> rate_dps{};
  /// White-noise variance of each rate relative to one raw sample: interpolation and averaging
  /// lower it.
  std::array<double, 2> noise_gain{1.0, 1.0};
};

class Aligner {
 public:
  static constexpr std::size_t kCapacity = 4096;
  /// Samples of each gyro before the pacing gyro is chosen.
  static constexpr std::size_t kSamplesToChoose = 8;
  /// The choice uses no more than the newest so many.
  static constexpr std::size_t kSamplesJudged = 64;
  /// An interval longer than this many usual ones of the gyro is a gap, in which nothing is
  /// interpolated.
  static constexpr double kGapIntervals = 4.0;
  static constexpr double kAverageRatio = 1.5;
  /// A pace that differs by this factor in two reviews in a row is a new one.
  static constexpr double kOtherPace = 1.5;
  /// Least duration and number of samples of a review: more than a delayed queue delivers at once.
  static constexpr Duration kReview = std::chrono::seconds(1);
  static constexpr int kReviewSamples = 8;
  /// A longer interval is not one: the clock was set between the two samples.
  static constexpr Duration kIntervalMax = std::chrono::hours(1);

  /// `lag`: a sample stamped t holds the rate at t − lag.
  explicit Aligner(std::array<Duration, 2> lag = {}) : lag_(lag) {}

  /// False when the sample is older than what has already been used.
  bool push(std::size_t gyro, TimePoint t, double rate_dps);

  /// The next complete pair; t grows from pair to pair.
  bool pop(AlignedPair& pair) { return can_pair() && pop_next(pair); }

  /// The oldest buffered sample of this gyro after `t`, for the time when it finds no partner.
  /// False when there is none.
  [[nodiscard]] bool next_behind(std::size_t gyro, TimePoint t, TimePoint& sample_t,
                                 double& rate_dps) const;

  /// Forget all samples, keep the choice: after a step of the clock.
  void clear();

  struct Counts {
    /// Samples of the pacing gyro inside a gap of the other one, or pushed out of the buffer while
    /// waiting for it.
    std::array<std::uint64_t, 2> unpaired{};
  };
  [[nodiscard]] const Counts& counts() const { return counts_; }

  /// Has a pacing gyro ever been chosen? During a new choice the old intervals stay valid.
  [[nodiscard]] bool chosen() const { return ever_chosen_; }
  /// Gyro whose stamps the pairs have. Precondition of this and of interval(): chosen().
  [[nodiscard]] std::size_t pacing_gyro() const { return pace_; }
  [[nodiscard]] Duration interval(std::size_t gyro) const { return interval_[gyro]; }
  /// The faster gyro's samples for one average, and for the wait for it, do not fit the buffer:
  /// there will be no pairs.
  [[nodiscard]] bool too_far_apart() const { return too_far_apart_; }

 private:
  struct RateSample {
    TimePoint t;
    double rate_dps = 0.0;
  };
  class Ring {
   public:
    [[nodiscard]] std::size_t size() const { return size_; }
    [[nodiscard]] bool empty() const { return size_ == 0; }
    [[nodiscard]] const RateSample& operator[](std::size_t i) const {
      return samples_[(head_ + i) & (kCapacity - 1)];
    }
    [[nodiscard]] const RateSample& back() const { return (*this)[size_ - 1]; }
    void pop_front(std::size_t count = 1) {
      head_ = (head_ + count) & (kCapacity - 1);
      size_ -= count;
    }
    void clear() { size_ = 0; }
    [[nodiscard]] bool is_behind_all(TimePoint t) const { return size_ == 0 || back().t < t; }
    /// Precondition: size() < kCapacity, is_behind_all().
    void append(TimePoint t, double rate_dps) {
      RateSample& sample = samples_[(head_ + size_++) & (kCapacity - 1)];
      sample.t = t;
      sample.rate_dps = rate_dps;
    }
    /// Keeps the stamps ascending. Precondition: size() < kCapacity, no equal stamp inside.
    [[gnu::cold, gnu::noinline]] void insert(const RateSample& sample);
    [[nodiscard]] bool contains(TimePoint t) const;
    /// Usual interval, and number, of the samples at or before `until`.
    [[nodiscard]] Duration usual_interval(TimePoint until) const;
    [[nodiscard]] std::size_t count_until(TimePoint until) const;

   private:
    static_assert((kCapacity & (kCapacity - 1)) == 0);
    std::array<RateSample, kCapacity> samples_;
    std::size_t head_ = 0;
    std::size_t size_ = 0;
  };

  /// Intervals between a gyro's stamps since the last review.
  struct Review {
    bool begun = false;
    TimePoint newest;
    Duration sum{0};
    Duration longest{0};
    int intervals = 0;
    Duration odd_pace{0};  ///< pace of the review before if it differed from interval_; else 0
  };

  /// Is there a sample to pair, and one of the other gyro at or after it?
  [[nodiscard]] bool can_pair() const {
    const Ring& own = rings_[pace_];
    const Ring& other = rings_[1 - pace_];
    return chosen_ && !own.empty() && !other.empty() && other.back().t >= own[0].t + half_window_;
  }
  bool pop_next(AlignedPair& pair);
  [[gnu::cold, gnu::noinline]] void choose_pace();
  void review(std::size_t gyro, TimePoint t) {
    Review& review = reviews_[gyro];
    if (review.begun && t <= review.newest) return;
    if (review.begun) {
      const Duration interval = std::min<Duration>(t - review.newest, kIntervalMax);
      review.sum += interval;
      review.longest = std::max(review.longest, interval);
      ++review.intervals;
    }
    review.begun = true;
    review.newest = t;
    if (review.sum >= kReview && review.intervals >= kReviewSamples) close_review(gyro, t);
  }
  [[gnu::cold, gnu::noinline]] void close_review(std::size_t gyro, TimePoint t);
  void choose_again(std::size_t gyro, Duration interval, TimePoint behind);
  [[nodiscard]] Duration mean_wait(std::size_t pace, TimePoint until) const;
  void drop_before(TimePoint needed, std::size_t gyro);
  bool interpolate(const Ring& other, AlignedPair& pair, std::size_t other_index);
  [[gnu::cold, gnu::noinline]] bool average(const Ring& other, AlignedPair& pair,
                                            std::size_t other_index);

  std::array<Duration, 2> lag_;
  std::array<Ring, 2> rings_;  ///< at the instants of the rates
  std::array<Review, 2> reviews_{};
  std::array<Duration, 2> reviewed_{};  ///< intervals found by a review; 0: none yet
  std::array<Duration, 2> interval_{};
  std::array<Duration, 2> gap_{};
  std::array<TimePoint, 2> used_until_{};  ///< samples at or before this come too late
  std::array<bool, 2> any_used_{};
  TimePoint burst_until_{};  ///< stamp until which earlier pairs waited for the choice
  Duration half_window_{0};  ///< of the averaging; 0 with interpolation
  std::size_t pace_ = 0;
  bool chosen_ = false;
  bool ever_chosen_ = false;
  bool too_far_apart_ = false;
  Counts counts_;
};

}  // namespace vgyro::fusion
