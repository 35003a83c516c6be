#pragma once

// The seam between the pipeline and a correction method: aligned pairs in, virtual rate out.
// Times are seconds on one monotone axis, rates deg/s. After construction nothing is allocated.
// A method knows no frames, no stamps and no states; the pipeline decides when it is asked.

#include <array>
#include <cstdint>
#include <memory>

#include "fusion/calibration.h"

namespace vgyro::fusion {

struct RatePair {
  double t_s = 0.0;
  std::array<double, 2> rate_dps{};
};

struct VirtualRate {
  double rate_dps = 0.0;
  double sigma_dps = 0.0;                 ///< NaN where the method makes no statement
  std::array<double, 2> corrected_dps{};  ///< each gyro less its own drift
};

struct Drift {
  std::array<double, 2> bias_dps{};  ///< NaN where the method has none
  double slope_dps_s = 0.0;          ///< of the drift that is taken off the virtual rate; NaN
  double bias_sigma_dps = 0.0;       ///< NaN where the method makes no statement
  double slope_sigma_dps_s = 0.0;    ///< NaN likewise
};

struct WindowCounts {
  std::uint64_t completed = 0;
  std::uint64_t skipped = 0;  ///< too few pairs: the drift was held
};

class Corrector {
 public:
  virtual ~Corrector() = default;

  [[nodiscard]] virtual bool needs_calibration() const = 0;
  /// Must be called once before the other calls where needs_calibration().
  virtual void start(const Calibration& calibration) = 0;
  /// The next pair; t_s grows from call to call.
  virtual VirtualRate update(const RatePair& pair) = 0;
  /// One gyro alone, its drift as last known.
  [[nodiscard]] virtual VirtualRate carry_on(std::size_t gyro, double t_s,
                                             double rate_dps) const = 0;
  [[nodiscard]] virtual Drift drift(double t_s) const = 0;
  [[nodiscard]] virtual WindowCounts windows() const = 0;
};

/// ½(y₁ + y₂) as it comes: the rival that every method must beat.
std::unique_ptr<Corrector> make_mean_corrector();

/// The paper's mutual calibration. order 0…kOrderMax, window_s > 0.
std::unique_ptr<Corrector> make_mutual_corrector(int order, double window_s);

}  // namespace vgyro::fusion
