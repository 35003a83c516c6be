#include "canlog/log_source.h"

#include <filesystem>
#include <fstream>
#include <lzma.h>
#include <unistd.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/canlog/log_text.h"

namespace vgyro::canlog {
namespace {

/// Incompressible payloads, so that the packed file has many parts to damage.
std::string log_text(unsigned lines) {
  std::mt19937_64 random(20'240'604);
  std::string text;
  for (unsigned i = 0; i < lines; ++i) {
    text += fmt::format("(1700000000.{:06}) can0 {:03X}#{:016X}\n", i, i & can::kStandardIdMax,
                        random());
  }
  return text;
}

std::string packed(const std::string& text) {
  std::string out(lzma_stream_buffer_bound(text.size()), '\0');
  std::size_t size = 0;
  const lzma_ret result = lzma_easy_buffer_encode(
      1, LZMA_CHECK_CRC64, nullptr, reinterpret_cast<const std::uint8_t*>(text.data()), text.size(),
      reinterpret_cast<std::uint8_t*>(out.data()), &size, out.size());
  EXPECT_EQ(result, LZMA_OK);
  out.resize(size);
  return out;
}

class OpenLog : public ::testing::Test {
 protected:
  OpenLog() {
    std::string pattern = ::testing::TempDir() + "vgyro_log_XXXXXX";
    folder_ = ::mkdtemp(pattern.data());
  }
  ~OpenLog() override { std::filesystem::remove_all(folder_); }

