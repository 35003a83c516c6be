#pragma once

// Who wants to see what the pipeline makes before it becomes frames, and as it goes out.

#include <array>

#include "base/time.h"
#include "fusion/corrector.h"
#include "gateway/output_frames.h"

namespace vgyro::gateway {

/// For those who draw or add up: every virtual rate with what it was made of, before it becomes a
/// frame, also where it is beyond what the frame can carry. NaN stands for a missing gyro, and for
/// a rate that is not known yet.
class RateObserver {
 public:
  virtual ~RateObserver() = default;
  virtual void on_rate(TimePoint t, const std::array<double, 2>& raw_dps, double virtual_dps) = 0;
  /// What the corrector thinks of its data, at every rate once it is calibrated; before on_rate().
  virtual void on_condition(TimePoint /*t*/, const fusion::Condition& /*condition*/) {}
};

/// For those who write down what goes out: every VG_Rate as it was sent.
class OutputObserver {
 public:
  virtual ~OutputObserver() = default;
  /// `bias_dps` as VG_Bias would say it at this moment; NaN where it is not known.
  virtual void on_output(const RateOutput& output, const std::array<double, 2>& bias_dps) = 0;
};

}  // namespace vgyro::gateway
