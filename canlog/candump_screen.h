#pragma once

// The output of candump on a screen: " (1700000000.123456)  can0  123   [8]  11 22 …", with the
// stamps of -ta, -tA, -td and -tz, and the additions of -x, -e, -d, -i, -S, -a and -c. Stamps of
// -td and -tz begin at zero.

#include <memory>
#include <string_view>

#include "canlog/byte_source.h"
#include "canlog/reader.h"

namespace vgyro::canlog {

bool is_candump_screen_line(std::string_view line);
Expected<std::unique_ptr<LogReader>> open_candump_screen(std::unique_ptr<ByteSource> bytes);

/// The same output without stamps, which is refused because it has no times.
bool is_stampless_screen_line(std::string_view line);
Expected<std::unique_ptr<LogReader>> refuse_stampless_screen(std::unique_ptr<ByteSource> bytes);

}  // namespace vgyro::canlog
