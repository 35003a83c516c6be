#pragma once

// The words of `vgyro gap --accept`.

#include <string>

#include "base/error.h"
#include "gap/acceptance.h"

namespace vgyro::cli {

/// "gyro=2", "kind=delay", "gyro=1,kind=delay", or "likeliest". Error: what is wrong with the word,
/// and what would be right.
Expected<gap::Acceptance> acceptance_from(const std::string& word);

}  // namespace vgyro::cli
