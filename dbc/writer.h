#pragma once

// Writes messages and signals as the text of a DBC file: names, layouts, factors, ranges, units,
// comments, value labels and J1939 frame formats; not multiplexing, long names or receivers.

#include <string>
#include <vector>

#include "dbc/database.h"

namespace vgyro::dbc {

/// The text reads back unchanged (dbc/parser.h). Numbers are plain decimals, because some readers
/// drop signals whose factor has an exponent. Quotes in texts become apostrophes. Precondition:
/// names are C identifiers; no signal is multiplexed.
std::string to_text(const std::vector<Message>& messages, const std::string& comment);

}  // namespace vgyro::dbc
