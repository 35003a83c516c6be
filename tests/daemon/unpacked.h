#pragma once

// Unpacks a recording without the product's own reader.

#include <string>
#include <vector>

#include "daemon/capture_ring.h"

namespace vgyro::daemon {

/// The text in one or more concatenated xz streams. Fails the test if they are not whole.
std::string unpacked(const std::string& xz);

/// The text of consecutive blocks.
std::string unpacked(const CaptureRing::Blocks& blocks);

std::vector<std::string> lines_of(const std::string& text);

/// Frame number `number` of a test: its payload is a counter, and it comes a millisecond after the
/// frame before.
can::Frame numbered_frame(std::uint32_t number);
TimePoint numbered_stamp(std::uint32_t number);
/// Its line in a candump log, without the line's end.
std::string numbered_line(std::uint32_t number, const std::string& bus);

}  // namespace vgyro::daemon
