#include "canlog/line_reader.h"

#include "canlog/writer.h"

namespace vgyro::canlog {

LineReader::LineReader(std::unique_ptr<ByteSource> bytes)
    : source_(std::make_unique<LogSource>(std::move(bytes))),
      bytes_total_(source_->bytes_total()) {}

void LineReader::before_wait(std::function<void()> callback) {
  if (source_ != nullptr) source_->before_wait(std::move(callback));
}

bool LineReader::refill() {
  while (block_.empty()) {
    if (source_ == nullptr) return false;
    const auto block = source_->next();
    bytes_read_ = source_->bytes_read();
    if (!block) {
      error_ = block.error();
      source_.reset();
      return false;
    }
    if (block->overlong) {
      ++counts_.lines;
      counts_.add_malformed("the line is longer than any frame");
    }
    block_ = block->text;
    if (block->cut_off) ++counts_.cut_off_lines;
    if (block->end && block_.empty()) {
      source_.reset();
      return false;
    }
  }
  return true;
}

bool LineReader::next(LogRecord& record) {
  while (refill()) {
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
  return false;
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
    if (word.empty()) return "payload: fewer bytes than the length says";
    const auto byte = number_of<std::uint8_t>(word, base);
    if (!byte) return "payload: a byte is no number from 0 to 255";
    frame.data[i] = *byte;
  }
  return nullptr;
}

}  // namespace vgyro::canlog
