#pragma once

// A recording of two gyros → the noise of each, of their difference, and how far their white noises
// agree. Each gyro is judged where the platform rested; the difference wherever there are pairs.

#include <array>
#include <optional>
#include <vector>

#include "analysis/allan.h"
#include "analysis/noise_fit.h"
#include "analysis/rest.h"
#include "analysis/series.h"

namespace vgyro::analysis {

struct PairRecording {
  std::array<Series, 2> own;         ///< each gyro's samples as they came
  std::array<Series, 2> paired;      ///< both at common instants
  std::array<double, 2> step_dps{};  ///< between the values that a gyro can send; 0: unknown
  /// White-noise variance of the interpolated rates over that of raw samples, 1 without.
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
  std::optional<NoiseFit> fit;  ///< nothing where motion is in it, or the record is too short
};

struct Correlation {
  double value = 0.0;
  double sigma = 0.0;
};

struct PairNoise {
  MotionSummary motion;
  std::array<SeriesNoise, 2> gyros;  ///< over motion.rest; without one over everything, no fit
  SeriesNoise difference;
  std::optional<Mismatch> removed;         ///< from the difference
  std::optional<Correlation> correlation;  ///< ρ of the white noises; needs rest, none hidden
  std::array<double, 2> step_dps{};        ///< between its values: the resolution of each gyro
};

PairNoise judge_pair(const PairRecording& recording);

}  // namespace vgyro::analysis
