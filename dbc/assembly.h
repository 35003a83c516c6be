#pragma once

// The second half of reading a DBC file: comments, labels, float types and multiplexing go to the
// signals they refer to, wherever in the file they stood, and what does not fit is reported.

#include <string>

#include "dbc/contents.h"
#include "dbc/database.h"

namespace vgyro::dbc {

Database assemble(Contents contents, std::string path);

}  // namespace vgyro::dbc
