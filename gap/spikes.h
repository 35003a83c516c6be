#pragma once

// Single samples that stand out from their neighbours: glitches of a sensor or of its bus. A sample
// is seen against the reference, or, where there is none, against the other gyro; then whichever of
// the two stands out further has the spike. That is told by what interpolation leaves of it in the
// other: gyros that sample at the very same instants show a spike alike. What both gyros show alike
// against a reference is the reference's. How far deviations reach without a spike is learnt from
// the recording: in each stretch, by where the sample falls between two of what it is seen against,
// and with a tail as long as theirs. What stands out for longer loses its edges at most, and is
// left to the regression.

#include <array>
#include <vector>

#include "gap/recording.h"
#include "gap/timing.h"
#include "gap/transport.h"
#include "model/effect.h"

namespace vgyro::gap {

/// Masks every spike of both gyros in `transports`. Returns what is beyond `known`, gyro 1's first.
/// Precondition: the transports are those of the recording.
std::vector<Finding> find_spikes(const Recording& recording, const Timing& timing,
                                 std::array<Transport, 2>& transports,
                                 const std::vector<model::Effect>& known);

}  // namespace vgyro::gap
