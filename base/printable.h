#pragma once

// Makes text of unknown origin (names in files, units in a DBC, bytes of a log) safe for a terminal
// or a journal: it cannot move the cursor, change colours or imitate another line. Harmless text is
// unchanged.

#include <string>
#include <string_view>

namespace vgyro {

/// One line: control characters including line ends, and bytes that are not UTF-8, become \xNN.
std::string printable(std::string_view text);

/// Several lines: like printable(), but keeps '\n'.
std::string printable_lines(std::string_view text);

}  // namespace vgyro
