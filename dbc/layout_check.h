#pragma once

// What a careful reader would ask the author of a DBC file about one message: signals outside of
// the frame, signals on top of each other, scales that lose the value. Reports; changes only a
// range of values that no value can lie in.

#include "dbc/contents.h"
#include "dbc/database.h"

namespace vgyro::dbc {

void check_layout(Message& message, Diagnostics& diagnostics);

}  // namespace vgyro::dbc
