#pragma once

// A log in memory, opened by its content and read whole, for the tests of the forms.

#include <string>

#include "tests/canlog/log_text.h"

namespace vgyro::canlog {

/// `error` also holds the error of opening.
ReadLog open_and_read(const std::string& bytes, std::size_t chunk = SIZE_MAX);
ReadLog read_whole(LogReader& reader);

/// The records as lines of a candump log, without ends of lines.
std::vector<std::string> as_candump(const ReadLog& log);

}  // namespace vgyro::canlog
