#include "canlog/unpack.h"

#include <algorithm>
#include <array>
#include <lzma.h>
#include <string_view>

#include <bzlib.h>
#include <fmt/core.h>
#include <zlib.h>
#include <zstd.h>
#include <zstd_errors.h>

namespace vgyro::canlog {

namespace {

using namespace std::string_view_literals;

constexpr std::uint64_t kMiB = 1U << 20U;
// A file that requests more is refused, since it could be made to exhaust memory.
constexpr std::uint64_t kMemoryBytesMax = 256 * kMiB;
constexpr int kWindowLogMax = 28;
static_assert(std::uint64_t{1} << kWindowLogMax == kMemoryBytesMax);

struct Buffers {
  const std::uint8_t* in = nullptr;
  std::size_t in_left = 0;
  bool in_ends = false;  ///< nothing follows `in`
  std::uint8_t* out = nullptr;
  std::size_t out_left = 0;
};

enum class Step : std::uint8_t { kGoing, kMemberEnd, kFailed };

/// The library of one packing.
class Unpacker {
 public:
  Unpacker() = default;
  Unpacker(const Unpacker&) = delete;
  Unpacker& operator=(const Unpacker&) = delete;
  virtual ~Unpacker() = default;
  virtual bool is_ready() const = 0;
  virtual Step step(Buffers& buffers) = 0;
  /// Can another member begin with this byte? If so, the next step() begins it.
  virtual bool restart(std::uint8_t first) = 0;
  /// Precondition: step() returned kFailed.
  [[nodiscard]] virtual Error failure(const std::string& name) const = 0;
};

Error no_memory(const std::string& name) {
  return {name, "cannot be unpacked: there is not enough memory", {}};
}

class Gzip final : public Unpacker {
 public:
  // 16: accept a gzip header only.
  Gzip() { ready_ = ::inflateInit2(&stream_, 16 + MAX_WBITS) == Z_OK; }
  ~Gzip() override { ::inflateEnd(&stream_); }
  bool is_ready() const override { return ready_; }
  Step step(Buffers& b) override {
    stream_.next_in = const_cast<Bytef*>(b.in);  // zlib only reads it
    stream_.avail_in = static_cast<uInt>(b.in_left);
    stream_.next_out = b.out;
    stream_.avail_out = static_cast<uInt>(b.out_left);
    result_ = ::inflate(&stream_, Z_NO_FLUSH);
    b.in += b.in_left - stream_.avail_in;
    b.in_left = stream_.avail_in;
    b.out += b.out_left - stream_.avail_out;
    b.out_left = stream_.avail_out;
    if (result_ == Z_STREAM_END) return Step::kMemberEnd;
    return result_ == Z_OK || result_ == Z_BUF_ERROR ? Step::kGoing : Step::kFailed;
  }
  bool restart(std::uint8_t first) override {
    return first == 0x1F && ::inflateReset(&stream_) == Z_OK;
  }
  Error failure(const std::string& name) const override {
    if (result_ == Z_MEM_ERROR) return no_memory(name);
    return {name,
            fmt::format("is damaged (zlib: {})",
                        stream_.msg != nullptr ? stream_.msg : ::zError(result_)),
            {}};
  }

