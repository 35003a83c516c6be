#pragma once

// The bytes of a log of lines, in blocks of whole lines. Memory does not grow with the log.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "canlog/byte_source.h"
#include "canlog/record.h"

namespace vgyro::canlog {

struct LogBlock {
  std::string_view text;  ///< whole lines, each with its newline; valid until the next call
  bool overlong = false;  ///< a line longer than the buffer was skipped before this block
  bool cut_off = false;   ///< last block: the log ended inside a line, which is not in `text`
  bool end = false;       ///< nothing follows
};

class LogSource {
 public:
  /// A line longer than this is no frame.
  static constexpr std::size_t kBufferBytes = 262'144;

  explicit LogSource(std::unique_ptr<ByteSource> bytes);
  Expected<LogBlock> next();

  /// Same as in ByteSource.
  void before_wait(std::function<void()> callback) { bytes_->before_wait(std::move(callback)); }
  [[nodiscard]] std::uint64_t bytes_read() const { return bytes_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const { return bytes_->bytes_total(); }

 private:
  std::unique_ptr<ByteSource> bytes_;
  std::unique_ptr<char[]> buffer_;
  std::size_t used_ = 0;    ///< bytes in the buffer
  std::size_t handed_ = 0;  ///< bytes of the buffer in the block returned last
  bool skipping_ = false;   ///< inside an overlong line
};

/// Reads a source until it ends or fails, and counts what is not a whole line.
class LineBlocks {
 public:
  explicit LineBlocks(std::unique_ptr<LogSource> source)
      : source_(std::move(source)), bytes_total_(source_->bytes_total()) {}

  /// The next block that has lines, valid until the next call; empty at the end and after an error.
  std::string_view next(LogCounts& counts);

  void before_wait(std::function<void()> callback);
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  [[nodiscard]] std::uint64_t bytes_read() const { return bytes_read_; }
  [[nodiscard]] std::uint64_t bytes_total() const { return bytes_total_; }

 private:
  std::unique_ptr<LogSource> source_;  ///< null when nothing follows
  std::uint64_t bytes_read_ = 0;
  std::uint64_t bytes_total_ = 0;
  std::optional<Error> error_;
};

/// "-" is standard input; packed content is unpacked.
Expected<std::unique_ptr<LogSource>> open_source(const std::string& path);

/// Text in memory, for tests; `chunk` bytes at a time.
std::unique_ptr<LogSource> log_from_text(std::string text, std::size_t chunk = SIZE_MAX);

}  // namespace vgyro::canlog
