#pragma once

// What gave an effect away, in one sentence for people.

#include <string>

#include "model/effect.h"

namespace vgyro::gap {

/// "the residual of a follows the rate: +0.002 of it, 63 standard errors". `name`: the gyro's;
/// `sigma`: 0 where nothing was estimated; `seconds`: of the recording.
std::string evidence_text(const model::Effect& effect, const model::Parameters& sigma,
                          const std::string& name, double seconds);

}  // namespace vgyro::gap
