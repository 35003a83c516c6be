#pragma once

// Where no DBC file says what the bytes of a message are: which of them move as a rate of rotation
// could, by trial of every place, 16, 24 and 32 bits, both byte orders, with and without sign, and
// floats. Fields that do not begin at a byte are found as far as their bytes hold nothing else that
// moves.

#include <vector>

#include "cli/init/traffic.h"
#include "dbc/database.h"

namespace vgyro::cli {

/// Signals with factor 1 and no unit, no two of which share a byte.
std::vector<dbc::Signal> find_fields(const Stream& stream);

/// Bytes and nibbles that count with every frame.
std::vector<dbc::Signal> find_counters(const Stream& stream);

/// Bytes of a message: of most of its frames.
std::size_t usual_length(const Stream& stream);

}  // namespace vgyro::cli
