#pragma once

// Was the platform still, and when? The one notion of rest that `vgyro allan`, `vgyro gap` and
// `vgyro init` share. Noise and drift belong to each gyro alone, motion to both: at rest the mean
// of the two rates varies like half their difference, in motion far more. So rest is judged by both
// gyros, by steadiness alone, and against what the gyros' own noise is: no quiet second of a hover
// passes. A rest is known again by what the gyros read in the last one, not in the first, because
// drift moves on. A steady turn cannot be distinguished from two equal biases, so a common rate
// beyond kTurning_dps counts as turning.

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "analysis/series.h"

namespace vgyro::analysis {

struct Stretch {
  double from_s = 0.0;
  double to_s = 0.0;
  [[nodiscard]] double seconds() const { return to_s - from_s; }
};

/// What is without a hole of a rest.
struct RestPart {
  Stretch stretch;
  std::size_t rest = 0;  ///< parts of one rest have its number
};

/// The mean of both gyros, and half their difference, in a block of time.
struct RestBlock {
  double from_s = 0.0;
  double count = 0.0;
  double common_dps = 0.0;
  double apart_dps = 0.0;
  double common_scatter_dps = 0.0;  ///< standard deviations
  double apart_scatter_dps = 0.0;
  double common_slow_dps = 0.0;  ///< standard deviation of the means of its fifths
  double apart_slow_dps = 0.0;
  std::array<double, 2> own_scatter_dps{};  ///< standard deviation of each gyro
  std::array<double, 2> own_slow_dps{};

  [[nodiscard]] double own_dps(std::size_t gyro) const {
    return gyro == 0 ? common_dps + apart_dps : common_dps - apart_dps;
  }
};

/// Pairs of rates in the order of time → rests. Memory: 64 bytes a second.
class RestFinder {
 public:
  struct Settings {
    double interval_s = 0.01;          ///< of the pairs
    std::array<double, 2> step_dps{};  ///< between a gyro's values; 0: unknown, or none
    double rate_dps = 0.0;             ///< true rate at rest
    /// What only the finer gyro feels is motion too: for who takes each gyro's reading at rest for
    /// its error.
    bool by_each_alone = false;
  };
  explicit RestFinder(const Settings& settings);

  void add(double t_s, const std::array<double, 2>& rate_dps);

  /// Whole blocks, without what is at the edge of a motion. To be called once.
  std::vector<RestPart> find();
  /// Those with enough pairs for a result; of find().
  [[nodiscard]] const std::vector<RestBlock>& blocks() const { return blocks_; }
  [[nodiscard]] double block_s() const { return block_s_; }

 private:
  void close_block();

  Settings settings_;
  double block_s_ = 1.0;
  static constexpr std::size_t kFifths = 5;
  struct Sums {
    double count = 0.0;
    double common_dps = 0.0;
    double apart_dps = 0.0;
  };
  [[nodiscard]] static RestBlock closed(const RestBlock& open,
                                        const std::array<Sums, kFifths>& fifths);
  RestBlock open_;  ///< holds sums, about the first pair
  std::array<double, 2> pivot_{};
  std::array<Sums, kFifths> fifths_{};
  std::vector<RestBlock> blocks_;
};

struct MotionSummary {
  static constexpr double kTurning_dps = 2.0;
  static constexpr double kRestMin_s = 30.0;

  bool at_rest = false;           ///< throughout
  double turned_up_to_dps = 0.0;  ///< fastest second, off the median
  std::optional<Stretch> rest;    ///< the longest, where it is at least kRestMin_s
};

/// `paired`: both gyros' rates at common instants.
MotionSummary find_motion(const std::array<Series, 2>& paired,
                          const std::array<double, 2>& step_dps = {});

/// How much of the difference y₁ − y₂ follows the rotation.
struct Mismatch {
  double scale = 0.0;  ///< per unit of rate: gyro 1 reads more, where positive
  double lag_s = 0.0;  ///< gyro 1 is ahead of gyro 2, where positive
};

struct Difference {
  Series series;
  std::optional<Mismatch> removed;  ///< by least squares, where the platform moved
};

Difference difference(const std::array<Series, 2>& paired, const MotionSummary& motion);

}  // namespace vgyro::analysis
