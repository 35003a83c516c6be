#pragma once

// A pool as one line of an evidence file: read here, without trust; written by pool_text() of
// cli/fleet/evidence_file.h.

#include "cli/fleet/json_reader.h"
#include "fleet/pool.h"

namespace vgyro::cli {

/// Throws Fault.
fleet::Pool pool_of(JsonValue json);

}  // namespace vgyro::cli
