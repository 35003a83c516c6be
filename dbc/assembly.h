#pragma once

// The second half of reading a DBC file: attaches comments, labels, float types and multiplexing to
// the signals they refer to, regardless of their order in the file, and reports what does not fit.

#include <string>

#include "dbc/contents.h"
#include "dbc/database.h"

namespace vgyro::dbc {

Database assemble(Contents contents, std::string path);

}  // namespace vgyro::dbc