 private:
  z_stream stream_{};
  bool ready_ = false;
  int result_ = Z_OK;
};

class Xz final : public Unpacker {
 public:
  // The library handles members and the padding between them.
  Xz() { ready_ = ::lzma_stream_decoder(&stream_, kMemoryBytesMax, LZMA_CONCATENATED) == LZMA_OK; }
  ~Xz() override { ::lzma_end(&stream_); }
  bool is_ready() const override { return ready_; }
  Step step(Buffers& b) override {
    stream_.next_in = b.in;
    stream_.avail_in = b.in_left;
    stream_.next_out = b.out;
    stream_.avail_out = b.out_left;
    result_ = ::lzma_code(&stream_, b.in_ends ? LZMA_FINISH : LZMA_RUN);
    b.in = stream_.next_in;
    b.in_left = stream_.avail_in;
    b.out = stream_.next_out;
    b.out_left = stream_.avail_out;
    if (result_ == LZMA_STREAM_END) return Step::kMemberEnd;
    return result_ == LZMA_OK || result_ == LZMA_BUF_ERROR ? Step::kGoing : Step::kFailed;
  }
  bool restart(std::uint8_t /*first*/) override { return false; }
  Error failure(const std::string& name) const override {
    if (result_ == LZMA_MEM_ERROR) return no_memory(name);
    if (result_ == LZMA_MEMLIMIT_ERROR) {
      return {name,
              fmt::format("cannot be unpacked: its dictionary needs {} MiB of memory, {} MiB are "
                          "the limit",
                          (::lzma_memusage(&stream_) + kMiB - 1) / kMiB, kMemoryBytesMax / kMiB),
              "`xz -dc FILE.xz | vgyro … -` unpacks it outside"};
    }
    if (result_ == LZMA_OPTIONS_ERROR) {
      return {name, "is packed in a way that this liblzma does not support", {}};
    }
    return {name, fmt::format("is damaged (liblzma error {})", static_cast<int>(result_)), {}};
  }

 private:
  lzma_stream stream_ = LZMA_STREAM_INIT;
  bool ready_ = false;
  lzma_ret result_ = LZMA_OK;
};

class Zstd final : public Unpacker {
 public:
  Zstd() : stream_(::ZSTD_createDStream()) {
    ready_ = stream_ != nullptr && ::ZSTD_isError(::ZSTD_DCtx_setParameter(
                                       stream_, ZSTD_d_windowLogMax, kWindowLogMax)) == 0;
  }
  ~Zstd() override { ::ZSTD_freeDStream(stream_); }
  bool is_ready() const override { return ready_; }
  Step step(Buffers& b) override {
    ZSTD_inBuffer in{b.in, b.in_left, 0};
    ZSTD_outBuffer out{b.out, b.out_left, 0};
    result_ = ::ZSTD_decompressStream(stream_, &out, &in);
    b.in += in.pos;
    b.in_left -= in.pos;
    b.out += out.pos;
    b.out_left -= out.pos;
    if (::ZSTD_isError(result_) != 0) return Step::kFailed;
    return result_ == 0 ? Step::kMemberEnd : Step::kGoing;
  }
  // A frame, or a skippable one.
  bool restart(std::uint8_t first) override { return first == 0x28 || (first & 0xF0U) == 0x50; }
  Error failure(const std::string& name) const override {
    const ZSTD_ErrorCode code = ::ZSTD_getErrorCode(result_);
    if (code == ZSTD_error_memory_allocation) return no_memory(name);
    if (code == ZSTD_error_frameParameter_windowTooLarge) {
      return {name,
              fmt::format("cannot be unpacked: it needs more than {} MiB of memory, the limit",
                          kMemoryBytesMax / kMiB),
              "`zstd -dc --long=31 FILE.zst | vgyro … -` unpacks it outside"};
    }
    return {name, fmt::format("is damaged (libzstd: {})", ::ZSTD_getErrorName(result_)), {}};
  }

 private:
  ZSTD_DStream* stream_;
  bool ready_ = false;
  std::size_t result_ = 0;
};

class Bzip2 final : public Unpacker {
 public:
  Bzip2() { ready_ = ::BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK; }
  ~Bzip2() override { ::BZ2_bzDecompressEnd(&stream_); }
  bool is_ready() const override { return ready_; }
  Step step(Buffers& b) override {
    stream_.next_in = const_cast<char*>(reinterpret_cast<const char*>(b.in));  // only read
    stream_.avail_in = static_cast<unsigned>(b.in_left);
    stream_.next_out = reinterpret_cast<char*>(b.out);
    stream_.avail_out = static_cast<unsigned>(b.out_left);
    result_ = ::BZ2_bzDecompress(&stream_);
    b.in += b.in_left - stream_.avail_in;
    b.in_left = stream_.avail_in;
    b.out += b.out_left - stream_.avail_out;
    b.out_left = stream_.avail_out;
    if (result_ == BZ_STREAM_END) return Step::kMemberEnd;
    return result_ == BZ_OK ? Step::kGoing : Step::kFailed;
  }
  bool restart(std::uint8_t first) override {
    if (first != 'B') return false;
    ::BZ2_bzDecompressEnd(&stream_);
    stream_ = {};
    return ::BZ2_bzDecompressInit(&stream_, 0, 0) == BZ_OK;
  }
  Error failure(const std::string& name) const override {
    if (result_ == BZ_MEM_ERROR) return no_memory(name);
    return {name, fmt::format("is damaged (libbz2 error {})", result_), {}};
  }

