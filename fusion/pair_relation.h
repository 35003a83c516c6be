#pragma once

// Can these two streams be of gyros that turn together? Compares the changes of the gyros' means
// over tenths of a second. A healthy pair moves alike, whatever its noise, biases, scale factors,
// bandwidths, and delays of some tenths of a second. If one gyro moves against the other, many
// times as far, much later than that, or on its own, the two contradict each other: a sign, a unit,
// an axis or the bits of a signal are wrong in the configuration. The evidence of one block is
// bounded, so that a step, a drift or an odd second is not enough; a contradiction is taken back in
// the same way.
// It does not find which of the two is wrong: two streams cannot show that. A gyro that does not
// move at all while the other one does is left to fusion/coherence.
// Bounded memory, nothing is allocated; times are seconds on one monotone axis, rates deg/s.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

enum class Contradiction : std::uint8_t {
  kNone,
  kSign,       ///< gyro 2 moves against gyro 1
  kScale,      ///< gyro 2 moves with gyro 1, but many times as far, or a small part of it
  kLag,        ///< gyro 2 moves as gyro 1 does, but at another time
  kUnrelated,  ///< both move, and have too little in common
  kErratic     ///< one gyro's values jump, or are far off, as no gyro's do
};
inline constexpr std::size_t kContradictions = 6;

/// How gyro 2 follows gyro 1. The figures are valid only with a contradiction.
struct PairVerdict {
  Contradiction contradiction = Contradiction::kNone;
  double probability = 0.0;  ///< that they contradict each other
  double slope = 0.0;        ///< gyro 2's motion over gyro 1's; NaN if they have nothing in common
  /// 1σ of the slope from its scatter between blocks; NaN for kLag, or if the slope is NaN.
  double slope_sigma = 0.0;
  double lag_s = 0.0;    ///< delay of gyro 2 against gyro 1 for kLag, else 0
  std::size_t gyro = 2;  ///< gyro with erratic values for kErratic, else 2
};

class PairRelation {
 public:
  /// Most by which healthy gyros differ: slope or its reciprocal, and delay.
  static constexpr double kSlopeMost = 2.5;
  static constexpr double kLagMost_s = 0.6;

