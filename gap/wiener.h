#pragma once

#include "gap/curve.h"

namespace vgyro::gap {

/// The curve less the white noise in it: frequencies count by how far they stand above the noise,
/// which is what the upper half of a stretch's spectrum holds, but no more than `noise_variance`:
/// that of one sample where nothing moves. Even steps of the median interval; phases are kept.
SampledCurve without_noise(const SampledCurve& curve, double noise_variance);

}  // namespace vgyro::gap
