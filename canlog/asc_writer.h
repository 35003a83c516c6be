#pragma once

// Writes records as Vector's ASC, in the form that CANoe, python-can and can-utils' asc2log read.
// Stamps count from the whole second of the first frame, so readers that read the date in the head
// only to the second lose nothing. The form cannot hold interface names (channel numbers,
// canlog/writer.h), the causes of error frames, or CAN XL.

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