  /// The next pair; t_s grows from call to call.
  void add(double t_s, const std::array<double, 2>& rate_dps) {
    if (samples_ > 0) {
      const double step_s = t_s - newest_s_;
      if (t_s - from_s_ >= kCell_s || step_s > kGap_s) close_cell(t_s, step_s);
    }
    if (samples_ == 0) {
      from_s_ = t_s;
      origin_ = rate_dps;
    }
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const double away_dps = rate_dps[gyro] - origin_[gyro];
      sum_[gyro] += away_dps;
      square_[gyro] += away_dps * away_dps;
      const double step_dps = rate_dps[gyro] - newest_dps_[gyro];
      if (samples_ > 0) step_square_[gyro] += squared(step_dps);
      if (std::abs(step_dps) > std::abs(step_most_[gyro])) step_most_[gyro] = step_dps;
    }
    newest_dps_ = rate_dps;
    ++samples_;
    newest_s_ = t_s;
  }

  /// A gyro was found faulty: its last samples are no evidence about the pair.
  void break_off() {
    samples_ = 0;
    sum_ = square_ = step_square_ = step_most_ = {};
    count_ = 0;
    since_block_ = since_long_block_ = 0;
  }

  /// Before the first pair: the verdict of an earlier run. It stands until some blocks show a
  /// healthy pair, or something else is found.
  void resume(const PairVerdict& verdict) { verdict_ = earlier_ = verdict; }

  [[nodiscard]] const PairVerdict& verdict() const { return verdict_; }
  [[nodiscard]] bool contradicts() const { return verdict_.contradiction != Contradiction::kNone; }
  /// Number of times that a contradiction began.
  [[nodiscard]] std::uint64_t times() const { return times_; }

 private:
  static constexpr double kCell_s = 0.1;
  /// After a gap longer than this, and than four cells, everything but the evidence restarts.
  static constexpr double kGap_s = 0.5;
  static constexpr std::size_t kBlock = 10;  ///< cells of a block
  /// Cells of a long block, which is compared over all lags.
  static constexpr std::size_t kLongBlock = 20;
  static constexpr std::size_t kLags = 30;    ///< most lag to either side, in cells
  static constexpr std::size_t kCells = 128;  ///< cells in memory

  struct RelationCell {
    std::array<double, 2> mean_dps{};
    std::array<double, 2> scatter{};  ///< variance of the samples about the mean; 0 for one sample
    std::array<double, 2> leap{};     ///< largest step from one sample to the next, signed
    std::array<double, 2> rough{};    ///< variance of the samples from their steps, as if white
    double samples = 0.0;
    double length_s = 0.0;
  };
  /// A stretch of cells of one gyro.
  struct Stretch {
    double mean_dps = 0.0;
    double squares = 0.0;  ///< about the mean
    double bends = 0.0;    ///< variance of a cell's mean, from second differences
    double noise = 0.0;    ///< variance of a cell's mean that is not smooth motion
    double rough = 0.0;    ///< variance of a sample within its cell, from steps between samples
  };
  /// Sums of squares and products of a stretch of gyro 1 and one of gyro 2, about their means.
  struct Products {
    double first = 0.0;
    double second = 0.0;
    double both = 0.0;
  };
  /// How a stretch of gyro 2 follows one of gyro 1.
  struct Fit {
    double slope = 0.0;
    double left = 1.0;  ///< share of gyro 2's squares that the slope leaves
    double own = 0.0;   ///< Σ of gyro 1's squares
    double both = 0.0;  ///< Σ of the products
  };
  /// Sums over the long blocks at one lag, older ones fading.
  struct AtLag {
    double now = 0.0;          ///< share that a healthy slope leaves in the newest block
    double left = 0.0;         ///< Σ of `now`
    double blocks = 0.0;       ///< number of blocks that support this lag against all healthy ones
    double any_left = 0.0;     ///< Σ of the share that the best slope of any size leaves
    double strong_left = 0.0;  ///< as `left`, for blocks in which both moved far
    double both = 0.0;         ///< Σ of the products
  };
  /// Sums over the blocks that support one contradiction, for their common slope.
  struct Slopes {
    double own = 0.0;
    double both = 0.0;
    double own_square = 0.0;
    double both_square = 0.0;
    double product = 0.0;
    [[nodiscard]] double slope() const { return both / own; }
    [[nodiscard]] double sigma() const;
    void add(const Fit& fit);
  };

  [[gnu::noinline]] void close_cell(double t_s, double step_s);
  [[nodiscard]] const RelationCell& cell(std::size_t i) const {
    return cells_[(head_ + i) % kCells];
  }
  [[nodiscard]] Stretch stretch(std::size_t gyro, std::size_t from, std::size_t length) const;
  /// `trends_off` removes trends too, which may be drift; `halfway` shifts gyro 2 by half a cell
  /// more.
  [[nodiscard]] Products products(std::size_t from, std::size_t lagged_from, std::size_t length,
                                  bool trends_off, bool halfway = false) const;
  /// Best fit with a slope between these limits.
  [[nodiscard]] static Fit fit(const Products& sums, double slope_least, double slope_most);
  /// Best fit with a healthy slope, half a cell later.
  [[nodiscard]] Fit halfway_fit(std::size_t from, std::size_t lagged_from, std::size_t length,
                                bool trends_off) const;
  [[nodiscard]] static bool moves(const Stretch& stretch, std::size_t length);
  /// Range of the angle that this gyro has turned within the memory, its mean rate removed, deg.
  [[nodiscard]] double swing_deg(std::size_t gyro) const;

  void judge_block();
  [[nodiscard]] double block_tells(std::size_t from, std::size_t lags,
                                   const std::array<Stretch, 2>& both, Fit& contrary) const;
  [[nodiscard]] static bool clear_of_noise(const Products& sums,
                                           const std::array<Stretch, 2>& both);
  void hear(double tells, const Fit& contrary);
  void judge_values(std::size_t from, const std::array<Stretch, 2>& both);
  [[nodiscard]] bool jumps(std::size_t gyro, std::size_t from, const std::array<Stretch, 2>& both,
                           bool moving) const;
  void look_for_leaps(std::size_t gyro, std::size_t from, bool moving);
  [[nodiscard]] bool erratic(std::size_t gyro) const;
  void judge_long_block();
  void judge_following(const std::array<Stretch, 2>& both, double most_alike, double left);
  void weigh_lags();
  void judge_common(double left);
  [[nodiscard]] std::size_t near_lags(std::size_t most) const;
  void decide();

  // The cell that is being filled.
  std::size_t samples_ = 0;
  double from_s_ = 0.0;
  double newest_s_ = 0.0;
  std::array<double, 2> origin_{};
  std::array<double, 2> sum_{};
  std::array<double, 2> square_{};
  std::array<double, 2> step_square_{};
  std::array<double, 2> step_most_{};
  std::array<double, 2> newest_dps_{};

  std::array<RelationCell, kCells> cells_;
  std::size_t head_ = 0;
  std::size_t count_ = 0;
  double length_s_ = 0.0;             ///< usual length of a cell
  std::size_t since_block_ = 0;       ///< cells since the last block was judged
  std::size_t since_long_block_ = 0;  ///< cells since the last long block was judged

  double evidence_ = 0.0;  ///< log odds of the blocks, above the prior
  Slopes slopes_;
  bool by_blocks_ = false;  ///< a contradiction found by the blocks stands
  std::array<AtLag, 2 * kLags + 1> lags_{};
  std::size_t lag_cells_ = 0;  ///< number of lags to either side, for the present cell length
  double long_blocks_ = 0.0;
  double strong_blocks_ = 0.0;
  bool pooled_ = false;  ///< the gyros have too little in common over the strong blocks
  double pooled_probability_ = 0.0;
  double own_ = 0.0;
  PairVerdict late_;               ///< verdict from the lags
  double best_any_left_ = 0.0;     ///< mean `any_left` at the best healthy lag
  std::array<double, 2> alone_{};  ///< log odds, above the prior, that this gyro moves by itself
  bool unrelated_ = false;         ///< both gyros were found to move by themselves
  /// Evidence about the values of one gyro.
  struct Values {
    // Index: 0 while the other gyro stood still, 1 while it moved.
    std::array<double, 2> erratic{};    ///< erratic blocks, less calm ones
    std::array<std::size_t, 2> calm{};  ///< calm blocks
    std::array<double, 2> leaps{};      ///< index: 0 down, 1 up; older ones fade
  };
  std::array<Values, 2> values_;
  bool were_near_ = false;  ///< the gyros have been closer than the largest bias
  PairVerdict earlier_;     ///< verdict of an earlier run, while it stands
  PairVerdict verdict_;
  std::uint64_t times_ = 0;
};

}  // namespace vgyro::fusion
