#pragma once

// Logs in memory, read whole, for tests of reader and writer; random frames and lines.

#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "canlog/candump.h"

namespace vgyro::canlog {

/// A record with the name of its interface, and its XL frame if it has one.
struct ReadRecord {
  std::int64_t stamp_ns = 0;
  std::string interface;
  int fraction_digits = 0;
  Direction direction = Direction::kUnknown;
  can::Frame frame;
  std::vector<XlFrame> xl;  ///< one entry for an XL frame, else empty: it is large

  friend bool operator==(const ReadRecord& a, const ReadRecord& b);
  friend std::ostream& operator<<(std::ostream& out, const ReadRecord& record);
};

bool operator==(const XlFrame& a, const XlFrame& b);

struct ReadLog {
  std::vector<ReadRecord> records;
  LogCounts counts;
  std::vector<std::string> interfaces;
  std::string error;
};

ReadLog read_all(std::unique_ptr<LogSource> source);
ReadLog read_text(const std::string& text, std::size_t chunk = SIZE_MAX);
/// The same by parse_line() alone, without the fast path.
ReadLog read_by_parse_line(const std::string& text);

/// "line: why" of the first malformed lines.
std::vector<std::string> malformed(const LogCounts& counts);
/// All members of LogCounts as text, for comparisons.
std::string told(const LogCounts& counts);

can::Frame frame_with(std::uint32_t id, unsigned flags, std::vector<std::uint8_t> bytes = {});
/// A frame of any form that the writer supports.
can::Frame random_frame(std::mt19937_64& random);
XlFrame random_xl_frame(std::mt19937_64& random);

}  // namespace vgyro::canlog
