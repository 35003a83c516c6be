// Input: a log of any form, packed or not, which arrives in pieces. Opening and reading must stay
// inside their memory, the pieces must make no difference, and the records must be writable again.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>

#include "canlog/unpack.h"
#include "canlog/writer.h"
#include "tests/canlog/opened_log.h"

namespace {

using namespace vgyro::canlog;

// Most bytes that are read, because a few kilobytes may unpack to gigabytes.
constexpr std::size_t kBytesMax = 1U << 20U;

void require(bool holds, const char* what) {
  if (holds) return;
  std::cerr << what << '\n';
  std::abort();
}

class NoSink final : public ByteSink {
 public:
  void write(std::string_view bytes) override { written_ += bytes.size(); }
  void rewrite(std::uint64_t /*offset*/, std::string_view /*bytes*/) override {}
  [[nodiscard]] bool can_rewrite() const override { return true; }

 private:
  std::size_t written_ = 0;
};

std::string unpacked_text(const std::string& bytes) {
  auto source = unpacked(bytes_from_text(bytes));
  std::string text;
  if (!source) return text;
  std::string buffer(4096, '\0');
  while (text.size() < kBytesMax) {
    const auto got = (*source)->read(buffer.data(), buffer.size());
    if (!got || *got == 0) break;
    text.append(buffer, 0, *got);
  }
  return text;
}

void write_all(const ReadLog& log, const WrittenForm& form) {
  NoSink sink;
  const auto writer = form.writer(sink, {});
  for (const ReadRecord& read : log.records) {
    LogRecord record;
    record.stamp = vgyro::time_from_ns(read.stamp_ns);
    record.fraction_digits = static_cast<std::uint8_t>(read.fraction_digits);
    record.direction = read.direction;
    record.is_xl = !read.xl.empty();
    record.frame = read.frame;
    writer->put(record, read.interface, read.xl.empty() ? nullptr : read.xl.data());
  }
  writer->finish();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::size_t chunk = 1U + data[0];
  const std::string text =
      unpacked_text({reinterpret_cast<const char*>(data) + 1, size - 1}).substr(0, kBytesMax);
  const ReadLog whole = open_and_read(text);
  const ReadLog pieces = open_and_read(text, chunk);
  require(whole.error == pieces.error, "the errors differ");
  require(told(whole.counts) == told(pieces.counts), "the counts differ");
  require(whole.interfaces == pieces.interfaces, "the interfaces differ");
  require(whole.records == pieces.records, "the records differ");
  for (const WrittenForm& form : written_forms())
    write_all(whole, form);
  return 0;
}