 private:
  bz_stream stream_{};
  bool ready_ = false;
  int result_ = BZ_OK;
};

class UnpackedSource final : public ByteSource {
 public:
  UnpackedSource(std::unique_ptr<ByteSource> packed, std::unique_ptr<Unpacker> unpacker)
      : packed_(std::move(packed)), unpacker_(std::move(unpacker)) {}

  Expected<std::size_t> read(char* to, std::size_t size) override {
    // The libraries count in 32 bits.
    constexpr std::size_t kStepBytesMax = 1U << 30U;
    buffers_.out = reinterpret_cast<std::uint8_t*>(to);
    buffers_.out_left = std::min(size, kStepBytesMax);
    const std::size_t room = buffers_.out_left;
    while (buffers_.out_left == room && !error_ && !done_) {
      if (const auto fetched = fetch(); !fetched) return tl::unexpected(fetched.error());
      if (between_) {
        begin_member();
      } else {
        take_step();
      }
    }
    if (buffers_.out_left == room && error_) return tl::unexpected(*error_);
    return room - buffers_.out_left;
  }

  [[nodiscard]] const std::string& name() const override { return packed_->name(); }
  [[nodiscard]] std::uint64_t bytes_read() const override { return packed_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return packed_->bytes_total(); }
  void before_wait(std::function<void()> callback) override {
    packed_->before_wait(std::move(callback));
  }

 private:
  Expected<void> fetch() {
    if (buffers_.in_left > 0 || buffers_.in_ends) return {};
    const auto got = packed_->read(reinterpret_cast<char*>(input_.get()), kInputBytes);
    if (!got) return tl::unexpected(got.error());
    buffers_.in = input_.get();
    buffers_.in_left = *got;
    buffers_.in_ends = *got == 0;
    return {};
  }

  void take_step() {
    const std::size_t in_before = buffers_.in_left;
    const std::size_t out_before = buffers_.out_left;
    const Step step = unpacker_->step(buffers_);
    between_ = step == Step::kMemberEnd;
    if (step == Step::kFailed) {
      error_ = unpacker_->failure(name());
    } else if (step == Step::kGoing && buffers_.in_ends && buffers_.in_left == in_before &&
               buffers_.out_left == out_before) {
      error_ = Error{name(), "ends in the middle of its packed data", {}};
    }
  }

  // After a member: padding, another member, the end, or bytes that are not part of the file.
  void begin_member() {
    while (buffers_.in_left > 0 && *buffers_.in == 0) {
      ++buffers_.in;
      --buffers_.in_left;
    }
    if (buffers_.in_left == 0) {
      done_ = buffers_.in_ends;
    } else if (unpacker_->restart(*buffers_.in)) {
      between_ = false;
    } else {
      error_ = Error{name(), "something else follows its packed data, which was not read", {}};
    }
  }

