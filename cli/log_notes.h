#pragma once

// Texts about logs: their names in messages, and the parts that were no frame.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "canlog/record.h"

namespace vgyro::cli {

/// The name of several logs in messages: "a.log and 2 more".
std::string name_of(const std::vector<std::string>& logs);

/// "1 line", "2 lines"
std::string count_of(std::uint64_t count, std::string_view item);

/// ", 3 other lines, 4096 stray bytes" for the parts that were skipped; empty if there are none.
std::string passed_over_text(const canlog::LogCounts& counts);

/// "a.log: 12 frames, 1 line not understood …" and the first of these lines, each on a line of its
/// own. `xl_used`: whether CAN XL frames are of use here.
std::string log_text(const std::string& path, const canlog::LogCounts& counts, bool xl_used);

/// Error and remedy for a log without a frame.
inline constexpr const char* kNoFrame = "holds no CAN frame";
inline constexpr const char* kLogsRemedy =
    "a log as `candump -L` prints and `candump -l` writes it is needed, or another of "
    "docs/log-format.md";

}  // namespace vgyro::cli
