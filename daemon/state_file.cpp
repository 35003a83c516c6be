#include "daemon/state_file.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "daemon/whole_write.h"

namespace vgyro::daemon {

namespace {

std::string directory_of(const std::string& path) {
  const std::filesystem::path directory = std::filesystem::path(path).parent_path();
  return directory.empty() ? std::string(1, '.') : directory.string();
}

constexpr const char* kRemedy =
    "give the gateway a directory that it may write to (--state FILE, or StateDirectory= of its "
    "unit)";

tl::unexpected<Error> cannot(const std::string& path, const char* verb) {
  return fail(path, fmt::format("cannot be {}: {}", verb, system_reason()), kRemedy);
}

}  // namespace

StateFile::StateFile(std::string path, std::size_t bytes_max)
    : path_(std::move(path)),
      directory_(directory_of(path_)),
      new_path_(path_ + ".new"),
      aside_path_(path_ + ".refused"),
      bytes_max_(bytes_max) {}

Expected<std::optional<std::string>> StateFile::read() const {
  const Descriptor file(::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open() && errno == ENOENT) return std::nullopt;
  if (!file.is_open()) return cannot(path_, "read");
  struct stat about {};
  if (::fstat(file.get(), &about) != 0) return cannot(path_, "read");
  if (!S_ISREG(about.st_mode)) return fail(path_, "is no file", "name a file of its own");
  std::string text;
  std::array<char, 4096> block{};
  for (;;) {
    const ssize_t count = ::read(file.get(), block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return cannot(path_, "read");
    if (count == 0) return text;
    text.append(block.data(), static_cast<std::size_t>(count));
    if (text.size() > bytes_max_) text.resize(bytes_max_ + 1);
    if (text.size() > bytes_max_) return text;  // the caller will refuse it as too long
  }
}

Expected<void> StateFile::check_writable() const {
  struct stat about {};
  // Renaming over a device would remove it from the system.
  if (::stat(path_.c_str(), &about) == 0 && !S_ISREG(about.st_mode)) {
    return fail(path_, "is no file", "name a file of its own");
  }
  if (::access(directory_.c_str(), W_OK | X_OK) != 0) return cannot(path_, "written");
  return {};
}

Expected<void> StateFile::write(std::string_view text) const {
  Expected<void> done = check_writable();
  if (done) done = write_new(text);
  if (done) done = put_in_place();
  if (!done) clean_up();
  return done;
}

Expected<void> StateFile::write_new(std::string_view text) const {
  clean_up();
  Descriptor file(
      ::open(new_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  // Synced before the rename: otherwise a loss of power could leave the name without its bytes.
  const bool whole = file.is_open() && write_all(file.get(), text) && ::fsync(file.get()) == 0;
  if (!whole || !file.close()) return cannot(path_, "written");
  return {};
}

Expected<void> StateFile::put_in_place() const {
  if (::rename(new_path_.c_str(), path_.c_str()) != 0) return cannot(path_, "written");
  const Descriptor directory(::open(directory_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!directory.is_open() || ::fsync(directory.get()) != 0) return cannot(path_, "written");
  return {};
}

Expected<void> StateFile::set_aside() const {
  if (::rename(path_.c_str(), aside_path_.c_str()) != 0) return cannot(path_, "renamed");
  return {};
}

Expected<void> StateFile::remove() const {
  if (::unlink(path_.c_str()) != 0 && errno != ENOENT) return cannot(path_, "removed");
  return {};
}

void StateFile::clean_up() const {
  ::unlink(new_path_.c_str());
}

}  // namespace vgyro::daemon