  static constexpr std::size_t kInputBytes = 65'536;
  std::unique_ptr<ByteSource> packed_;
  std::unique_ptr<Unpacker> unpacker_;
  std::unique_ptr<std::uint8_t[]> input_ = std::make_unique<std::uint8_t[]>(kInputBytes);
  Buffers buffers_;
  bool between_ = false;  ///< a member has ended, and no other has begun
  bool done_ = false;
  std::optional<Error> error_;
};

template <class T>
std::unique_ptr<Unpacker> make() {
  return std::make_unique<T>();
}

struct Packing {
  bool (*begins)(std::string_view head);
  std::unique_ptr<Unpacker> (*unpacker)();  ///< null: the packing can only be named
  std::string_view name;
  std::string_view command;  ///< command that writes the unpacked bytes to standard output
};

bool begins_zstd(std::string_view head) {
  constexpr auto kSkippable = "\x2A\x4D\x18"sv;
  return head.starts_with("\x28\xB5\x2F\xFD"sv) ||
         (head.size() >= 4 && (static_cast<unsigned char>(head[0]) & 0xF0U) == 0x50 &&
          head.substr(1, 3) == kSkippable);
}
bool begins_bzip2(std::string_view head) {
  if (head.size() < 10 || !head.starts_with("BZh"sv) || head[3] < '1' || head[3] > '9') {
    return false;
  }
  const std::string_view block = head.substr(4, 6);
  return block == "\x31\x41\x59\x26\x53\x59"sv || block == "\x17\x72\x45\x38\x50\x90"sv;
}

constexpr std::array kPackings{
    Packing{[](std::string_view head) { return head.starts_with("\x1F\x8B\x08"sv); }, make<Gzip>,
            "gzip", ""},
    Packing{[](std::string_view head) { return head.starts_with("\xFD\x37zXZ\0"sv); }, make<Xz>,
            "xz", ""},
    Packing{begins_zstd, make<Zstd>, "zstd", ""},
    Packing{begins_bzip2, make<Bzip2>, "bzip2", ""},
    Packing{[](std::string_view head) { return head.starts_with("\x04\x22\x4D\x18"sv); }, nullptr,
            "lz4", "lz4 -dc"},
    Packing{[](std::string_view head) { return head.starts_with("\x1F\x9D"sv); }, nullptr,
            "compress", "gzip -dc"},
    Packing{[](std::string_view head) { return head.starts_with("LZIP"sv); }, nullptr, "lzip",
            "lzip -dc"},
    Packing{
        [](std::string_view head) { return head.starts_with("\x5D\0\0"sv) && head.size() > 12; },
        nullptr, "lzma", "xz --format=lzma -dc"},
};

// Every packing can be recognised by this many bytes.
constexpr std::size_t kMagicBytes = 10;

// Four printable characters that begin no packing: no need to wait for more.
bool is_plain(std::string_view head) {
  constexpr std::size_t kLetters = 4;
  return head.size() >= kLetters && !head.starts_with("BZh"sv) && !head.starts_with("LZIP"sv) &&
         std::all_of(head.begin(), head.begin() + kLetters,
                     [](char c) { return c >= ' ' && c <= '~'; });
}

const Packing* packing_of(HeadedSource& source) {
  // The first characters of a live log may come alone.
  while (source.head().size() < kMagicBytes && !is_plain(source.head()) && source.grow()) {
  }
  const auto found = std::find_if(kPackings.begin(), kPackings.end(), [&](const Packing& packing) {
    return packing.begins(source.head());
  });
  return found == kPackings.end() ? nullptr : &*found;
}

}  // namespace

Expected<std::unique_ptr<ByteSource>> unpacked(std::unique_ptr<ByteSource> packed) {
  // Packed once, and by mistake twice; more layers are never intended.
  constexpr int kLayersMax = 2;
  for (int layer = 0;; ++layer) {
    auto headed = std::make_unique<HeadedSource>(std::move(packed));
    const Packing* packing = packing_of(*headed);
    if (headed->head().empty() && headed->error()) return tl::unexpected(*headed->error());
    if (packing == nullptr) return headed;
    const std::string name = headed->name();
    if (packing->unpacker == nullptr) {
      return fail(name, fmt::format("is packed with {}, which is not read here", packing->name),
                  fmt::format("`{} FILE | vgyro … -` unpacks it outside", packing->command));
    }
    if (layer == kLayersMax) return fail(name, "is packed more than twice");
    auto unpacker = packing->unpacker();
    if (!unpacker->is_ready()) return tl::unexpected(no_memory(name));
    packed = std::make_unique<UnpackedSource>(std::move(headed), std::move(unpacker));
  }
}

}  // namespace vgyro::canlog
