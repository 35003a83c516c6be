#pragma once

// What moves between two samples. Motion near half the sampling rate and above it is in the
// readings, folded, and no interpolation gives it back: two streams that sample it at different
// instants differ by it. How much of it there is at a time, both streams show in their highest
// frequencies; how much of that the difference of the two keeps, the difference itself shows. It
// counts as noise that comes and goes with the motion, and where it is more than a little of the
// motion, the frequency is left out: what folds there moves with what should be there.

#include <vector>

#include <Eigen/Core>

#include "gap/curve.h"
#include "gap/noise.h"

namespace vgyro::gap {

/// Power of the motion in the highest third of the frequencies that two streams hold, over time.
class FastMotion {
 public:
  FastMotion() = default;
  /// What only one of them shows is its noise. Of streams of different pace the slower one tells,
  /// because it is the one that is interpolated or that folds more.
  FastMotion(const SampledCurve& a, const SampledCurve& b);

  /// (deg/s)²; 0 where there is none.
  [[nodiscard]] double power(double t_s) const;

 private:
  std::vector<double> power_;  ///< of cells from time 0 on
};

/// Of one sample where nothing moves, (deg/s)²: the quietest stretches' scatter from sample to
/// sample.
double quiet_variance(const SampledCurve& curve);

/// Learns what the motion between the samples does to blocks whose `motion_power` is known, and
/// sets what is kept of them. `columns` over the samples: what the known effects leave of the
/// observations, the rate, and its slope. What of a cosine follows these two is an effect or
/// folded motion that would pass for one; what does not is motion that was not seen.
void learn_unseen_motion(const Matrix& columns, Layout& layout);

}  // namespace vgyro::gap
