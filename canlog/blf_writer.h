#pragma once

// Writes records as Vector's BLF, in the form that CANoe, python-can and Wireshark read. Stamps
// count from the whole second of the first frame, in nanoseconds. The form cannot hold interface
// names (channel numbers, canlog/writer.h), the causes of error frames, or CAN XL.

#include <cstdint>
#include <optional>
#include <string>

#include "canlog/writer.h"

namespace vgyro::canlog {

class BlfWriter final : public LogWriter {
 public:
  BlfWriter(ByteSink& sink, const WriterOptions& options);

  void put(const LogRecord& record, std::string_view bus, const XlFrame* xl) override;
  /// Completes the head of the file.
  void finish() override;
  [[nodiscard]] const ChannelNumbers* channels() const override { return &channels_; }

 private:
  void add_object(std::uint32_t type, std::int64_t since_ns, std::size_t field_bytes);
  void put_error(unsigned channel, std::int64_t since_ns);
  void put_classic(const LogRecord& record, unsigned channel, std::int64_t since_ns);
  void put_fd(const LogRecord& record, unsigned channel, std::int64_t since_ns);
  void write_container();
  [[nodiscard]] std::string head() const;

  ByteSink& sink_;
  WriterOptions options_;
  ChannelNumbers channels_;
  std::optional<std::int64_t> zero_ns_;
  std::int64_t last_ns_ = 0;       ///< the latest stamp
  std::uint64_t file_bytes_ = 0;   ///< written so far
  std::uint64_t plain_bytes_ = 0;  ///< the same with nothing packed
  std::uint32_t objects_ = 0;
  std::string content_;     ///< content of the next container
  std::string packed_;      ///< room for the container
  char* fields_ = nullptr;  ///< fields of the last object from add_object(), initially zero
};

}  // namespace vgyro::canlog
