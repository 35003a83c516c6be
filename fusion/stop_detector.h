#pragma once

// Does the platform stand? Judged block by block (about half a second) from the gyros' own
// steadiness, and from the wheels where there are any. A stop is learned from only when what both
// gyros read lies within what their drift may have become: two gyros that moved together mean that
// the platform turns – a ferry, a turntable, a tow truck – and the stop is refused. A gate that
// refused for ever would lock itself out, so a level that comes back at several stops with real
// turns in between is believed after all: no platform turns like that.

#include <array>
#include <cstdint>

#include "fusion/corrector.h"

namespace vgyro::fusion {

/// One block as the detector sees it. A missing gyro has weight 0.
struct BlockLevel {
  double length_s = 0.0;
  double cells = 0.0;
  std::array<double, 2> excess_dps{};       ///< each gyro's mean less the true rate at a stop
  std::array<double, 2> excess_variance{};  ///< from the sensors' noise
  std::array<double, 2> bias_dps{};         ///< what is known of the drifts
  std::array<double, 2> weight{};           ///< in the virtual rate
  double doubt_variance = 0.0;              ///< of the weighted drift
  double cell_variance = 0.0;               ///< of the virtual rate's cells about their mean
  double noise_variance = 0.0;              ///< the same, as noise alone would have it
};

class StopDetector {
 public:
  static constexpr double kRun_s = 2.5;   ///< a stop is sure after this long
  static constexpr int kRunBlocks = 4;    ///< and so many blocks
  static constexpr double kGate = 3.0;    ///< standard deviations, for the level
  static constexpr double kSteady = 3.5;  ///< the same for steadiness from block to block
  /// Standing on its wheels a vehicle may sway by this much, rms.
  static constexpr double kSway_dps = 0.05;

  enum class Verdict : std::uint8_t {
    kMoving,
    kSteady,  ///< not long enough
    kStop,
    kRefused,  ///< steady, but the gyros have moved together
    kRelearn   ///< a stop; the drift is where it was thought impossible
  };

  Verdict judge(const BlockLevel& block, Wheels wheels);
  void reset() { end_run(); }

  /// The last block began a run of steady ones.
  [[nodiscard]] bool run_begins() const { return run_blocks_ == 1; }
  /// What sway adds to the variance of one block's mean. Valid after judge().
  [[nodiscard]] double sway_variance() const { return sway_variance_; }
  /// Mean of what both gyros read beyond their known drift, in the present run.
  [[nodiscard]] double run_level_dps() const { return run_level_; }

 private:
  struct Refusal {
    double level_dps = 0.0;
    double variance = 0.0;
    double turned_deg = 0.0;  ///< before it, since the refusal before
  };
  static constexpr std::size_t kRefusals = 2;  ///< remembered; one more makes the proof

  [[nodiscard]] bool steady(const BlockLevel& block, bool on_wheels);
  void end_run();
  [[nodiscard]] bool proven() const;

  bool wheels_distrusted_ = false;
  double sway_variance_ = 0.0;
  double run_s_ = 0.0;
  int run_blocks_ = 0;
  double run_level_ = 0.0;
  double run_variance_ = 0.0;       ///< of that mean, from noise
  std::array<double, 2> recent_{};  ///< excess of the last blocks
  bool run_refused_ = false;
  double turned_deg_ = 0.0;
  std::array<Refusal, kRefusals> refusals_;
  std::size_t refusal_count_ = 0;
};

}  // namespace vgyro::fusion
