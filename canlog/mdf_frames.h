#pragma once

// Where the parts of a frame are in a record of a channel group: CAN_DataFrame, CAN_RemoteFrame and
// CAN_ErrorFrame of ASAM's bus logging, as CANedge, asammdf and python-can write them.

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "canlog/mdf_file.h"
#include "canlog/record.h"

namespace vgyro::canlog {

/// A number in a record, or one that is the same in all records.
class MdfField {
 public:
  [[nodiscard]] bool is_there() const { return kind_ != Kind::kAbsent; }
  [[nodiscard]] std::uint64_t value(const char* record) const;

  /// Reads the description in the channel's block; `record_bytes` is the size of a record. Error if
  /// the description cannot be read.
  static Expected<MdfField> describe(MdfFile& file, const MdfBlock& channel,
                                     std::uint64_t record_bytes);

 private:
  friend class MdfClock;
  enum class Kind : std::uint8_t { kAbsent, kConstant, kBits };
  [[nodiscard]] std::uint64_t raw(const char* record) const;
  Expected<void> read_conversion(MdfFile& file, std::uint64_t at);

  Kind kind_ = Kind::kAbsent;
  std::uint8_t type_ = 0;  ///< cn_data_type
  std::size_t byte_ = 0;
  unsigned bit_ = 0;
  unsigned bits_ = 0;
  std::uint64_t constant_ = 0;
  double offset_ = 0.0;  ///< value = offset + factor · raw
  double factor_ = 1.0;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> table_;  ///< raw → value
};

/// The time of a record since the beginning of the measurement.
class MdfClock {
 public:
  explicit MdfClock(MdfField field);
  /// Nothing if it is no number, or too large.
  [[nodiscard]] std::optional<std::int64_t> to_ns(const char* record) const;

 private:
  MdfField field_;
  std::int64_t tick_ns_ = 0;  ///< nanoseconds in a tick, if that is a whole number, else 0
};

enum class MdfFrameKind : std::uint8_t { kData, kRemote, kError };

struct MdfFrames {
  MdfFrameKind kind = MdfFrameKind::kData;
  std::optional<MdfClock> clock;
  MdfField bus, id, extended, dlc, length, direction, fd, rate_switch, error_state, remote;
  // The payload is in the record, or elsewhere.
  std::size_t data_at = 0;
  std::size_t data_bytes = 0;
  std::optional<std::uint64_t> elsewhere;  ///< place of the group of records, or of the data, that
                                           ///< holds the payload
  MdfField offset;                         ///< offset of the payload there

  /// Describes a channel group; nothing if its records are not frames.
  static Expected<std::optional<MdfFrames>> describe(MdfFile& file, const MdfBlock& group,
                                                     std::uint64_t record_bytes);
  /// Reads all but stamp, bus and payload. Null, or why it is no frame.
  const char* read(const char* record, LogRecord& to) const;

 private:
  Expected<void> add(MdfFile& file, const MdfBlock& channel, std::uint64_t record_bytes);
  Expected<void> add_payload(MdfFile& file, const MdfBlock& channel, std::uint64_t record_bytes);
  Expected<void> add_all(MdfFile& file, std::uint64_t first, std::uint64_t record_bytes,
                         unsigned depth);
  bool known_ = false;
};

}  // namespace vgyro::canlog
