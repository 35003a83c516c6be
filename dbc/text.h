#pragma once

// The bytes of a DBC file as one kind of text: UTF-8, lines ended by '\n', no byte order mark.
// Tools on Windows write cp1252 and CRLF; what is valid UTF-8 already is left as it is.

#include <string>
#include <string_view>

namespace vgyro::dbc {

bool is_utf8(std::string_view text);

std::string normalised(std::string_view text);

}  // namespace vgyro::dbc
