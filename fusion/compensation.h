#pragma once

// Corrects one gyro's readings for the effects in the model file: model/equation.h inverted.
// Offsets are subtracted; the response is inverted: the result is the rate at which model and
// reading agree. An effect whose input is not known adds nothing, which is the same as an input at
// its reference. Noise, clipping and lost frames cannot be corrected; `delay` changes times,
// not rates, and is only reported here.

#include <span>

#include "base/time.h"
#include "model/effect.h"
#include "model/equation.h"

namespace vgyro::fusion {

/// Limit of Newton steps; a nearly linear response needs two or three.
inline constexpr int kInversionStepsMax = 12;

class Compensation {
 public:
  /// No effects: correct() returns the reading.
  Compensation() = default;
  /// `effects` of one gyro, of any kind.
  explicit Compensation(std::span<const model::Effect> effects);

  [[nodiscard]] bool takes_any() const { return equation_.adds(); }

  /// If the response has no inverse (a rate far outside the model's range), returns the reading
  /// less its offsets.
  [[nodiscard]] double correct(double reading_dps, const model::Surroundings& surroundings) const;

  /// The gyro's zero offset, for reports and for VG_Bias: all offsets except lines, which are too
  /// fast to be read, and the effect of other rotations.
  [[nodiscard]] double zero_offset_dps(const model::Surroundings& surroundings) const;

  /// A sample stamped t holds the rate at t − lag.
  [[nodiscard]] Duration lag() const { return lag_; }

 private:
  [[nodiscard]] double invert(double reading_dps, const model::Surroundings& surroundings) const;

  model::Equation equation_;
  model::Equation lasting_;  ///< the effects of the zero offset
  Duration lag_{0};
};

}  // namespace vgyro::fusion
