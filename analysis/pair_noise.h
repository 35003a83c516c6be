#pragma once

// The noise of each gyro in a recording, of their difference, and the correlation of their white
// noise. Each gyro is judged while the platform rested; the difference wherever there are pairs.

#include <array>
#include <optional>
#include <vector>

#include "analysis/allan.h"
#include "analysis/noise_fit.h"
#include "analysis/rest.h"
#include "analysis/series.h"

namespace vgyro::analysis {

struct PairRecording {
  std::array<Series, 2> own;         ///< each gyro's samples as received
  std::array<Series, 2> paired;      ///< both at common instants
  std::array<double, 2> step_dps{};  ///< between the values that a gyro can send; 0: unknown
  /// White-noise variance of the interpolated rates over that of raw samples; 1 without
  /// interpolation.
  double interpolation_gain = 1.0;
};

struct SeriesNoise {
  double interval_s = 0.0;
  double seconds = 0.0;
  std::size_t parts = 0;
  double filled_share = 0.0;
  double mean_dps = 0.0;
  std::vector<AllanPoint> allan;
  bool hidden_by_step = false;  ///< the step between its values hides this gyro's own noise
  std::optional<NoiseFit> fit;  ///< nothing if it contains motion, or the record is too short
};

struct Correlation {
  double value = 0.0;
  double sigma = 0.0;
};

struct PairNoise {
  MotionSummary motion;
  std::array<SeriesNoise, 2> gyros;  ///< over motion.rest; without one over all, no fit
  SeriesNoise difference;
  std::optional<Mismatch> removed;         ///< from the difference
  std::optional<Correlation> correlation;  ///< ρ of the white noise; needs rest, none hidden
  std::array<double, 2> step_dps{};        ///< step between each gyro's values: its resolution
};

PairNoise judge_pair(const PairRecording& recording);

}  // namespace vgyro::analysis
