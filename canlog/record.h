#pragma once

// The result of reading a log of any form: a frame with its stamp and bus, and counts.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "can/frame.h"

namespace vgyro::canlog {

inline constexpr std::size_t kXlBytesMax = 2048;

/// CAN XL: read and written so that no log loses lines; the product does not use it otherwise.
struct XlFrame {
  std::uint16_t priority = 0;  ///< 11 bits
  std::uint8_t vcid = 0;
  std::uint8_t flags = 0;
  std::uint8_t sdt = 0;
  std::uint32_t acceptance = 0;
  std::uint16_t length = 0;
  std::array<std::uint8_t, kXlBytesMax> data{};
};

enum class Direction : std::uint8_t { kUnknown, kReceived, kTransmitted };

struct LogRecord {
  TimePoint stamp;
  can::BusIndex bus = 0;             ///< index in InterfaceTable
  std::uint8_t fraction_digits = 6;  ///< as in the log: usually 6 or 9
  Direction direction = Direction::kUnknown;
  bool is_xl = false;  ///< then `frame` is empty and LogReader::xl_frame() holds the frame
  can::Frame frame;
};

/// The interface names of a log, in order of appearance. Bounded.
class InterfaceTable {
 public:
  static constexpr std::size_t kMax = 64;
  /// Adds the name if it is new; nothing if the table is full.
  std::optional<can::BusIndex> index_of(std::string_view name);
  [[nodiscard]] const std::string& name(can::BusIndex bus) const { return names_[bus]; }
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }

 private:
  std::vector<std::string> names_;
};

struct MalformedLine {
  std::uint64_t line = 0;  ///< 1-based; counts LogCounts::item, which may not be a line
  std::string why;
};

/// Text forms consist of lines; in binary forms, `item` takes the place of a line.
struct LogCounts {
  std::string_view item = "line";  ///< what `lines` counts: "line", "object", "packet", "record" …
  std::uint64_t lines = 0;
  std::uint64_t frames = 0;
  std::uint64_t xl_frames = 0;
  std::uint64_t other_lines = 0;
  std::uint64_t malformed_lines = 0;
  std::uint64_t cut_off_lines = 0;  ///< the log ends inside a line: its frame is not used
  std::uint64_t skipped_bytes = 0;  ///< bytes that belong to no line, such as NULs after a power
                                    ///< cut
  std::vector<MalformedLine> first_malformed;  ///< at most kFirstMalformedMax
  static constexpr std::size_t kFirstMalformedMax = 5;

  /// Records an error in the item that `lines` counted last.
  void add_malformed(const char* why) {
    ++malformed_lines;
    if (first_malformed.size() < kFirstMalformedMax) first_malformed.push_back({lines, why});
  }
};

}  // namespace vgyro::canlog
