#pragma once

// For messages without a DBC file: finds bytes that could be a rate of rotation by trial of every
// place, with 16, 24 and 32 bits, both byte orders, with and without sign, and as floats. A field
// that does not begin at a byte is found if its bytes hold nothing else that changes.

#include <vector>

#include "cli/init/traffic.h"
#include "dbc/database.h"

namespace vgyro::cli {

/// Signals with factor 1 and no unit that share no byte.
std::vector<dbc::Signal> find_fields(const Stream& stream);

/// Bytes and nibbles that increment with every frame.
std::vector<dbc::Signal> find_counters(const Stream& stream);

/// The payload length of most frames.
std::size_t usual_length(const Stream& stream);

}  // namespace vgyro::cli
