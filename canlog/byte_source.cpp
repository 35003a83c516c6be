#include "canlog/byte_source.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "canlog/unpack.h"

namespace vgyro::canlog {

namespace {

// A larger pipe causes fewer switches between its writer and this process.
constexpr int kPipeBytes = 262'144;

class FileSource final : public ByteSource {
 public:
  FileSource(int fd, std::string name, std::uint64_t bytes, bool is_regular, bool owned)
      : fd_(fd), name_(std::move(name)), total_(bytes), is_regular_(is_regular), owned_(owned) {}
  ~FileSource() override {
    if (owned_) ::close(fd_);
  }

  Expected<std::size_t> read(char* to, std::size_t size) override {
    if (before_wait_) before_wait_();
    ssize_t got = -1;
    do {
      got = ::read(fd_, to, size);
    } while (got < 0 && errno == EINTR);
    if (got < 0) return fail(name_, "cannot be read: " + system_reason());
    read_ += static_cast<std::uint64_t>(got);
    return static_cast<std::size_t>(got);
  }

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t bytes_read() const override { return read_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }
  void before_wait(std::function<void()> callback) override { before_wait_ = std::move(callback); }
  // Standard input may be a file that another process has read up to its middle.
  [[nodiscard]] bool can_seek() const override { return is_regular_ && owned_; }
  Expected<void> seek(std::uint64_t offset) override {
    if (!can_seek()) return ByteSource::seek(offset);
    // Nothing is beyond the largest offset, as nothing is beyond the end.
    constexpr auto kOffsetMax = static_cast<std::uint64_t>(INT64_MAX);
    if (::lseek(fd_, static_cast<off_t>(std::min(offset, kOffsetMax)), SEEK_SET) < 0) {
      return fail(name_, "cannot be read: " + system_reason());
    }
    return {};
  }

 private:
  int fd_;
  std::string name_;
  std::uint64_t total_;
  bool is_regular_;
  bool owned_;
  std::uint64_t read_ = 0;
  std::function<void()> before_wait_;
};

class TextSource final : public ByteSource {
 public:
  TextSource(std::string text, std::size_t chunk) : text_(std::move(text)), chunk_(chunk) {}
  Expected<std::size_t> read(char* to, std::size_t size) override {
    if (before_wait_) before_wait_();
    const std::size_t count = std::min({size, chunk_, text_.size() - at_});
    std::memcpy(to, text_.data() + at_, count);
    at_ += count;
    return count;
  }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t bytes_read() const override { return at_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return text_.size(); }
  void before_wait(std::function<void()> callback) override { before_wait_ = std::move(callback); }
  [[nodiscard]] bool can_seek() const override { return true; }
  Expected<void> seek(std::uint64_t offset) override {
    at_ = static_cast<std::size_t>(std::min<std::uint64_t>(offset, text_.size()));
    return {};
  }

