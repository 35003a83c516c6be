#pragma once

#include "gap/curve.h"

namespace vgyro::gap {

/// The curve less the white noise in it: frequencies count by how far they stand above the noise,
/// which is what the upper half of a stretch's spectrum holds, but no more than `noise_variance`:
/// that of one sample where nothing moves. Even steps of the median interval; phases are kept.
SampledCurve without_noise(const SampledCurve& curve, double noise_variance);

/// The curve with all that it holds, noise too, at the frequencies at which there is motion: where
/// the mean power of `judge`, which reads the same at the same instants, is that of white noise of
/// `least_variance` or more. Nothing at the others. What is read from it between two samples
/// scatters as it does at the samples.
SampledCurve where_it_moves(const SampledCurve& curve, const SampledCurve& judge,
                            double least_variance);

}  // namespace vgyro::gap
