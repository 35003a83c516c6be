#pragma once

// The text of can-utils' candump log, "(SECONDS.FRACTION) IFNAME FRAME[ R| T]", both ways: classic,
// remote, raw DLC, error, FD and XL frames. A line that is none of these is counted with its cause
// and line number, and never stops the reading. What the forms mean is told in docs/log-format.md.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "can/frame.h"
#include "can/log_source.h"

namespace vgyro::can {

inline constexpr std::size_t kXlBytesMax = 2048;

/// CAN XL: read and written so that no log loses lines; nothing in the product uses it.
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
  BusIndex bus = 0;                  ///< into InterfaceTable
  std::uint8_t fraction_digits = 6;  ///< as the line had them
  Direction direction = Direction::kUnknown;
  bool is_xl = false;  ///< then `frame` is empty and LogReader::xl() holds the frame
  Frame frame;
};

/// The interface names of a log, in order of appearance. Bounded.
class InterfaceTable {
 public:
  static constexpr std::size_t kMax = 64;
  /// Adds the name when new; nothing when the table is full.
  std::optional<BusIndex> index_of(std::string_view name);
  [[nodiscard]] const std::string& name(BusIndex bus) const { return names_[bus]; }
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }

 private:
  std::vector<std::string> names_;
};

enum class LineKind : std::uint8_t {
  kFrame,
  kXl,
  kOther,     ///< does not begin with "(": DROPCOUNT, comments, blank lines; players ignore it too
  kMalformed  ///< begins like a frame and is none
};

struct LineResult {
  LineKind kind = LineKind::kOther;
  const char* why = "";  ///< of a malformed line
};

/// Parses one line (without its newline). Every form, no assumption about widths.
LineResult parse_line(std::string_view line, InterfaceTable& interfaces, LogRecord& record,
                      XlFrame& xl);

struct MalformedLine {
  std::uint64_t line = 0;  ///< 1-based
  std::string why;
};

struct LogCounts {
  std::uint64_t lines = 0;
  std::uint64_t frames = 0;
  std::uint64_t xl_frames = 0;
  std::uint64_t other_lines = 0;
  std::uint64_t malformed_lines = 0;
  std::uint64_t cut_off_lines = 0;  ///< the log ends inside a line: its frame is not used
  std::vector<MalformedLine> first_malformed;  ///< at most kFirstMalformedMax
  static constexpr std::size_t kFirstMalformedMax = 5;
};

/// Records of a log, one after the other. No copy and no allocation per line.
class LogReader {
 public:
  explicit LogReader(std::unique_ptr<LogSource> source);

  /// False at the end of the log, or where it can be read no further: see error().
  bool next(LogRecord& record);

  [[nodiscard]] const LogCounts& counts() const { return counts_; }
  [[nodiscard]] const InterfaceTable& interfaces() const { return interfaces_; }
  [[nodiscard]] const XlFrame& xl() const { return *xl_; }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  struct KnownInterface {
    std::uint64_t word = 0;  ///< name and the blank behind it, first byte lowest
    std::uint64_t mask = 0;
    std::uint8_t length = 0;
    BusIndex bus = 0;
  };

  const char* parse_usual(const char* p, LogRecord& record);
  const KnownInterface* known_interface(std::uint64_t word) const;
  void remember_interface(BusIndex bus);
  bool refill();
  void count_malformed(const char* why);

  std::unique_ptr<LogSource> source_;
  const char* at_ = nullptr;
  const char* end_ = nullptr;
  std::uint64_t seconds_text_[2] = {0x3030303030303030U, 0x3030303030303030U};  ///< "0000000000"
  std::int64_t seconds_ns_ = 0;
  std::array<KnownInterface, 4> known_{};
  std::size_t known_count_ = 0;
  InterfaceTable interfaces_;
  std::unique_ptr<XlFrame> xl_;
  LogCounts counts_;
  std::optional<Error> error_;
};

/// Longest text of a line that format_line writes, newline included.
inline constexpr std::size_t kLineBytesMax = 200;

/// Writes one line with its newline to `out`, which has room for kLineBytesMax; returns its length.
/// `fraction_digits` is 6 or 9; 6 truncates.
std::size_t format_line(char* out, TimePoint stamp, std::string_view interface, const Frame& frame,
                        unsigned fraction_digits, Direction direction = Direction::kUnknown);

/// Many lines for one interface: remembers the text that stays the same from line to line.
class LineFormatter {
 public:
  explicit LineFormatter(std::string interface) : interface_(std::move(interface)) {}
  /// As format_line().
  std::size_t format(char* out, TimePoint stamp, const Frame& frame, unsigned fraction_digits);

 private:
  std::string interface_;
  std::int64_t second_ns_ = -1;    ///< start of the second that prefix_ shows
  std::array<char, 16> prefix_{};  ///< "(SSSSSSSSSS."
};

std::string format_xl_line(TimePoint stamp, std::string_view interface, const XlFrame& frame,
                           unsigned fraction_digits, Direction direction = Direction::kUnknown);

}  // namespace vgyro::can
