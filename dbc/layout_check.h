#pragma once

// Reports problems in the layout of one message: signals outside the frame, overlapping signals,
// scales that lose the value. Changes only a range in which no value can lie.

#include "dbc/contents.h"
#include "dbc/database.h"

namespace vgyro::dbc {

void check_layout(Message& message, Diagnostics& diagnostics);

}  // namespace vgyro::dbc
