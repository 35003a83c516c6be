#pragma once

// Vector's BLF, which CANoe, CANalyzer, python-can and many loggers write. Classic, FD, remote and
// error frames; other objects are counted and skipped. Stamps count from the date in the file's
// head, which is local time, or from zero without a date. docs/log-format.md has the details.

#include <memory>
#include <string_view>

#include "canlog/binary_reader.h"
#include "canlog/blf_content.h"

namespace vgyro::canlog {

bool is_blf(std::string_view head);

/// Neither copies nor allocates per frame.
class BlfReader final : public BinaryReader {
 public:
  /// Error if the file has no valid head.
  static Expected<std::unique_ptr<LogReader>> open(std::unique_ptr<ByteSource> bytes);

  bool next(LogRecord& record) override;
  [[nodiscard]] std::uint64_t bytes_read() const override { return content_.bytes().bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override {
    return content_.bytes().bytes_total();
  }
  void before_wait(std::function<void()> callback) override {
    content_.bytes().before_wait(std::move(callback));
  }

 private:
  struct Object {
    const char* begin = nullptr;
    std::size_t head_bytes = 0;
    std::size_t bytes = 0;  ///< head included; all of them are available for types that are read
    std::uint32_t type = 0;
    [[nodiscard]] const char* fields() const { return begin + head_bytes; }
    [[nodiscard]] std::size_t field_bytes() const { return bytes - head_bytes; }
  };
  enum class Outcome : std::uint8_t { kFrame, kNone, kEnd };

  BlfReader(std::unique_ptr<ByteWindow> bytes, std::string_view head);

  Outcome read_object(LogRecord& record);
  bool find_object();
  void resume_at_mark();
  bool fill(std::size_t size);
  bool pass(std::uint64_t size);
  Outcome break_off(bool inside);
  const char* read_event(const Object& object, LogRecord& record, bool& is_frame);
  const char* read_message(const Object& object, LogRecord& record, bool& is_frame);
  const char* read_fd(const Object& object, LogRecord& record, bool& is_frame);
  static const char* read_start(const char* fields, LogRecord& record, bool& is_frame);
  const char* set_message_channel(const char* fields, LogRecord& record);
  const char* read_fd64(const Object& object, LogRecord& record, bool& is_frame);

  /// Objects of the types that are read are smaller than this.
  static constexpr std::size_t kObjectBytesMax = 4'096;
  static constexpr std::size_t kBufferBytes = 262'144;

  BlfContent content_;
  std::int64_t zero_ns_ = 0;
  std::unique_ptr<char[]> buffer_;
  std::size_t at_ = 0;
  std::size_t end_ = 0;
  const char* torn_ = nullptr;  ///< why bytes are missing after those in the buffer
  bool lost_ = false;           ///< the next bytes may begin inside an object
  bool finished_ = false;
  bool ended_ = false;  ///< content_ has ended
};

}  // namespace vgyro::canlog
