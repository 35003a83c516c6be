#pragma once

// What is said of logs: their names in messages, and what in them was no frame.

#include <string>
#include <vector>

#include "canlog/record.h"

namespace vgyro::cli {

/// How messages name several logs: "a.log and 2 more".
std::string name_of(const std::vector<std::string>& logs);

/// "1 line", "2 lines"
std::string count_of(std::uint64_t count, std::string_view item);

/// ", 3 other lines, 4096 stray bytes" of what was passed over; empty where nothing was.
std::string passed_over_text(const canlog::LogCounts& counts);

/// Why a log without a frame is of no use, and what is.
inline constexpr const char* kNoFrame = "holds no CAN frame";
inline constexpr const char* kLogsRemedy =
    "a log as `candump -L` prints and `candump -l` writes it is needed, or another of "
    "docs/log-format.md";

}  // namespace vgyro::cli
