#pragma once

// The text of can-utils' candump log, "(SECONDS.FRACTION) IFNAME FRAME[ R| T]", both ways: classic,
// remote, raw DLC, error, FD and XL frames. Any other line is counted with its cause and line
// number and never stops the reading. docs/log-format.md explains the forms.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "can/frame.h"
#include "canlog/log_source.h"
#include "canlog/reader.h"
#include "canlog/record.h"

namespace vgyro::canlog {

enum class LineKind : std::uint8_t {
  kFrame,
  kXl,
  kOther,     ///< does not begin with "(": DROPCOUNT, comments, blank lines; players ignore it too
  kMalformed  ///< begins like a frame but is not one
};

struct LineResult {
  LineKind kind = LineKind::kOther;
  const char* why = "";  ///< for a malformed line
};

/// Parses one line (without its newline) of any form, with no assumption about widths.
LineResult parse_line(std::string_view line, InterfaceTable& interfaces, LogRecord& record,
                      XlFrame& xl);

/// Neither copies nor allocates per line.
class CandumpReader final : public LogReader {
 public:
  explicit CandumpReader(std::unique_ptr<LogSource> source);

  bool next(LogRecord& record) override;
  std::size_t next_batch(std::span<LogRecord> room) override;

  [[nodiscard]] const LogCounts& counts() const override { return counts_; }
  [[nodiscard]] const InterfaceTable& interfaces() const override { return interfaces_; }
  [[nodiscard]] const std::optional<Error>& error() const override { return blocks_.error(); }
  [[nodiscard]] std::uint64_t bytes_read() const override { return blocks_.bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return blocks_.bytes_total(); }
  void before_wait(std::function<void()> callback) override {
    blocks_.before_wait(std::move(callback));
  }

  [[nodiscard]] const XlFrame* xl_frame() const override { return xl_.get(); }
  /// The frame of the last record, if that is_xl.
  [[nodiscard]] const XlFrame& xl() const { return *xl_; }

 private:
  struct KnownInterface {
    std::uint64_t word = 1;  ///< name and the following blank, first byte lowest
    std::uint64_t mask = 0;  ///< 0: no text matches `word`
    std::uint8_t length = 0;
    can::BusIndex bus = 0;
  };

  std::size_t take_from_block(std::span<LogRecord> room);
  bool take_line(LogRecord& record);
  const char* parse_usual(const char* p, LogRecord& record);
  bool read_second(const char* p);
  const KnownInterface& known_interface(std::uint64_t word) const;
  void remember_interface(can::BusIndex bus);
  bool refill();

  LineBlocks blocks_;
  const char* at_ = nullptr;
  const char* end_ = nullptr;
  /// "(SSSSSSSSSS." of the newest line of the usual form, and its second.
  std::array<char, 12> second_text_{'(', '0', '0', '0', '0', '0', '0', '0', '0', '0', '0', '.'};
  std::int64_t second_ns_ = 0;
  static constexpr std::size_t kKnownMax = 4;
  std::array<KnownInterface, kKnownMax + 1> known_{};  ///< the last entry stays unknown, with
                                                       ///< length 0
  std::size_t known_count_ = 0;
  InterfaceTable interfaces_;
  std::unique_ptr<XlFrame> xl_;
  LogCounts counts_;
};

/// Longest name of an interface: the kernel allows 15 characters, logs of other tools a little
/// more.
inline constexpr std::size_t kInterfaceNameMax = 31;

/// Longest line that format_line() writes, including the newline.
inline constexpr std::size_t kLineBytesMax = 200;

/// Writes one line with its newline to `out`, which has room for kLineBytesMax; returns its length.
/// `fraction_digits` is 6 or 9; 6 truncates.
std::size_t format_line(char* out, TimePoint stamp, std::string_view interface,
                        const can::Frame& frame, unsigned fraction_digits,
                        Direction direction = Direction::kUnknown);

/// Formats many lines for one interface: keeps the text that is the same in the next line.
class LineFormatter {
 public:
  explicit LineFormatter(std::string_view interface);
  /// Same as format_line().
  std::size_t format(char* out, TimePoint stamp, const can::Frame& frame, unsigned fraction_digits);

 private:
  std::int64_t second_ns_ = -1;    ///< start of the second that prefix_ shows
  std::array<char, 16> prefix_{};  ///< "(SSSSSSSSSS."
  std::array<char, 40> middle_{};  ///< ") INTERFACE "
  std::size_t middle_bytes_ = 0;
};

std::string format_xl_line(TimePoint stamp, std::string_view interface, const XlFrame& frame,
                           unsigned fraction_digits, Direction direction = Direction::kUnknown);

}  // namespace vgyro::canlog
