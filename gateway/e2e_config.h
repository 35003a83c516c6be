#pragma once

// The keys of a table of the configuration that say how its message proves itself: crc, e2e,
// data_id, counter, max_delta_counter, counter_max.

#include "base/toml_reader.h"
#include "gateway/plan.h"
#include "gateway/signal_resolver.h"

namespace vgyro::gateway {

/// `main` is the signal that the message is read for. Complaints go to the reader; what they are of
/// is left out.
E2ePlan read_e2e(TomlReader& reader, SignalResolver& resolver, const dbc::Signal& main);

/// These keys are not read after another error.
void forgive_e2e(TomlReader& reader);

}  // namespace vgyro::gateway
