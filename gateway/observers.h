#pragma once

// Interfaces to observe the pipeline's results before they become frames, and as they are sent.

#include <array>

#include "base/time.h"
#include "fusion/corrector.h"
#include "gateway/output_frames.h"

namespace vgyro::gateway {

/// For plots and statistics: every virtual rate with the gyros' rates it was made of, before it
/// becomes a frame, even if the frame cannot carry it. NaN stands for a missing gyro, and for a
/// rate that is not known yet.
class RateObserver {
 public:
  virtual ~RateObserver() = default;
  virtual void on_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) = 0;
  /// The corrector's findings, at every rate once it is calibrated; called before on_rate().
  virtual void on_condition(TimePoint /*t*/, const fusion::Condition& /*condition*/) {}
};

/// For logs of the output: every VG_Rate as it was sent.
class OutputObserver {
 public:
  virtual ~OutputObserver() = default;
  /// `bias_dps` as VG_Bias would carry it at this moment; NaN where unknown.
  virtual void on_output(const RateOutput& output, const std::array<double, 2>& bias_dps) = 0;
};

}  // namespace vgyro::gateway
