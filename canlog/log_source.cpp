#include "canlog/log_source.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <lzma.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/core.h>

namespace vgyro::canlog {

LogSource::LogSource() : buffer_(std::make_unique<char[]>(kBufferBytes)) {}

Expected<LogBlock> LogSource::next() {
  std::memmove(buffer_.get(), buffer_.get() + handed_, used_ - handed_);
  used_ -= handed_;
  handed_ = 0;
  LogBlock block;
  while (true) {
    if (before_wait_) before_wait_();
    const auto got = read(buffer_.get() + used_, kBufferBytes - used_);
    if (!got) return tl::unexpected(got.error());
    const std::size_t searched = used_;
    used_ += *got;
    block.end = *got == 0;
    if (skipping_) {
      const void* newline = std::memchr(buffer_.get(), '\n', used_);
      const std::size_t dropped =
          newline ? static_cast<std::size_t>(static_cast<const char*>(newline) - buffer_.get()) + 1
                  : used_;
      skipping_ = newline == nullptr && !block.end;
      block.overlong = block.overlong || !skipping_;
      std::memmove(buffer_.get(), buffer_.get() + dropped, used_ - dropped);
      used_ -= dropped;
      if (skipping_) continue;
    }
    const std::size_t from = searched > used_ ? 0 : searched;
    const void* last = memrchr(buffer_.get() + from, '\n', used_ - from);
    if (last != nullptr) {
      handed_ = static_cast<std::size_t>(static_cast<const char*>(last) - buffer_.get()) + 1;
    }
    if (block.end) block.cut_off = used_ > handed_;
    if (last != nullptr || block.end || block.overlong) {
      block.text = {buffer_.get(), handed_};
      return block;
    }
    if (used_ == kBufferBytes) {
      skipping_ = true;
      used_ = 0;
    }
  }
}

namespace {

class FileSource : public LogSource {
 public:
  FileSource(int fd, std::string name, std::uint64_t bytes, bool owned)
      : fd_(fd), name_(std::move(name)), total_(bytes), owned_(owned) {}
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;
  ~FileSource() override {
    if (owned_) ::close(fd_);
  }

  [[nodiscard]] std::uint64_t bytes_read() const override { return read_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }

  Expected<std::size_t> read(char* to, std::size_t size) override {
    ssize_t got = -1;
    do {
      got = ::read(fd_, to, size);
    } while (got < 0 && errno == EINTR);
    if (got < 0) return fail(name_, "cannot be read: " + system_reason());
    read_ += static_cast<std::uint64_t>(got);
    return static_cast<std::size_t>(got);
  }

 private:
  int fd_;
  std::string name_;
  std::uint64_t total_;
  std::uint64_t read_ = 0;
  bool owned_;
};

class XzSource : public LogSource {
 public:
  XzSource(std::unique_ptr<FileSource> packed, std::string name)
      : packed_(std::move(packed)), name_(std::move(name)) {
    ready_ = lzma_stream_decoder(&stream_, kMemoryBytesMax, LZMA_CONCATENATED) == LZMA_OK;
  }
  XzSource(const XzSource&) = delete;
  XzSource& operator=(const XzSource&) = delete;
  ~XzSource() override { lzma_end(&stream_); }

  [[nodiscard]] std::uint64_t bytes_read() const override { return packed_->bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return packed_->bytes_total(); }

  Expected<std::size_t> read(char* to, std::size_t size) override {
    if (!ready_) return fail(name_, "cannot be unpacked: no memory for the xz decoder");
    stream_.next_out = reinterpret_cast<std::uint8_t*>(to);
    stream_.avail_out = size;
    while (stream_.avail_out == size && !done_ && damage_ == LZMA_OK) {
      if (stream_.avail_in == 0 && !packed_end_) {
        auto got = packed_->read(input_.get(), kInputBytes);
        if (!got) return got;
        stream_.next_in = reinterpret_cast<const std::uint8_t*>(input_.get());
        stream_.avail_in = *got;
        packed_end_ = *got == 0;
      }
      const lzma_ret result = lzma_code(&stream_, packed_end_ ? LZMA_FINISH : LZMA_RUN);
      done_ = result == LZMA_STREAM_END;
      if (!done_ && result != LZMA_OK) {
        damage_ = result;
        break;
      }
    }
    // What came out before the damage is handed on first; the next call reports it.
    if (damage_ != LZMA_OK && stream_.avail_out == size) return damaged();
    return size - stream_.avail_out;
  }

