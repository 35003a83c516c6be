// Input: a log of arbitrary bytes, which arrives in arbitrary pieces. Reading must stay inside its
// memory, the quick path must agree with parse_line() and with reading in batches, and the records
// must be the same after they are written and read back.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "canlog/candump.h"
#include "tests/canlog/log_text.h"

namespace {

using vgyro::can::Frame;
using vgyro::canlog::ReadLog;
using vgyro::canlog::ReadRecord;

/// Returns the text in pieces whose sizes the fuzzer chooses.
class PiecesSource final : public vgyro::canlog::ByteSource {
 public:
  PiecesSource(std::string text, std::vector<std::uint8_t> sizes)
      : text_(std::move(text)), sizes_(std::move(sizes)) {}
  vgyro::Expected<std::size_t> read(char* to, std::size_t size) override {
    const std::size_t piece = 1U + sizes_[next_++ % sizes_.size()];
    const std::size_t count = std::min({size, piece, text_.size() - at_});
    std::memcpy(to, text_.data() + at_, count);
    at_ += count;
    return count;
  }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t bytes_read() const override { return at_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return text_.size(); }
  void before_wait(std::function<void()> /*callback*/) override {}

 private:
  std::string name_ = "fuzz";
  std::string text_;
  std::vector<std::uint8_t> sizes_;
  std::size_t at_ = 0;
  std::size_t next_ = 0;
};

void require(bool holds, const char* what) {
  if (holds) return;
  std::cerr << what << '\n';
  std::abort();
}

/// Requires the same records from reading in batches.
void require_same_in_batches(const ReadLog& log, const std::string& text,
                             const std::vector<std::uint8_t>& sizes) {
  vgyro::canlog::CandumpReader reader(
      std::make_unique<vgyro::canlog::LogSource>(std::make_unique<PiecesSource>(text, sizes)));
  std::vector<vgyro::canlog::LogRecord> room(1U + sizes.front() % 8U);
  std::size_t read = 0;
  while (const std::size_t count = reader.next_batch(room)) {
    for (std::size_t i = 0; i < count; ++i, ++read) {
      require(read < log.records.size(), "a batch holds more");
      const ReadRecord& expected = log.records[read];
      require(room[i].is_xl == !expected.xl.empty(), "a batch holds another kind of frame");
      require(to_ns(room[i].stamp) == expected.stamp_ns, "a batch holds another stamp");
      require(room[i].is_xl || room[i].frame == expected.frame, "a batch holds another frame");
    }
  }
  require(read == log.records.size(), "the batches hold less");
  require(told(reader.counts()) == told(log.counts), "the batches' counts differ");
}

std::string written(const ReadRecord& record) {
  const vgyro::TimePoint stamp = vgyro::time_from_ns(record.stamp_ns);
  const auto digits = static_cast<unsigned>(record.fraction_digits);
  if (!record.xl.empty()) {
    return format_xl_line(stamp, record.interface, record.xl[0], digits, record.direction);
  }
  // A buffer of exactly this size lets the sanitizer see a write past its end.
  std::vector<char> line(vgyro::canlog::kLineBytesMax);
  const std::size_t length =
      format_line(line.data(), stamp, record.interface, record.frame, digits, record.direction);
  return {line.data(), length};
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kSizes = 4;
  if (size < kSizes) return 0;
  const std::vector<std::uint8_t> sizes(data, data + kSizes);
  const std::string text(reinterpret_cast<const char*>(data) + kSizes, size - kSizes);
  if (text.size() >= vgyro::canlog::LogSource::kBufferBytes) return 0;  // lines of any length fit

  const ReadLog quick = vgyro::canlog::read_all(
      std::make_unique<vgyro::canlog::LogSource>(std::make_unique<PiecesSource>(text, sizes)));
  const ReadLog slow = vgyro::canlog::read_by_parse_line(text);
  require(told(quick.counts) == told(slow.counts), "the counts differ");
  require(quick.interfaces == slow.interfaces, "the interfaces differ");
  require(quick.records == slow.records, "the records differ");

  require_same_in_batches(quick, text, sizes);

  std::string again;
  for (const ReadRecord& record : quick.records)
    again += written(record);
  require(vgyro::canlog::read_text(again).records == quick.records, "written otherwise than read");
  return 0;
}
