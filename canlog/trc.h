#pragma once

// PEAK's TRC, versions 1.0 to 2.1, which PCAN-View and PEAK's loggers write. Stamps count from
// $STARTTIME, which is local time, or from zero if a file (version 1.0) has none.

#include <array>
#include <memory>
#include <string_view>

#include "canlog/line_reader.h"

namespace vgyro::canlog {

bool is_trc_line(std::string_view line);

class TrcReader final : public LineReader {
 public:
  explicit TrcReader(std::unique_ptr<ByteSource> bytes) : LineReader(std::move(bytes)) {}

  /// The columns of one line, named by $COLUMNS or by the version; empty if the line has none.
  struct Columns {
    std::string_view time;       ///< "O", ms
    std::string_view type;       ///< "T"; in 1.x the direction, or the kind of message
    std::string_view bus;        ///< "B"
    std::string_view id;         ///< "I"
    std::string_view direction;  ///< "d"
    std::string_view dlc;        ///< "L"
    std::string_view length;     ///< "l"
    std::string_view data;       ///< "D": the rest of the line
  };

 private:
  Parsed parse(std::string_view line, LogRecord& record) override;
  Parsed parse_head(std::string_view line);

  unsigned version_ = 100;  ///< 100 · major + minor
  static constexpr std::size_t kColumnsMax = 16;
  std::array<char, kColumnsMax> columns_{};  ///< letters, for version 2
  std::int64_t zero_ns_ = 0;
};

}  // namespace vgyro::canlog
