#pragma once

// The same effect for a gyro whose axis points the other way: a gyro that reads −Ω with the effect
// reads Ω with its mirror image. For a sensor that is mounted upside down the model file uses the
// sensor's own sign, and the pair of gyros uses the vehicle's.

#include "model/effect.h"

namespace vgyro::model {

/// Offsets and even responses change their sign; odd, late, clipping and random effects do not.
/// Phases are within ±π. Mirroring twice gives the effect itself.
[[nodiscard]] Effect mirrored(const Effect& effect);

}  // namespace vgyro::model
