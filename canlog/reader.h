#pragma once

// A log of any form → its records, one after the other. What cannot be read is counted with its
// cause and place, and never stops the reading.

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

  /// False at the end of the log, or where it can be read no further: see error().
  virtual bool next(LogRecord& record) = 0;
  /// Some records at once, for who reads millions: 1 to room.size() of them, never waiting for more
  /// once there is one; 0 where next() is false. A record that is_xl is only reported.
  virtual std::size_t next_batch(std::span<LogRecord> room) { return next(room.front()) ? 1 : 0; }

  [[nodiscard]] virtual const LogCounts& counts() const = 0;
  /// Of each log, where this reads several (canlog/merged_reader.h), in the order of the arguments.
  [[nodiscard]] virtual std::vector<const LogCounts*> parts() const { return {&counts()}; }
  [[nodiscard]] virtual const InterfaceTable& interfaces() const = 0;
  [[nodiscard]] virtual const std::optional<Error>& error() const = 0;

  /// Bytes taken in so far and in total, of the packed file where it is packed; 0 when unknown.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;

  /// Called before bytes are fetched, which may wait for a live source: the moment to flush output.
  virtual void before_wait(std::function<void()> callback) = 0;

  /// The frame of the record read last, where that is_xl; null for forms without such frames.
  [[nodiscard]] virtual const XlFrame* xl_frame() const { return nullptr; }
};

/// By the log's content, not by its name; "-" is standard input. Error where it cannot be read, or
/// is of no form that is known (canlog/forms.h): then with the way out.
Expected<std::unique_ptr<LogReader>> open_log(const std::string& path);

/// The same for bytes that are unpacked already.
Expected<std::unique_ptr<LogReader>> open_log(std::unique_ptr<ByteSource> bytes);

}  // namespace vgyro::canlog
