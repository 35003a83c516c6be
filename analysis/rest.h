#pragma once

// Was the platform still, and when? `vgyro allan`, `vgyro gap` and `vgyro init` share this
// definition of rest. Noise and drift belong to each gyro alone, motion to both: at rest the mean
// of the two rates varies like half their difference, in motion far more. Rest is judged by both
// gyros, by steadiness alone, and against the gyros' own noise: no quiet second of a hover passes.
// A later rest is recognized by the readings of the last rest, not of the first, because drift
// continues. A steady turn cannot be distinguished from two equal biases, so a common rate beyond
// kTurning_dps counts as turning.

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

/// A part of a rest without a hole.
struct RestPart {
  Stretch stretch;
  std::size_t rest = 0;  ///< number of the rest, the same for all of its parts
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
    /// Motion that only the finer gyro feels counts too: for callers that take each gyro's reading
    /// at rest as its error.
    bool by_each_alone = false;
  };
  explicit RestFinder(const Settings& settings);

  void add(double t_s, const std::array<double, 2>& rate_dps);

  /// The rests in whole blocks, without the edges of motions. To be called once.
  std::vector<RestPart> find();
  /// Blocks with enough pairs; valid after find().
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
  double turned_up_to_dps = 0.0;  ///< fastest second, relative to the median
  std::optional<Stretch> rest;    ///< the longest, if it has at least kRestMin_s
};

/// `paired`: both gyros' rates at common instants.
MotionSummary find_motion(const std::array<Series, 2>& paired,
                          const std::array<double, 2>& step_dps = {});

/// The part of the difference y₁ − y₂ that follows the rotation.
struct Mismatch {
  double scale = 0.0;  ///< per unit of rate; positive: gyro 1 reads more
  double lag_s = 0.0;  ///< positive: gyro 1 is ahead of gyro 2
};

struct Difference {
  Series series;
  std::optional<Mismatch> removed;  ///< by least squares, if the platform moved
};

Difference difference(const std::array<Series, 2>& paired, const MotionSummary& motion);

}  // namespace vgyro::analysis
