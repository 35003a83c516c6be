#pragma once

// Maximum-likelihood noise parameters of a rate (IEEE 952 terms) from the spectrum of its steps.
// The constant rate and a linear ramp are additional unknowns (restricted likelihood). A term is
// only reported if it makes the record so much likelier that the Bayesian information criterion
// accepts it; otherwise there is an upper bound. Not for lines, warm-up or motion: if the shapes do
// not describe the record, the fit reports that.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "analysis/allan.h"
#include "analysis/spectrum.h"

namespace vgyro::analysis {

struct Estimate {
  bool resolved = false;
  double value = 0.0;  ///< if resolved
  double sigma = 0.0;  ///< from the likelihood's curvature
  double below = 0.0;  ///< if not resolved: with 95 %, the true value is below this
};

/// Exponentially correlated drift.
struct Markov {
  double sigma_dps = 0.0;
  double tau_s = 0.0;
  /// K of the random walk that this drift equals over times much shorter than tau_s.
  [[nodiscard]] double walk_dps_rts() const;
  /// Allan variance.
  [[nodiscard]] double variance(double at_s) const;
};

struct NoiseFit {
  Estimate white_dps_rthz;    ///< N, angle random walk: Allan deviation N/√τ
  Estimate walk_dps_rts;      ///< K, rate random walk: K·√(τ/3)
  Estimate flicker_dps;       ///< B, bias instability: B·√(2 ln 2/π), at any τ
  Estimate quantisation_deg;  ///< Q, of the angle: √3·Q/τ
  /// Only if the drift is plainly no random walk; K is then a bound.
  std::optional<Markov> markov;
  double ramp_dps_s = 0.0;
  double ramp_sigma_dps_s = 0.0;
  double frequency_max_hz = 0.0;  ///< fitted up to here
  bool limited = false;   ///< above frequency_max_hz the spectrum is not the noise of these terms
  bool describes = true;  ///< false: not even the lowest part of the spectrum is their noise
  double worst_ratio = 1.0;  ///< of measured to modelled power in the worst octave
  double worst_hz = 0.0;     ///< middle of that octave

  /// Allan variance of one kind at averaging time tau_s; 0 if not resolved. Exponentially
  /// correlated drift counts as walk.
  [[nodiscard]] double variance(NoiseKind kind, double tau_s) const;
  /// Allan variance of all kinds, without the ramp.
  [[nodiscard]] double variance(double tau_s) const;
  [[nodiscard]] NoiseKind dominant(double tau_s) const;
  /// Magnitude of the ramp in units of its standard error.
  [[nodiscard]] double ramp_significance() const;
};

struct FitSettings {
  /// Share of the samples that was measured; the others carry no white noise.
  double measured_share = 1.0;
  /// Below 1: part of the white noise was interpolated, which lowered its variance to this. No
  /// quantisation is fitted to such a series, because it has the same shape with the opposite sign.
  double interpolation_gain = 1.0;
  double interval_s = 1.0;  ///< of the samples
};

/// Nothing if there are fewer than kCoefficientsMin coefficients, or no noise at all.
inline constexpr double kCoefficientsMin = 100.0;
std::optional<NoiseFit> fit_noise(const std::vector<PowerBin>& bins, const FitSettings& settings);

}  // namespace vgyro::analysis