  std::string file_with(const std::string& name, const std::string& bytes) {
    std::string path = folder_ + "/" + name;
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  static ReadLog read(const std::string& path) {
    auto source = open_source(path);
    if (source) return read_all(std::move(*source));
    ReadLog log;
    log.error = source.error().message();
    return log;
  }

  /// The records of `log` are the first of `whole`.
  static void expect_beginning(const ReadLog& log, const ReadLog& whole, std::size_t at_least) {
    EXPECT_GE(log.records.size(), at_least);
    ASSERT_LE(log.records.size(), whole.records.size());
    for (std::size_t i = 0; i < log.records.size(); ++i)
      ASSERT_EQ(log.records[i], whole.records[i]) << i;
  }

  std::string folder_;
};

// A file larger than the buffer is read whole, and the progress is known.
TEST_F(OpenLog, ReadsAFileToItsEnd) {
  const std::string text = log_text(20'000);
  ASSERT_GT(text.size(), 3 * LogSource::kBufferBytes);
  const ReadLog log = read(file_with("a.log", text));
  EXPECT_EQ(log.records, read_by_parse_line(text).records);
  EXPECT_EQ(log.error, "");
  auto source = open_source(folder_ + "/a.log");
  ASSERT_TRUE(source);
  EXPECT_EQ((*source)->bytes_total(), text.size());
  EXPECT_LE((*source)->bytes_read(), HeadedSource::kHeadBytesMax);
  while (!(*source)->next()->end) {
  }
  EXPECT_EQ((*source)->bytes_read(), text.size());
}

// Blocks hold only whole lines, and together they are the file.
TEST_F(OpenLog, HandsOutWholeLines) {
  const std::string text = log_text(20'000) + "the end is cut";
  for (const std::size_t chunk : {999U, 65'536U, 1'000'000U}) {
    const auto source = log_from_text(text, chunk);
    std::string together;
    bool end = false;
    bool cut_off = false;
    while (!end) {
      const auto block = source->next();
      ASSERT_TRUE(block);
      end = block->end;
      cut_off = block->cut_off;
      if (!block->text.empty()) {
        EXPECT_EQ(block->text.back(), '\n');
      }
      together += block->text;
    }
    EXPECT_TRUE(cut_off);
    EXPECT_EQ(together + "the end is cut", text);
  }
}

// For a mistyped path the error names the path and the cause.
TEST_F(OpenLog, NamesTheFileThatItCannotOpen) {
  const auto missing = open_source(folder_ + "/missing.log");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().message(),
            folder_ + "/missing.log: cannot be opened: No such file or directory");
  const auto directory = open_source(folder_);
  ASSERT_FALSE(directory);
  EXPECT_EQ(directory.error().message(), folder_ + ": is a directory, not a log");
}

// A program that prints for people must flush before it may have to wait for the next frame.
TEST_F(OpenLog, CallsBeforeEveryWait) {
  const auto source = log_from_text("(1.0) can0 123#\n(2.0) can0 123#\n", 16);
  int waits = 0;
  source->before_wait([&waits] { ++waits; });
  EXPECT_EQ(source->next()->text, "(1.0) can0 123#\n");
  EXPECT_EQ(waits, 1);
  EXPECT_EQ(source->next()->text, "(2.0) can0 123#\n");
  EXPECT_TRUE(source->next()->end);
  EXPECT_EQ(waits, 3);
}

// Recordings are kept packed; unpacking them on the way changes nothing.
TEST_F(OpenLog, UnpacksXz) {
  const std::string text = log_text(20'000);
  const std::string xz = packed(text);
  const ReadLog log = read(file_with("a.log.xz", xz));
  EXPECT_EQ(log.records, read_by_parse_line(text).records);
  EXPECT_EQ(log.error, "");
  const auto source = open_source(folder_ + "/a.log.xz");
  ASSERT_TRUE(source);
  EXPECT_EQ((*source)->bytes_total(), xz.size()) << "progress is counted in packed bytes";
}

// `cat a.xz b.xz` is a valid xz file, also with an empty stream in it.
TEST_F(OpenLog, UnpacksXzStreamsOneBehindTheOther) {
  const std::string a = log_text(100);
  const std::string b = log_text(50);
  const ReadLog log = read(file_with("ab.log.xz", packed(a) + packed("") + packed(b)));
  EXPECT_EQ(log.records, read_by_parse_line(a + b).records);
  EXPECT_EQ(log.error, "");
}

// After an incomplete download the available part is used, and the error reports that it is
// incomplete.
TEST_F(OpenLog, DeliversWhatATruncatedXzHolds) {
  const std::string text = log_text(20'000);
  const std::string xz = packed(text);
  const ReadLog whole = read_by_parse_line(text);
  for (const double share : {0.9, 0.5, 0.999}) {
    SCOPED_TRACE(share);
    const auto size = static_cast<std::size_t>(share * static_cast<double>(xz.size()));
    const std::string path = file_with("cut.log.xz", xz.substr(0, size));
    const ReadLog log = read(path);
    EXPECT_EQ(log.error, path + ": ends in the middle of its packed data");
    // The packer works in blocks of at most 64 KiB; everything before the last one is there.
    expect_beginning(log, whole, static_cast<std::size_t>(20'000 * (share - 0.15)));
  }
}

// After a flipped bit on a disk, the data before it are used; those after it cannot be trusted.
TEST_F(OpenLog, DeliversWhatIsBeforeTheDamageOfAnXz) {
  const std::string text = log_text(20'000);
  const ReadLog whole = read_by_parse_line(text);
  for (const double share : {0.3, 0.6, 0.9}) {
    SCOPED_TRACE(share);
    std::string xz = packed(text);
    const auto at = static_cast<std::size_t>(share * static_cast<double>(xz.size()));
    for (std::size_t i = at; i < at + 64; ++i)
      xz[i] = static_cast<char>(xz[i] ^ 0x55);
    const std::string path = file_with("damaged.log.xz", xz);
    const ReadLog log = read(path);
    EXPECT_EQ(log.error.rfind(path + ": is damaged (liblzma error ", 0), 0U) << log.error;
    const auto sure = static_cast<std::size_t>(20'000 * (share - 0.15));
    ASSERT_GE(log.records.size(), sure);
    for (std::size_t i = 0; i < sure; ++i)
      ASSERT_EQ(log.records[i], whole.records[i]) << i;
  }
}

// A block's header holds the size of its dictionary in the byte after the filter's ID and the size
// of its properties (xz file format 5.3.1). The header's own check value is recomputed.
std::string with_dictionary(std::string xz, std::uint8_t size_code) {
  constexpr std::size_t kBlock = LZMA_STREAM_HEADER_SIZE;
  const std::size_t filter = xz.find("\x21\x01", kBlock + 2);  // LZMA2, one byte of properties
  EXPECT_NE(filter, xz.npos);
  const std::size_t bytes = (static_cast<std::uint8_t>(xz[kBlock]) + 1U) * 4U;
  xz[filter + 2] = static_cast<char>(size_code);
  const std::uint32_t crc =
      lzma_crc32(reinterpret_cast<const std::uint8_t*>(xz.data()) + kBlock, bytes - 4, 0);
  for (std::size_t i = 0; i < 4; ++i)
    xz[kBlock + bytes - 4 + i] = static_cast<char>(crc >> 8U * i);
  return xz;
}

// `xz --lzma2=dict=1GiB` is not damage, and the user can change it.
TEST_F(OpenLog, TellsADictionaryThatIsTooLargeFromDamage) {
  constexpr std::uint8_t k64MiB = 28;
  constexpr std::uint8_t k1GiB = 36;
  const std::string xz = packed(log_text(100));
  EXPECT_EQ(read(file_with("usual.log.xz", with_dictionary(xz, k64MiB))).error, "");
  const std::string path = file_with("large.log.xz", with_dictionary(xz, k1GiB));
  EXPECT_EQ(read(path).error,
            path +
                ": cannot be unpacked: its dictionary needs 1025 MiB of memory, 256 MiB are the "
                "limit; `xz -dc FILE.xz | vgyro … -` unpacks it outside");
}

// An error in the middle is not the end of a log.
TEST_F(OpenLog, TellsAnErrorFromTheEnd) {
  EXPECT_EQ(read("/proc/self/mem").error, "/proc/self/mem: cannot be read: Input/output error");
}

// The content decides, since people rename files.
TEST_F(OpenLog, GoesByTheContentAndNotByTheName) {
  const std::string text = log_text(10);
  EXPECT_EQ(read(file_with("plain.log.xz", text)).records, read_by_parse_line(text).records);
  EXPECT_EQ(read(file_with("packed.log", packed(text))).records, read_by_parse_line(text).records);
  EXPECT_EQ(told(read(file_with("empty.log.xz", "")).counts), told(LogCounts{}));
}

}  // namespace
}  // namespace vgyro::canlog
