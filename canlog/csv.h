#pragma once

// Tables of frames with columns separated by commas: python-can's, and those of SavvyCAN and its
// loggers (GVRET). Columns are found by the names in the first line.

#include <memory>
#include <string_view>

#include "canlog/line_reader.h"

namespace vgyro::canlog {

bool is_python_can_csv_line(std::string_view line);

/// timestamp,arbitration_id,extended,remote,error,dlc,data: seconds, and bytes as base64. The form
/// holds neither buses (all frames are on "can0") nor whether a frame of up to eight bytes is FD.
class PythonCanCsvReader final : public LineReader {
 public:
  explicit PythonCanCsvReader(std::unique_ptr<ByteSource> bytes) : LineReader(std::move(bytes)) {}

 private:
  Parsed parse(std::string_view line, LogRecord& record) override;
};

bool is_savvycan_csv_line(std::string_view line);

/// Time Stamp,ID,Extended,Dir,Bus,LEN,D1,…: microseconds; older files have no Dir. Bus N is "canN".
class SavvyCanCsvReader final : public LineReader {
 public:
  explicit SavvyCanCsvReader(std::unique_ptr<ByteSource> bytes) : LineReader(std::move(bytes)) {}

 private:
  Parsed parse(std::string_view line, LogRecord& record) override;
  static constexpr int kNone = -1;
  int time_ = kNone;  ///< indices of the columns
  int id_ = kNone;
  int extended_ = kNone;
  int direction_ = kNone;
  int bus_ = kNone;
  int length_ = kNone;
  int data_ = kNone;
};

}  // namespace vgyro::canlog
