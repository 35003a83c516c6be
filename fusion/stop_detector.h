#pragma once

// Is the platform steady: standing, or turning at a constant rate? Judged block by block (about
// half a second) from how the gyros' cells scatter, whether their means stay where they were, and
// from the wheels if there are any. StopDetector finds only that nothing changes, and how strongly
// wheels and time indicate a turn; readings.h weighs stop against turn.

#include <array>
#include <cstdint>

#include "fusion/corrector.h"

namespace vgyro::fusion {

/// One block, as input of the detector. A missing gyro has weight 0.
struct BlockLevel {
  double length_s = 0.0;
  double cells = 0.0;
  std::array<double, 2> excess_dps{};       ///< each gyro's mean less the true rate at a stop
  std::array<double, 2> excess_variance{};  ///< from the sensors' noise
  std::array<double, 2> bias_dps{};         ///< estimated drifts
  std::array<double, 2> weight{};           ///< in the virtual rate
  double doubt_variance = 0.0;              ///< of the weighted drift
  double cell_variance = 0.0;               ///< of the virtual rate's cells about their mean
  double noise_variance = 0.0;              ///< the same, from noise alone
};

class StopDetector {
 public:
  static constexpr double kRun_s = 2.5;   ///< steady for this long
  static constexpr int kRunBlocks = 4;    ///< and so many blocks
  static constexpr double kSteady = 3.5;  ///< standard deviations, from block to block
  /// A standing vehicle may sway by this much, rms.
  static constexpr double kSway_dps = 0.05;

  enum class Steadiness : std::uint8_t {
    kMoving,
    kUnsure,  ///< steady, but not for long enough
    kSteady
  };

  /// `moves_elsewhere`: the platform moves about another axis.
  Steadiness judge(const BlockLevel& block, Wheels wheels, bool moves_elsewhere = false);
  /// This axis moved in the last block, independent of other axes and wheels.
  [[nodiscard]] bool moves() const { return moves_; }
  void reset() { end_run(); }

  /// The last block began a run of steady ones.
  [[nodiscard]] bool run_begins() const { return run_blocks_ == 1; }
  /// Variance that sway adds to one block's mean. Valid after judge().
  [[nodiscard]] double sway_variance() const { return sway_variance_; }
  /// Log odds of a steady turn against a stop at the beginning of a run.
  [[nodiscard]] double log_turning(Wheels wheels) const;
  /// Change of these log odds in the last `length_s` seconds of the present run: turns end sooner
  /// than stops.
  [[nodiscard]] double log_turning_gain(Wheels wheels, double length_s) const;
  /// The platform has moved on since the last run: it turned, rolled, or moved for long.
  [[nodiscard]] bool moved_on() const { return moved_on_; }
  /// A run has ended: motion since it counts from 0.
  void stay() {
    moved_on_ = false;
    turned_deg_ = 0.0;
    moving_s_ = 0.0;
  }
  /// The wheels stood while the platform turned, and have not rolled since.
  [[nodiscard]] bool wheels_distrusted() const { return wheels_distrusted_; }

 private:
  [[nodiscard]] bool steady(const BlockLevel& block, bool on_wheels);
  void end_run();
  void note_motion(double level_dps, double length_s, bool rolls);

  bool wheels_distrusted_ = false;
  bool moves_ = false;
  double sway_variance_ = 0.0;
  double run_s_ = 0.0;
  int run_blocks_ = 0;
  std::array<double, 2> recent_{};  ///< excess of the last blocks
  double turned_deg_ = 0.0;         ///< since the last run
  double moving_s_ = 0.0;           ///< the same
  bool moved_on_ = true;
};

}  // namespace vgyro::fusion