 private:
  [[nodiscard]] tl::unexpected<Error> damaged() const {
    if (damage_ == LZMA_FORMAT_ERROR) return fail(name_, "is not an .xz file");
    if (damage_ == LZMA_BUF_ERROR) return fail(name_, "ends in the middle of its packed data");
    if (damage_ == LZMA_MEMLIMIT_ERROR || damage_ == LZMA_MEM_ERROR) {
      constexpr std::uint64_t kMiB = 1U << 20U;
      return fail(
          name_,
          damage_ == LZMA_MEM_ERROR
              ? std::string("cannot be unpacked: there is not enough memory")
              : fmt::format("cannot be unpacked: its dictionary needs {} MiB of memory, {} "
                            "MiB are the limit",
                            (lzma_memusage(&stream_) + kMiB - 1) / kMiB, kMemoryBytesMax / kMiB),
          "`xz -dc FILE.xz | vgyro … -` unpacks it outside");
    }
    if (damage_ == LZMA_OPTIONS_ERROR) {
      return fail(name_, "is packed in a way that this version of liblzma does not know");
    }
    return fail(name_, fmt::format("is damaged (liblzma error {})", static_cast<int>(damage_)));
  }

  static constexpr std::size_t kInputBytes = 65'536;
  static constexpr std::uint64_t kMemoryBytesMax = 256U << 20U;
  std::unique_ptr<FileSource> packed_;
  std::string name_;
  std::unique_ptr<char[]> input_ = std::make_unique<char[]>(kInputBytes);
  lzma_stream stream_ = LZMA_STREAM_INIT;
  bool ready_ = false;
  bool packed_end_ = false;
  bool done_ = false;
  lzma_ret damage_ = LZMA_OK;
};

class TextSource : public LogSource {
 public:
  TextSource(std::string text, std::size_t chunk) : text_(std::move(text)), chunk_(chunk) {}
  [[nodiscard]] std::uint64_t bytes_read() const override { return at_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return text_.size(); }
  Expected<std::size_t> read(char* to, std::size_t size) override {
    const std::size_t count = std::min({size, chunk_, text_.size() - at_});
    std::memcpy(to, text_.data() + at_, count);
    at_ += count;
    return count;
  }

 private:
  std::string text_;
  std::size_t chunk_;
  std::size_t at_ = 0;
};

}  // namespace

Expected<std::unique_ptr<LogSource>> open_source(const std::string& path) {
  if (path == "-") {
    // Fewer turns between the writer and this process; a file or a terminal has no such size.
    ::fcntl(STDIN_FILENO, F_SETPIPE_SZ, static_cast<int>(LogSource::kBufferBytes));
    return std::make_unique<FileSource>(STDIN_FILENO, "standard input", 0, false);
  }
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return fail(path, "cannot be opened: " + system_reason());
  struct stat info {};
  const bool known = ::fstat(fd, &info) == 0;
  if (known && S_ISDIR(info.st_mode)) {
    ::close(fd);
    return fail(path, "is a directory, not a log");
  }
  const bool regular = known && S_ISREG(info.st_mode);
  auto file = std::make_unique<FileSource>(
      fd, path, regular ? static_cast<std::uint64_t>(info.st_size) : 0, true);
  if (path.size() > 3 && path.compare(path.size() - 3, 3, ".xz") == 0) {
    return std::make_unique<XzSource>(std::move(file), path);
  }
  return file;
}

std::unique_ptr<LogSource> log_from_text(std::string text, std::size_t chunk) {
  return std::make_unique<TextSource>(std::move(text), chunk);
}

}  // namespace vgyro::canlog
