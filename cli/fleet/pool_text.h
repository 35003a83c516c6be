#pragma once

// Reads a pool from one line of an evidence file, which is not trusted. pool_text() of
// cli/fleet/evidence_file.h writes it.

#include "cli/fleet/json_reader.h"
#include "fleet/pool.h"

namespace vgyro::cli {

/// Throws Fault.
fleet::Pool pool_of(JsonValue json);

}  // namespace vgyro::cli
