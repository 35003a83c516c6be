#pragma once

// Records → Vector's ASC, in the form that CANoe, python-can and can-utils' asc2log read. Stamps
// count from the whole second in which the first frame was, so the date in the head, which some
// readers take to the second only, loses nothing. What the form has no place for: interface names
// (channel numbers, canlog/writer.h), the causes of error frames, CAN XL.

#include <array>
#include <optional>

#include "canlog/writer.h"

namespace vgyro::canlog {

class AscWriter final : public LogWriter {
 public:
  AscWriter(ByteSink& sink, const WriterOptions& options) : sink_(sink), options_(options) {}

  void put(const LogRecord& record, std::string_view bus, const XlFrame* xl) override;
  void finish() override;
  [[nodiscard]] const ChannelNumbers* channels() const override { return &channels_; }

 private:
  void begin(TimePoint first);

  ByteSink& sink_;
  WriterOptions options_;
  ChannelNumbers channels_;
  std::optional<std::int64_t> zero_ns_;
};

}  // namespace vgyro::canlog
