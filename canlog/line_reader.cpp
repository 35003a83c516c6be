#include "canlog/line_reader.h"

#include "canlog/writer.h"

namespace vgyro::canlog {

LineReader::LineReader(std::unique_ptr<ByteSource> bytes)
    : blocks_(std::make_unique<LogSource>(std::move(bytes))) {}

bool LineReader::next(LogRecord& record) {
  while (true) {
    if (block_.empty()) block_ = blocks_.next(counts_);
    if (block_.empty()) return false;
    ++counts_.lines;
    const std::size_t end = block_.find('\n');
    const std::string_view line = clean_line(block_.substr(0, end), counts_.skipped_bytes);
    block_.remove_prefix(end + 1);
    record = {};
    const Parsed result = parse(line, record);
    if (result.verdict == Verdict::kFrame) {
      ++counts_.frames;
      return true;
    }
    if (result.verdict == Verdict::kMalformed) counts_.add_malformed(result.why);
    if (result.verdict == Verdict::kOther) ++counts_.other_lines;
  }
}

bool LineReader::set_bus(std::string_view name, LogRecord& record) {
  const auto bus = interfaces_.index_of(name);
  if (bus) record.bus = *bus;
  return bus.has_value();
}

bool LineReader::set_channel(unsigned channel, LogRecord& record) {
  return set_bus(channel_name(channel), record);
}

const char* read_payload(Words& words, can::Frame& frame, int base) {
  for (std::size_t i = 0; i < frame.length; ++i) {
    const std::string_view word = words.next();
    if (word.empty()) return "payload: shorter than its length";
    const auto byte = number_of<std::uint8_t>(word, base);
    if (!byte) return "payload: a byte is not a number from 0 to 255";
    frame.data[i] = *byte;
  }
  return nullptr;
}

}  // namespace vgyro::canlog
