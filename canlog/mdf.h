#pragma once

// ASAM MDF 4 with bus logging (.mf4), which CANedge loggers, asammdf and python-can write. Its
// groups of records are merged by stamp. Files whose writer was killed, or that were not finalised,
// are read as far as possible. docs/log-format.md lists what is not read.

#include <array>
#include <deque>
#include <memory>
#include <vector>

#include "canlog/binary_reader.h"
#include "canlog/byte_window.h"
#include "canlog/mdf_file.h"
#include "canlog/mdf_frames.h"
#include "canlog/stamp_order.h"

namespace vgyro::canlog {

bool is_mdf(std::string_view head);

/// One data group: records of one channel group, or of several whose records begin with a number.
class MdfGroup {
 public:
  static Expected<std::unique_ptr<MdfGroup>> open(std::shared_ptr<MdfFile> file,
                                                  const MdfBlock& group, LogCounts& counts);
  /// Some of the group's records are frames.
  [[nodiscard]] bool has_frames() const { return streams_ > 0; }

  [[nodiscard]] bool is_empty() const { return ended_ || left_ == 0; }

  /// False at the end, or if reading cannot continue. The record's bus is the file's own bus
  /// number.
  bool next(LogRecord& record);
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  /// The file ended inside a record.
  [[nodiscard]] bool is_cut_off() const { return cut_off_; }

  std::int64_t zero_ns = 0;  ///< time at which the stamps count as zero

 private:
  /// A payload in a record of its own.
  struct Payload {
    std::uint64_t offset = UINT64_MAX;
    std::size_t bytes = 0;
    std::array<char, can::kFdBytesMax> data{};  ///< the first bytes of it
  };
  /// Payloads of one channel group, in the order of the log.
  struct Payloads {
    static constexpr std::size_t kKept = 256;  ///< number of payloads kept until they are requested
    std::uint64_t end = 0;                     ///< offset of the next payload
    std::vector<Payload> kept;
    std::size_t last = 0;
    [[nodiscard]] const Payload* find(std::uint64_t offset) const;
    void keep(const Payload& payload);
  };
  /// Payloads of a sorted file, in data of their own.
  struct PayloadData {
    std::uint64_t link = 0;
    std::uint64_t at = 0;
    std::unique_ptr<ByteWindow> bytes;
    unsigned rewound = 0;
  };
  struct Records {
    std::uint64_t number = 0;
    std::uint64_t place = 0;  ///< place of its block
    std::uint64_t cycles = 0;
    std::size_t bytes = 0;
    bool is_payload = false;
    std::optional<MdfFrames> frames;
    Payloads payloads;          ///< if is_payload
    PayloadData data;           ///< for frames with their payload in data of its own
    Records* source = nullptr;  ///< for frames with their payload in other records
    std::size_t stream = 0;     ///< for frames
  };
  /// A frame that waits for its payload, or for the payloads of earlier frames.
  struct Waiting {
    LogRecord record;
    std::size_t stream = 0;
    Records* from = nullptr;  ///< null: it has its payload
    std::uint64_t offset = 0;
  };
  enum class Step : std::uint8_t { kFrame, kNone, kEnd };

  MdfGroup(std::shared_ptr<MdfFile> file, LogCounts& counts)
      : file_(std::move(file)), counts_(counts) {}

  Expected<void> add_records(const MdfBlock& block);
  void link_payloads();
  bool read(LogRecord& record);
  Step step(LogRecord& record);
  Records* find(std::uint64_t number);
  Step read_payload(Records& records);
  Step read_record(Records& records, LogRecord& record);
  const char* read_frame(const Records& records, const char* bytes, LogRecord& record) const;
  Step place_payload(Records& records, std::uint64_t offset, LogRecord& record);
  const char* fetch(PayloadData& data, std::uint64_t offset, can::Frame& frame);
  Step end_inside();
  Step end_damaged(const char* what);
  bool take_waiting(LogRecord& record);

  std::shared_ptr<MdfFile> file_;
  LogCounts& counts_;
  unsigned number_bytes_ = 0;  ///< size of the number before each record
  std::vector<std::unique_ptr<Records>> records_;
  std::size_t streams_ = 0;  ///< channel groups of frames
  std::unique_ptr<ByteWindow> bytes_;
  std::uint64_t left_ = UINT64_MAX;  ///< records left in a sorted group
  std::deque<Waiting> waiting_;
  std::size_t stream_ = 0;  ///< stream of the frame read last
  // A CANedge delays one channel group against another by up to a second.
  static constexpr std::int64_t kLateMax_ns = 8'000'000'000;
  StampOrder by_stamp_{kLateMax_ns};  ///< used if there are several streams
  std::optional<Error> error_;
  bool ended_ = false;
  bool cut_off_ = false;
};

class MdfReader final : public BinaryReader {
 public:
  static Expected<std::unique_ptr<LogReader>> open(std::unique_ptr<ByteSource> bytes);

  bool next(LogRecord& record) override;
  [[nodiscard]] std::uint64_t bytes_read() const override { return file_->bytes().bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return file_->bytes().bytes_total(); }
  void before_wait(std::function<void()> /*callback*/) override {}  // a file has no waiting reader

 private:
  struct Stream {
    std::unique_ptr<MdfGroup> group;
    LogRecord record;
    bool has_record = false;
  };

  explicit MdfReader(std::shared_ptr<MdfFile> file)
      : BinaryReader("record"), file_(std::move(file)) {}
  Expected<void> open_groups();
  void advance(Stream& stream);

  std::shared_ptr<MdfFile> file_;
  std::vector<Stream> streams_;
  bool started_ = false;
};

}  // namespace vgyro::canlog
