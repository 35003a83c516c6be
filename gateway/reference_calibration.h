#pragma once

// Calibration against [reference]: pairs wait in a bounded queue until the reference has a sample
// on both sides of them, and are then calibrated against its linear interpolation.

#include <array>
#include <cstddef>
#include <optional>

#include "base/time.h"
#include "fusion/alignment.h"

namespace vgyro::gateway {

class ReferenceCalibration {
 public:
  static constexpr std::size_t kPendingMax = 1024;
  /// Reference samples further apart than this are not interpolated.
  static constexpr Duration kGapMax = std::chrono::seconds(1);

  struct Ready {
    fusion::AlignedPair pair;
    double true_rate_dps = 0.0;
  };

  void add_pair(const fusion::AlignedPair& pair);
  void add_reference(TimePoint t, double rate_dps);
  /// The next pair that the reference covers. Skips pairs that it will never cover.
  std::optional<Ready> next();

 private:
  std::array<fusion::AlignedPair, kPendingMax> pending_;
  std::size_t head_ = 0;
  std::size_t size_ = 0;
  struct ReferenceSample {
    TimePoint t;
    double rate_dps = 0.0;
  };
  std::optional<ReferenceSample> before_;
  std::optional<ReferenceSample> newest_;
};

}  // namespace vgyro::gateway
