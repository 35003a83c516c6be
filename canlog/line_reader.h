#pragma once

// Shared by the readers of text forms: iterates over lines, counts and judges them; each form
// parses a single line. The candump log has a faster reader of its own.

#include <memory>
#include <optional>
#include <string_view>

#include "canlog/frame_fields.h"
#include "canlog/log_source.h"
#include "canlog/reader.h"
#include "canlog/text_line.h"

namespace vgyro::canlog {

enum class Verdict : std::uint8_t {
  kFrame,
  kHead,      ///< no frame, and understood: a date, a comment, a blank line; not counted separately
  kOther,     ///< no frame, but something else: counted, as people may look for it
  kMalformed  ///< looks like a frame but is not one
};
struct Parsed {
  Verdict verdict = Verdict::kOther;
  const char* why = "";  ///< for a malformed line
};

class LineReader : public LogReader {
 public:
  bool next(LogRecord& record) final;
  [[nodiscard]] const LogCounts& counts() const final { return counts_; }
  [[nodiscard]] const InterfaceTable& interfaces() const final { return interfaces_; }
  [[nodiscard]] const std::optional<Error>& error() const final { return blocks_.error(); }
  [[nodiscard]] std::uint64_t bytes_read() const final { return blocks_.bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const final { return blocks_.bytes_total(); }
  void before_wait(std::function<void()> callback) final {
    blocks_.before_wait(std::move(callback));
  }

 protected:
  explicit LineReader(std::unique_ptr<ByteSource> bytes);

  /// `line` has neither its end nor noise. `record` is default-constructed; for kFrame the callee
  /// fills it in.
  virtual Parsed parse(std::string_view line, LogRecord& record) = 0;

  static Parsed frame() { return {Verdict::kFrame, ""}; }
  static Parsed head() { return {Verdict::kHead, ""}; }
  static Parsed other() { return {Verdict::kOther, ""}; }
  static Parsed malformed(const char* why) { return {Verdict::kMalformed, why}; }
  /// Sets the record's bus by name; false if there are too many: then return
  /// malformed(kTooManyBuses).
  bool set_bus(std::string_view name, LogRecord& record);
  /// The same by the channel number, from 1 on (canlog/writer.h).
  bool set_channel(unsigned channel, LogRecord& record);
  static constexpr const char* kTooManyBuses = "more than 64 different interfaces";

 private:
  LineBlocks blocks_;
  std::string_view block_;
  InterfaceTable interfaces_;
  LogCounts counts_;
};

/// Reads payload bytes in the given base, as many as the frame's length. Null, or what is wrong.
const char* read_payload(Words& words, can::Frame& frame, int base);

}  // namespace vgyro::canlog