 private:
  std::string name_ = "text";
  std::string text_;
  std::size_t chunk_;
  std::size_t at_ = 0;
  std::function<void()> before_wait_;
};

// A file without a name; -1 if it cannot be created.
int open_nameless(const std::string& folder) {
  const int fd = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (fd >= 0) return fd;
  // Some file systems do not support O_TMPFILE.
  std::string pattern = folder + "/vgyro-XXXXXX";
  const int named = ::mkostemp(pattern.data(), O_CLOEXEC);
  if (named >= 0) ::unlink(pattern.c_str());
  return named;
}

Expected<std::uint64_t> copy_all(ByteSource& from, int to, const std::string& folder) {
  constexpr std::size_t kBytes = 262'144;
  const auto buffer = std::make_unique<char[]>(kBytes);
  std::uint64_t total = 0;
  while (true) {
    const auto got = from.read(buffer.get(), kBytes);
    // Bytes before the damage are copied; the form's reader notices that the end is missing.
    if (!got && total == 0) return tl::unexpected(got.error());
    if (!got || *got == 0) return total;
    for (std::size_t done = 0; done < *got;) {
      const ssize_t put = ::write(to, buffer.get() + done, *got - done);
      if (put < 0 && errno == EINTR) continue;
      if (put < 0) {
        return fail(folder, "cannot hold the unpacked log: " + system_reason(),
                    "TMPDIR names another folder; or unpack the log outside");
      }
      done += static_cast<std::size_t>(put);
    }
    total += *got;
  }
}

}  // namespace

Expected<void> ByteSource::seek(std::uint64_t /*offset*/) {
  return fail(name(), "can only be read from front to back");
}

Expected<std::unique_ptr<ByteSource>> open_raw_bytes(const std::string& path) {
  if (path == "-") {
    // Ignored by a file or a terminal.
    ::fcntl(STDIN_FILENO, F_SETPIPE_SZ, kPipeBytes);
    return std::make_unique<FileSource>(STDIN_FILENO, "standard input", 0, false, false);
  }
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return fail(path, "cannot be opened: " + system_reason());
  struct stat info {};
  const bool known = ::fstat(fd, &info) == 0;
  if (known && S_ISDIR(info.st_mode)) {
    ::close(fd);
    return fail(path, "is a directory, not a log");
  }
  const bool is_regular = known && S_ISREG(info.st_mode);
  return std::make_unique<FileSource>(
      fd, path, is_regular ? static_cast<std::uint64_t>(info.st_size) : 0, is_regular, true);
}

Expected<std::unique_ptr<ByteSource>> open_bytes(const std::string& path) {
  auto raw = open_raw_bytes(path);
  if (!raw) return raw;
  return unpacked(std::move(*raw));
}

std::unique_ptr<ByteSource> bytes_from_text(std::string text, std::size_t chunk) {
  return std::make_unique<TextSource>(std::move(text), chunk);
}

Expected<std::unique_ptr<ByteSource>> seekable(std::unique_ptr<ByteSource> source) {
  if (source->can_seek()) return source;
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing here sets a variable
  const char* named = std::getenv("TMPDIR");
  const std::string folder = named != nullptr && *named != '\0' ? named : "/var/tmp";
  const int fd = open_nameless(folder);
  if (fd < 0) {
    return fail(folder, "cannot hold the unpacked log: " + system_reason(),
                "TMPDIR names another folder");
  }
  std::string name = source->name();
  const auto bytes = copy_all(*source, fd, folder);
  if (!bytes) {
    ::close(fd);
    return tl::unexpected(bytes.error());
  }
  auto copy = std::make_unique<FileSource>(fd, std::move(name), *bytes, true, true);
  if (const auto back = copy->seek(0); !back) return tl::unexpected(back.error());
  return copy;
}

HeadedSource::HeadedSource(std::unique_ptr<ByteSource> source)
    : source_(std::move(source)), head_(std::make_unique<char[]>(kHeadBytesMax)) {}

bool HeadedSource::grow() {
  if (ended_ || size_ == kHeadBytesMax) return false;
  const auto got = source_->read(head_.get() + size_, kHeadBytesMax - size_);
  if (!got) error_ = got.error();
  ended_ = !got || *got == 0;
  if (!ended_) size_ += *got;
  return !ended_;
}

Expected<std::size_t> HeadedSource::read(char* to, std::size_t size) {
  if (at_ < size_) {
    const std::size_t count = std::min(size, size_ - at_);
    std::memcpy(to, head_.get() + at_, count);
    at_ += count;
    return count;
  }
  if (error_) return tl::unexpected(*error_);
  // Otherwise the end of file would have to be typed twice on a terminal.
  if (ended_) return 0;
  return source_->read(to, size);
}

Expected<void> HeadedSource::seek(std::uint64_t offset) {
  if (auto done = source_->seek(offset); !done) return done;
  at_ = size_;
  ended_ = false;
  return {};
}

}  // namespace vgyro::canlog
