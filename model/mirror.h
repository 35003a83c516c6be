#pragma once

// An effect as a gyro has it whose axis points the other way: what reads −Ω with the effect reads Ω
// with its mirror image. For a sensor that is mounted upside down the model file uses the
// sensor's own sign, and the pair of gyros uses the vehicle's.

#include "model/effect.h"

namespace vgyro::model {

/// Offsets and even responses change their sign; what is odd, late, clipped or random stays. Phases
/// come out within ±π. The mirror image of the mirror image is the effect.
[[nodiscard]] Effect mirrored(const Effect& effect);

}  // namespace vgyro::model
