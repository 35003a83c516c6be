#pragma once

#include "gap/curve.h"

namespace vgyro::gap {

/// The curve less the white noise in it: frequencies count by how far they stand above the noise,
/// which is what the upper half of the spectrum holds. Even steps of the median interval; phases
/// are kept.
SampledCurve without_noise(const SampledCurve& curve);

}  // namespace vgyro::gap
