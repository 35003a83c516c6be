#include "canlog/pack.h"

#include <array>
#include <cstdlib>
#include <lzma.h>

#include <zlib.h>
#include <zstd.h>

namespace vgyro::canlog {

namespace {

constexpr std::size_t kOutputBytes = 65'536;
// The defaults of the programs gzip, xz and zstd.
constexpr int kGzipLevel = 6;
constexpr int kXzLevel = 6;
constexpr int kZstdLevel = 3;

// The encoders fail only without memory, or because of a bug.
void require(bool holds) {
  if (!holds) std::abort();
}

class GzipSink final : public PackingSink {
 public:
  explicit GzipSink(ByteSink& to) : to_(to) {
    constexpr int kMemoryLevel = 8;  // zlib's own default
    require(::deflateInit2(&stream_, kGzipLevel, Z_DEFLATED, 16 + MAX_WBITS, kMemoryLevel,
                           Z_DEFAULT_STRATEGY) == Z_OK);
  }
  ~GzipSink() override { ::deflateEnd(&stream_); }
  void write(std::string_view bytes) override { run(bytes, Z_NO_FLUSH); }
  void finish() override { run({}, Z_FINISH); }

 private:
  void run(std::string_view bytes, int flush) {
    // zlib only reads the bytes.
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream_.avail_in = static_cast<uInt>(bytes.size());
    do {
      stream_.next_out = reinterpret_cast<Bytef*>(output_.data());
      stream_.avail_out = static_cast<uInt>(output_.size());
      require(::deflate(&stream_, flush) != Z_STREAM_ERROR);
      to_.write({output_.data(), output_.size() - stream_.avail_out});
    } while (stream_.avail_out == 0);
  }
  ByteSink& to_;
  z_stream stream_{};
  std::array<char, kOutputBytes> output_{};
};

class XzSink final : public PackingSink {
 public:
  explicit XzSink(ByteSink& to) : to_(to) {
    require(::lzma_easy_encoder(&stream_, kXzLevel, LZMA_CHECK_CRC64) == LZMA_OK);
  }
  ~XzSink() override { ::lzma_end(&stream_); }
  void write(std::string_view bytes) override { run(bytes, LZMA_RUN); }
  void finish() override { run({}, LZMA_FINISH); }

 private:
  void run(std::string_view bytes, lzma_action action) {
    stream_.next_in = reinterpret_cast<const std::uint8_t*>(bytes.data());
    stream_.avail_in = bytes.size();
    lzma_ret result = LZMA_OK;
    do {
      stream_.next_out = reinterpret_cast<std::uint8_t*>(output_.data());
      stream_.avail_out = output_.size();
      result = ::lzma_code(&stream_, action);
      require(result == LZMA_OK || result == LZMA_STREAM_END || result == LZMA_BUF_ERROR);
      to_.write({output_.data(), output_.size() - stream_.avail_out});
    } while (stream_.avail_out == 0 || (action == LZMA_FINISH && result == LZMA_OK));
  }
  ByteSink& to_;
  lzma_stream stream_ = LZMA_STREAM_INIT;
  std::array<char, kOutputBytes> output_{};
};

class ZstdSink final : public PackingSink {
 public:
  explicit ZstdSink(ByteSink& to) : to_(to), stream_(::ZSTD_createCCtx()) {
    require(stream_ != nullptr);
    ::ZSTD_CCtx_setParameter(stream_, ZSTD_c_compressionLevel, kZstdLevel);
    ::ZSTD_CCtx_setParameter(stream_, ZSTD_c_checksumFlag, 1);
  }
  ~ZstdSink() override { ::ZSTD_freeCCtx(stream_); }
  void write(std::string_view bytes) override { run(bytes, ZSTD_e_continue); }
  void finish() override { run({}, ZSTD_e_end); }

 private:
  void run(std::string_view bytes, ZSTD_EndDirective directive) {
    ZSTD_inBuffer in{bytes.data(), bytes.size(), 0};
    std::size_t left = 0;
    do {
      ZSTD_outBuffer out{output_.data(), output_.size(), 0};
      left = ::ZSTD_compressStream2(stream_, &out, &in, directive);
      require(::ZSTD_isError(left) == 0);
      to_.write({output_.data(), out.pos});
    } while (in.pos < in.size || (directive == ZSTD_e_end && left > 0));
  }
  ByteSink& to_;
  ZSTD_CCtx* stream_;
  std::array<char, kOutputBytes> output_{};
};

constexpr std::array<std::string_view, 3> kEndings{".gz", ".xz", ".zst"};

}  // namespace

std::string_view packing_ending(std::string_view path) {
  for (const std::string_view ending : kEndings)
    if (path.ends_with(ending)) return ending;
  return {};
}

std::unique_ptr<PackingSink> packing_sink(std::string_view ending, ByteSink& to) {
  if (ending == ".gz") return std::make_unique<GzipSink>(to);
  if (ending == ".xz") return std::make_unique<XzSink>(to);
  return std::make_unique<ZstdSink>(to);
}

}  // namespace vgyro::canlog
