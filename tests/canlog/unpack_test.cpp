#include "canlog/unpack.h"

#include <lzma.h>
#include <random>

#include <bzlib.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

namespace vgyro::canlog {
namespace {

// Incompressible text, so that a packed file has many parts to cut and to damage.
std::string some_text(std::size_t bytes) {
  std::mt19937_64 random(20'261'129);
  std::string text;
  while (text.size() < bytes)
    text += fmt::format("{:016X}\n", random());
  return text;
}

std::string gzip(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(::deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(::deflateBound(&stream, text.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(::deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  ::deflateEnd(&stream);
  return out;
}

std::string xz(const std::string& text) {
  std::string out(::lzma_stream_buffer_bound(text.size()), '\0');
  std::size_t size = 0;
  EXPECT_EQ(::lzma_easy_buffer_encode(
                1, LZMA_CHECK_CRC64, nullptr, reinterpret_cast<const std::uint8_t*>(text.data()),
                text.size(), reinterpret_cast<std::uint8_t*>(out.data()), &size, out.size()),
            LZMA_OK);
  out.resize(size);
  return out;
}

std::string zstd(const std::string& text) {
  std::string out(::ZSTD_compressBound(text.size()) + 4, '\0');
  ZSTD_CCtx* context = ::ZSTD_createCCtx();
  ::ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);  // like the program zstd
  out.resize(::ZSTD_compress2(context, out.data(), out.size(), text.data(), text.size()));
  ::ZSTD_freeCCtx(context);
  return out;
}

std::string bzip2(const std::string& text) {
  std::string out(text.size() + text.size() / 100 + 600, '\0');
  auto size = static_cast<unsigned>(out.size());
  EXPECT_EQ(::BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(text.data()),
                                       static_cast<unsigned>(text.size()), 1, 0, 0),
            BZ_OK);
  out.resize(size);
  return out;
}

struct Unpacked {
  std::string text;
  std::string error;
};

Unpacked read_all(const std::string& bytes, std::size_t chunk = SIZE_MAX, std::size_t step = 5000) {
  Unpacked result;
  auto source = unpacked(bytes_from_text(bytes, chunk));
  if (!source) return {"", source.error().message()};
  std::string buffer(step, '\0');
  while (true) {
    const auto got = (*source)->read(buffer.data(), buffer.size());
    if (!got) result.error = got.error().message();
    if (!got || *got == 0) break;
    result.text.append(buffer, 0, *got);
  }
  // The end and an error must both be final.
  const auto again = (*source)->read(buffer.data(), buffer.size());
  EXPECT_EQ(again ? "" : again.error().message(), result.error);
  return result;
}

struct Way {
  const char* name;
  std::string (*pack)(const std::string&);
};
class Packed : public ::testing::TestWithParam<Way> {
 protected:
  static std::string pack(const std::string& text) { return GetParam().pack(text); }
};
INSTANTIATE_TEST_SUITE_P(Unpack, Packed,
                         ::testing::Values(Way{"gzip", gzip}, Way{"xz", xz}, Way{"zstd", zstd},
                                           Way{"bzip2", bzip2}),
                         [](const auto& way) { return std::string(way.param.name); });

TEST_P(Packed, ComesOutWhole) {
  const std::string text = some_text(300'000);
  const std::string bytes = pack(text);
  for (const std::size_t chunk : {std::size_t{1}, std::size_t{777}, SIZE_MAX}) {
    const Unpacked result = read_all(bytes, chunk);
    EXPECT_EQ(result.error, "");
    EXPECT_TRUE(result.text == text) << chunk << ' ' << result.text.size();
  }
}

TEST_P(Packed, HoldsNothing) {
  const Unpacked result = read_all(pack(""));
  EXPECT_EQ(result.error, "");
  EXPECT_EQ(result.text, "");
}

// `cat a.gz b.gz` is a valid file for all these tools; tapes pad with zeros.
TEST_P(Packed, MembersComeOutOneBehindTheOther) {
  const std::string a = some_text(1000);
  const std::string b = some_text(70'000);
  for (const std::size_t chunk : {std::size_t{1}, SIZE_MAX}) {
    const Unpacked result = read_all(pack(a) + pack("") + pack(b) + std::string(512, '\0'), chunk);
    EXPECT_EQ(result.error, "");
    EXPECT_TRUE(result.text == a + b);
  }
}

// The writer was killed, or a download is incomplete: the available part is used, and the error
// says so.
TEST_P(Packed, ComesOutAsFarAsItGoes) {
  const std::string text = some_text(2'000'000);
  const std::string bytes = pack(text);
  for (const double share : {0.5, 0.9}) {
    const auto size = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
    const Unpacked result = read_all(bytes.substr(0, size));
    EXPECT_EQ(result.error, "text: ends in the middle of its packed data");
    // bzip2 and zstd work in blocks of 100 and 128 KB.
    EXPECT_GE(static_cast<double>(result.text.size()),
              (share - 0.1) * static_cast<double>(text.size()));
    EXPECT_TRUE(text.starts_with(result.text));
  }
}

TEST_P(Packed, IsDamaged) {
  const std::string text = some_text(2'000'000);
  std::string bytes = pack(text);
  for (std::size_t i = bytes.size() / 2; i < bytes.size() / 2 + 64; ++i)
    bytes[i] = static_cast<char>(bytes[i] ^ 0x55);
  const Unpacked result = read_all(bytes);
  EXPECT_TRUE(result.error.starts_with("text: is damaged (")) << result.error;
  ASSERT_GE(result.text.size(), text.size() / 3);
  EXPECT_EQ(result.text.substr(0, text.size() / 3), text.substr(0, text.size() / 3));
}

TEST_P(Packed, IsFollowedBySomethingElse) {
  const std::string text = some_text(1000);
  const Unpacked result = read_all(pack(text) + "plain text");
  EXPECT_EQ(result.text, text);
  EXPECT_NE(result.error, "");
}

// Packed twice by mistake, as when a browser packs a file that it takes for plain.
TEST_P(Packed, IsPackedTwice) {
  const std::string text = some_text(1000);
  EXPECT_EQ(read_all(gzip(pack(text))).text, text);
  EXPECT_EQ(read_all(gzip(gzip(pack(text)))).error, "text: is packed more than twice");
}

// A small file that unpacks to more than the memory holds is unpacked piece by piece.
TEST_P(Packed, IsABomb) {
  const std::string megabyte(1U << 20U, 'x');
  std::string bytes;
  const std::string member = pack(megabyte);
  for (int i = 0; i < 64; ++i)
    bytes += member;
  auto source = unpacked(bytes_from_text(bytes));
  ASSERT_TRUE(source);
  std::string buffer(4096, '\0');
  std::size_t total = 0;
  for (auto got = (*source)->read(buffer.data(), buffer.size()); got && *got > 0;
       got = (*source)->read(buffer.data(), buffer.size()))
    total += *got;
  EXPECT_EQ(total, 64 * megabyte.size());
}

TEST(Unpack, LeavesPlainBytesAlone) {
  for (const std::string text : {"", "B", "BZh9 is no bzip2", "(1.5) can0 123#11\n", "\x1F\x8B"})
    EXPECT_EQ(read_all(text).text, text);
}

// `zstd --long=31` needs two gigabytes.
TEST(Unpack, RefusesAWindowThatIsTooLarge) {
  // RFC 8878: magic number, frame header (window descriptor follows, no checksum), exponent 21.
  const std::string bytes("\x28\xB5\x2F\xFD\x00\xA8\x01\x00\x00", 9);
  EXPECT_EQ(read_all(bytes).error,
            "text: cannot be unpacked: it needs more than 256 MiB of memory, the limit; `zstd -dc "
            "--long=31 FILE.zst | vgyro … -` unpacks it outside");
}

TEST(Unpack, NamesWhatItDoesNotUnpack) {
  EXPECT_EQ(read_all(std::string("\x04\x22\x4D\x18", 4) + std::string(20, 'x')).error,
            "text: is packed with lz4, which is not read here; `lz4 -dc FILE | vgyro … -` unpacks "
            "it outside");
}

}  // namespace
}  // namespace vgyro::canlog
