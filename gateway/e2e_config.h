#pragma once

// The keys of a configuration table that define the E2E protection of its message: crc, e2e,
// data_id, counter, max_delta_counter, counter_max.

#include "base/toml_reader.h"
#include "gateway/plan.h"
#include "gateway/signal_resolver.h"

namespace vgyro::gateway {

/// `main` is the signal that the message is read for. Errors go to the reader; the part with an
/// error is left out.
E2ePlan read_e2e(TomlReader& reader, SignalResolver& resolver, const dbc::Signal& main);

/// Marks these keys as known where they are not read because of another error.
void forgive_e2e(TomlReader& reader);

}  // namespace vgyro::gateway
