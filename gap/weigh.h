#pragma once

// A study and what was found in it → the evidence of the recording. The noise is fitted once more
// to the whole recording beside all that was found, so that a large effect does not make the
// recording look noisy; then every shape is asked as if none of them were known.

#include <vector>

#include "gap/drive_evidence.h"
#include "gap/found.h"
#include "gap/study.h"

namespace vgyro::gap {

/// `known`: the model's effects and the findings of the raw frames. `found`: all else, with the
/// starting model.
DriveEvidence weigh(const Study& study, const Effects& known, const std::vector<Found>& found);

}  // namespace vgyro::gap
