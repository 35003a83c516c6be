#pragma once

// Converts the bytes of a DBC file to UTF-8 with lines ended by '\n' and no byte order mark. Tools
// on Windows write cp1252 and CRLF; text that is valid UTF-8 already is left unchanged.

#include <string>
#include <string_view>

namespace vgyro::dbc {

bool is_utf8(std::string_view text);

std::string normalised(std::string_view text);

}  // namespace vgyro::dbc
