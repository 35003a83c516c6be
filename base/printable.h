#pragma once

// Text of unknown origin (names in files, units in a DBC, bytes of a log) for a terminal or a
// journal: nothing in it can move the cursor, change colours or pretend to be another line. Text
// that is fine comes back as it was.

#include <string>
#include <string_view>

namespace vgyro {

/// One line: control characters, ends of lines too, and bytes that are no UTF-8 become \xNN.
std::string printable(std::string_view text);

/// Several lines: '\n' stays.
std::string printable_lines(std::string_view text);

}  // namespace vgyro
