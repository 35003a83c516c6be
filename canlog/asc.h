#pragma once

// Vector's ASC: text that CANoe, CANalyzer, CANape and many loggers write. Classic, FD, remote and
// error frames; other events are skipped. Stamps count from the date in the file's head, which is
// local time, or from zero without a date. docs/log-format.md has the details.

#include <memory>
#include <string_view>

#include "canlog/line_reader.h"

namespace vgyro::canlog {

bool is_asc_line(std::string_view line);

class AscReader final : public LineReader {
 public:
  explicit AscReader(std::unique_ptr<ByteSource> bytes) : LineReader(std::move(bytes)) {}

 private:
  Parsed parse(std::string_view line, LogRecord& record) override;
  Parsed parse_head(std::string_view line);
  Parsed parse_event(std::string_view line, LogRecord& record);
  /// Sets the zero of the stamps of the file, or of a block of it.
  void settle_zero(std::int64_t stamp_ns);

  int base_ = 16;
  bool relative_ = false;                 ///< each stamp counts from the one before it
  std::optional<std::int64_t> date_ns_;   ///< date in the file's head
  std::optional<std::int64_t> block_ns_;  ///< date of a block that has begun but has no stamp yet
  std::int64_t zero_ns_ = 0;
  std::int64_t now_ns_ = 0;  ///< since zero
};

}  // namespace vgyro::canlog
