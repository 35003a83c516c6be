#pragma once

// Sine transform of a rate's steps. White noise and random walk make steps whose covariance is
// tridiagonal; the sine transform turns it into independent coefficients of known variance, exactly
// and without a taper, where a periodogram would leak. The steps do not contain the constant rate,
// and a ramp is a known vector whose size the fit treats as one more unknown.

#include <cstddef>
#include <span>
#include <vector>

#include "analysis/series.h"

namespace vgyro::analysis {

/// Neighbouring coefficients, few enough to have the same expected power.
struct PowerBin {
  double frequency_hz = 0.0;
  double interval_s = 0.0;    ///< interval between the values whose steps were transformed
  double step_gain = 0.0;     ///< 4 sin²(π f interval): power of a step over power of the rate
  double half_periods = 0.0;  ///< half periods of the coefficient's sine in the record
  double count = 0.0;         ///< coefficients
  double power = 0.0;         ///< Σ z²
  double ramp_power = 0.0;    ///< Σ h², h: coefficient of a ramp of 1 deg/s per s
  double cross = 0.0;         ///< Σ z h
};

/// A record of more than a quarter of a million samples is transformed twice: in pieces at the full
/// rate for the high frequencies, as means of many samples for the low ones. No frequency counts
/// twice.
std::vector<PowerBin> step_spectrum(const Series& series);

/// Coefficients of the steps between `values`, at frequencies (index + 1) / (2 n interval); one
/// fewer than values. Precondition: n, the number of values, is 5-smooth and at least 4.
std::vector<double> step_sine_transform(std::span<const double> values);

/// The largest number not above n whose only prime factors are 2, 3 and 5.
std::size_t smooth_size(std::size_t n);

}  // namespace vgyro::analysis
