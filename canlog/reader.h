#pragma once

// Reads the records of a log of any form in sequence. What cannot be read is counted with its cause
// and place, and never stops the reading.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "canlog/byte_source.h"
#include "canlog/record.h"

namespace vgyro::canlog {

class LogReader {
 public:
  LogReader() = default;
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;
  virtual ~LogReader() = default;

  /// False at the end of the log, or if it cannot be read further: see error().
  virtual bool next(LogRecord& record) = 0;
  /// Reads several records at once, for callers that read millions: 1 to room.size() of them, never
  /// waiting for more once there is one; 0 if next() would be false. For an is_xl record the frame
  /// is not available.
  virtual std::size_t next_batch(std::span<LogRecord> room) { return next(room.front()) ? 1 : 0; }

  [[nodiscard]] virtual const LogCounts& counts() const = 0;
  /// The counts of each log if there are several (canlog/merged_reader.h), in the order of the
  /// arguments.
  [[nodiscard]] virtual std::vector<const LogCounts*> parts() const { return {&counts()}; }
  [[nodiscard]] virtual const InterfaceTable& interfaces() const = 0;
  [[nodiscard]] virtual const std::optional<Error>& error() const = 0;

  /// Bytes read so far and in total, of the packed file if it is packed; 0 if unknown.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;

  /// Sets a function to call before a read that may wait for a live source, so that output can be
  /// flushed.
  virtual void before_wait(std::function<void()> callback) = 0;

  /// The frame of the last record, if that is_xl; null for forms without such frames.
  [[nodiscard]] virtual const XlFrame* xl_frame() const { return nullptr; }
};

/// Opens a log by its content, not by its name; "-" is standard input. Error, with a remedy, if it
/// cannot be read or has no known form (canlog/forms.h).
Expected<std::unique_ptr<LogReader>> open_log(const std::string& path);

/// The same for bytes that are unpacked already.
Expected<std::unique_ptr<LogReader>> open_log(std::unique_ptr<ByteSource> bytes);

}  // namespace vgyro::canlog
