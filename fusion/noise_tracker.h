#pragma once

// The white noise of two gyros: N at the time scale of cells, which drift and heading feel, and the
// variance of single samples, which σ of a published rate contains. Known from the model file, or
// measured where the true rate is known. Elsewhere only a rise is followed, from the noise that the
// two gyros do not share.

#include <array>

#include "fusion/cells.h"
#include "fusion/gyro_parameters.h"
#include "fusion/quadratic.h"

namespace vgyro::fusion {

class NoiseTracker {
 public:
  /// A gyro with this much more noise variance than it had is reported.
  static constexpr double kNoisyFactor = 9.0;

  explicit NoiseTracker(const std::array<GyroParameters, 2>& gyros) : gyros_(gyros) {}

  /// Forgets all but the resolutions.
  void clear();
  /// A block whose true rate is constant: its cells differ by noise alone. With `moving` only what
  /// the gyros do not share counts as noise.
  void measure(const CellBlock& block, bool moving);
  /// Does the block scatter as its gyros usually do? Boarding passengers and running engines are
  /// not noise, even at a true stop.
  [[nodiscard]] bool usual(const CellBlock& block) const;
  /// Has a gyro sent a value or two that are no measurement? True if in some cell of the block the
  /// difference scatters more than noise and motion allow. `more` is additional variance of a
  /// sample's difference, (deg/s)².
  [[nodiscard]] bool spiked(const CellBlock& block, double more) const;
  /// A block whose true rate is unknown.
  void watch(const CellBlock& block);
  /// Forgets the present rise.
  void forget_rise();
  /// The smallest step that a gyro's values have shown.
  void set_resolution(std::size_t gyro, double step_dps) { step_dps_[gyro] = step_dps; }
  /// The rounding variance of a gyro's mean, (deg/s)²: noise that is small against the step does
  /// not average it out.
  [[nodiscard]] double rounding_variance(std::size_t gyro) const;
  /// Computes density() and sample_variance() from the measured blocks.
  void settle(double interval_s);
  void resume(const Symmetric& density, const std::array<double, 2>& sample_variance);

  /// N₁², ρN₁N₂, N₂², (deg/s)²/Hz, with the present rise.
  [[nodiscard]] const Symmetric& density() const { return present_density_; }
  /// Of one raw sample, (deg/s)², with the present rise.
  [[nodiscard]] const Symmetric& sample_variance() const { return present_sample_; }
  [[nodiscard]] bool noisy(std::size_t gyro) const { return noisy_[gyro]; }

  /// Without the present rise.
  [[nodiscard]] const Symmetric& usual_density() const { return density_; }
  [[nodiscard]] const Symmetric& usual_sample_variance() const { return sample_; }

 private:
  void apply_rise();

  [[nodiscard]] double step_dps(std::size_t gyro) const;

  std::array<GyroParameters, 2> gyros_;
  std::array<double, 2> step_dps_{};
  Symmetric cell_squares_{};  ///< Σ ½Δ²·length of neighbouring cells
  double cells_ = 0.0;
  Symmetric sample_squares_{};    ///< Σ of squares about the cells' means
  double samples_ = 0.0;          ///< degrees of freedom of these
  std::array<double, 2> gain_{};  ///< Σ samples · RatePair::noise_gain
  bool shared_is_motion_ = false;
  Symmetric density_{};
  Symmetric sample_{};
  std::array<double, 2> rise_{1.0, 1.0};
  std::array<bool, 2> noisy_{};
  Symmetric present_density_{};
  Symmetric present_sample_{};
};

}  // namespace vgyro::fusion
