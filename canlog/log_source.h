#pragma once

// The bytes of a log in blocks of whole lines: a file, standard input, or an .xz file unpacked on
// the way. Memory stays the same however long the log is.

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/error.h"

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

  virtual ~LogSource() = default;
  Expected<LogBlock> next();
  /// Called before bytes are fetched, which may wait for a live source: the moment to flush output.
  void before_wait(std::function<void()> callback) { before_wait_ = std::move(callback); }

  /// Bytes taken in so far and in total, of the packed file where it is packed; 0 when unknown.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;

 protected:
  LogSource();
  /// Up to `size` bytes into `to`; 0 at the end.
  virtual Expected<std::size_t> read(char* to, std::size_t size) = 0;

 private:
  std::function<void()> before_wait_;
  std::unique_ptr<char[]> buffer_;
  std::size_t used_ = 0;    ///< bytes in the buffer
  std::size_t handed_ = 0;  ///< of these, in the block handed out last
  bool skipping_ = false;   ///< inside an overlong line
};

/// "-" is standard input; a name ending in ".xz" is unpacked.
Expected<std::unique_ptr<LogSource>> open_source(const std::string& path);

/// Text in memory, for tests; `chunk` bytes at a time.
std::unique_ptr<LogSource> log_from_text(std::string text, std::size_t chunk = SIZE_MAX);

}  // namespace vgyro::canlog
