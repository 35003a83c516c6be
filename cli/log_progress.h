#pragma once

// Progress of reading logs, on a terminal. Costs one subtraction a record.

#include <cstddef>
#include <cstdint>
#include <string>

#include "canlog/reader.h"
#include "cli/output/progress.h"

namespace vgyro::cli {

class LogProgress {
 public:
  /// `reader` must outlive this.
  LogProgress(const std::string& what, const canlog::LogReader& reader)
      : progress_(what), reader_(reader) {}

  /// `records` more records were taken.
  void add(std::size_t records = 1) {
    if (until_drawn_ > records) {
      until_drawn_ -= records;
      return;
    }
    until_drawn_ = kRecordsPerDrawing;
    progress_.update(reader_.bytes_read(), reader_.bytes_total(), reader_.counts().frames);
  }

 private:
  static constexpr std::uint64_t kRecordsPerDrawing = 1U << 16U;

  Progress progress_;
  const canlog::LogReader& reader_;
  std::uint64_t until_drawn_ = kRecordsPerDrawing;
};

}  // namespace vgyro::cli
