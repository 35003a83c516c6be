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

/// Newton's steps at most; a response that is nearly straight needs two or three.
inline constexpr int kInversionStepsMax = 12;

class Compensation {
 public:
  /// Takes readings as they are.
  Compensation() = default;
  /// `effects` of one gyro, of any kind.
  explicit Compensation(std::span<const model::Effect> effects);

  [[nodiscard]] bool takes_any() const { return equation_.adds(); }

  /// Where the response has no inverse (a model far outside the rates it was made for), the reading
  /// less its offsets.
  [[nodiscard]] double correct(double reading_dps, const model::Surroundings& surroundings) const;

  /// The part that is the gyro's zero offset, for people and for VG_Bias: all offsets but lines,
  /// which are over before anybody has read them, and what comes of other rotations.
  [[nodiscard]] double zero_offset_dps(const model::Surroundings& surroundings) const;

  /// A sample stamped t is of the rate at t − lag.
  [[nodiscard]] Duration lag() const { return lag_; }

 private:
  [[nodiscard]] double invert(double reading_dps, const model::Surroundings& surroundings) const;

  model::Equation equation_;
  model::Equation lasting_;  ///< the zero offset's
  Duration lag_{0};
};

}  // namespace vgyro::fusion
