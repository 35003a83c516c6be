#include "cli/output/output_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <sys/stat.h>
#include <unistd.h>

namespace vgyro::cli {

namespace {
constexpr int kDiscard = -1;

namespace fs = std::filesystem;

// The place of a file of this name, present or future, after symbolic links. Empty if a new file
// must not replace it: a device or pipe, a name of an open file such as /dev/stdout, or a file
// without write permission.
std::string replaceable_place(const std::string& path) {
  std::error_code code;
  const fs::path place = fs::weakly_canonical(path, code);
  if (code || !place.has_filename()) return {};
  const std::string folder = fs::weakly_canonical(fs::path(path).parent_path(), code).string();
  if (folder == "/dev" || folder.starts_with("/proc/")) return {};
  struct stat info {};
  if (::stat(place.c_str(), &info) != 0) return errno == ENOENT ? place.string() : std::string();
  const bool free = S_ISREG(info.st_mode) && ::access(place.c_str(), W_OK) == 0;
  return free ? place.string() : std::string();
}
}  // namespace

OutputFile::OutputFile(int fd, std::string name, bool owned)
    : fd_(fd),
      name_(std::move(name)),
      owned_(owned),
      buffer_(std::make_unique<char[]>(kBufferBytes)) {}

OutputFile::OutputFile(Unfinished unfinished, std::string name)
    : OutputFile(unfinished.descriptor(), std::move(name), true) {
  unfinished_.emplace(std::move(unfinished));
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : fd_(std::exchange(other.fd_, kDiscard)),
      name_(std::move(other.name_)),
      owned_(std::exchange(other.owned_, false)),
      buffer_(std::move(other.buffer_)),
      used_(std::exchange(other.used_, 0)),
      error_(std::move(other.error_)),
      unfinished_(std::move(other.unfinished_)) {}

OutputFile::~OutputFile() {
  if (buffer_ != nullptr && !unfinished_) flush();
  if (owned_) ::close(fd_);
}

Expected<OutputFile> OutputFile::open(const std::string& path) {
  if (path.empty()) return OutputFile(kDiscard, "", false);
  if (path == "-") return OutputFile(STDOUT_FILENO, "standard output", false);
  if (const std::string place = replaceable_place(path); !place.empty()) {
    auto unfinished = Unfinished::beside(place, path);
    if (unfinished) return OutputFile(std::move(*unfinished), path);
  }
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return fail(path, "cannot be written: " + system_reason());
  return OutputFile(fd, path, true);
}

void OutputFile::flush() {
  const char* at = buffer_.get();
  std::size_t left = used_;
  used_ = 0;
  while (left > 0 && fd_ != kDiscard && !error_) {
    const ssize_t written = ::write(fd_, at, left);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      error_ = Error{name_, "cannot be written: " + system_reason(), {}};
      return;
    }
    at += written;
    left -= static_cast<std::size_t>(written);
  }
}

void OutputFile::write(std::string_view text) {
  while (!text.empty()) {
    const std::size_t part = std::min(text.size(), kRoomMax);
    std::memcpy(room(part), text.data(), part);
    commit(part);
    text.remove_prefix(part);
  }
}

bool OutputFile::can_rewrite() const {
  struct stat info {};
  return owned_ && ::fstat(fd_, &info) == 0 && S_ISREG(info.st_mode);
}

void OutputFile::rewrite(std::uint64_t offset, std::string_view text) {
  flush();
  while (!text.empty() && !error_) {
    const ssize_t put = ::pwrite(fd_, text.data(), text.size(), static_cast<off_t>(offset));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) {
      error_ = Error{name_, "cannot be written: " + system_reason(), {}};
      return;
    }
    offset += static_cast<std::uint64_t>(put);
    text.remove_prefix(static_cast<std::size_t>(put));
  }
}

Expected<void> OutputFile::close() {
  flush();
  if (owned_ && ::close(std::exchange(fd_, kDiscard)) != 0 && !error_) {
    error_ = Error{name_, "cannot be written: " + system_reason(), {}};
  }
  owned_ = false;
  if (!error_ && unfinished_) {
    if (const auto kept = unfinished_->keep(); !kept) error_ = kept.error();
  }
  unfinished_.reset();
  if (error_) return tl::unexpected(*error_);
  return {};
}

}  // namespace vgyro::cli
