#pragma once

// Several logs of one drive as one: records in the order of their stamps, with equal stamps in the
// order of the arguments. Records within a log are not reordered: if its stamps jump back, they are
// returned in that order, as from a single log. Holds two records of each log.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "canlog/reader.h"

namespace vgyro::canlog {

/// Opens one log with open_log(); merges several. Error if one cannot be read or is named twice, or
/// if they cannot belong together: stamps since a beginning beside stamps since the epoch. A log
/// that begins more than a year after everything before it is found while reading, as an error().
Expected<std::unique_ptr<LogReader>> open_logs(const std::vector<std::string>& paths);

class MergedReader final : public LogReader {
 public:
  struct Part {
    std::string path;
    std::unique_ptr<LogReader> reader;
  };
  /// Reads the first records. Errors as in open_logs().
  static Expected<std::unique_ptr<LogReader>> make(std::vector<Part> parts);

  bool next(LogRecord& record) override;
  [[nodiscard]] const LogCounts& counts() const override { return counts_; }
  [[nodiscard]] std::vector<const LogCounts*> parts() const override;
  [[nodiscard]] const InterfaceTable& interfaces() const override { return interfaces_; }
  [[nodiscard]] const std::optional<Error>& error() const override { return error_; }
  [[nodiscard]] std::uint64_t bytes_read() const override;
  [[nodiscard]] std::uint64_t bytes_total() const override;
  void before_wait(std::function<void()> callback) override;
  [[nodiscard]] const XlFrame* xl_frame() const override { return xl_.get(); }

 private:
  struct Held {
    LogRecord record;
    std::unique_ptr<XlFrame> xl;  ///< for an XL frame
  };
  /// A log, its next record and the one after that.
  struct Stream {
    Part part;
    std::optional<Held> next;
    std::optional<Held> after;
    std::vector<can::BusIndex> buses;  ///< the log's own index → interfaces_
    bool begun = false;                ///< a record of it was returned
    /// The stamp by which the log takes its turn. One stamp that is too late, by a glitch or before
    /// a clock was set back, must not delay the log until all others have ended.
    [[nodiscard]] TimePoint due() const {
      return after && after->record.stamp < next->record.stamp ? after->record.stamp
                                                               : next->record.stamp;
    }
  };

  explicit MergedReader(std::vector<Part> parts);
  std::optional<Held> read(Stream& stream);
  [[nodiscard]] std::optional<Error> mismatch() const;
  Stream* first_due();
  bool is_far_from_all_before(const Stream& stream);
  bool take_bus(Stream& stream, LogRecord& record);

  std::vector<Stream> streams_;
  InterfaceTable interfaces_;
  LogCounts counts_;
  std::unique_ptr<XlFrame> xl_;
  std::optional<TimePoint> newest_;
  std::optional<Error> error_;
  const Stream* failed_ = nullptr;  ///< the stream that error_ belongs to
};

}  // namespace vgyro::canlog
