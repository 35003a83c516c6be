#include "base/bounded_file.h"

#include <array>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vgyro {
namespace {

tl::unexpected<Error> cannot(const std::string& path) {
  return fail(path, "cannot be read: " + system_reason());
}

// In the largest unit without a fraction.
std::string size_text(std::size_t bytes) {
  constexpr std::size_t kKibi = 1024;
  constexpr std::size_t kMebi = kKibi * kKibi;
  if (bytes >= kMebi && bytes % kMebi == 0) return std::to_string(bytes / kMebi) + " MiB";
  if (bytes >= kKibi && bytes % kKibi == 0) return std::to_string(bytes / kKibi) + " KiB";
  return std::to_string(bytes) + " bytes";
}

tl::unexpected<Error> too_large(const std::string& path, std::size_t bytes_max) {
  return fail(path, "is larger than " + size_text(bytes_max),
              "check that it is the right file, or shorten it");
}

Expected<void> check_kind(const std::string& path, const struct stat& about) {
  if (S_ISREG(about.st_mode)) return {};
  if (S_ISDIR(about.st_mode)) return fail(path, "is a directory, not a file");
  return fail(path, "is a pipe, a socket or a device", "name a file on a disk");
}

// A file in /proc reports no size, and a file that is being written grows: the bytes read count.
Expected<std::string> read_all(int fd, const std::string& path, std::size_t bytes_max) {
  std::string text;
  std::array<char, 65'536> block{};
  for (;;) {
    const ssize_t count = ::read(fd, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return cannot(path);
    if (count == 0) return text;
    if (static_cast<std::size_t>(count) > bytes_max - text.size())
      return too_large(path, bytes_max);
    text.append(block.data(), static_cast<std::size_t>(count));
  }
}

Expected<std::string> read_open(int fd, const std::string& path, std::size_t bytes_max) {
  struct stat about {};
  if (::fstat(fd, &about) != 0) return cannot(path);
  if (Expected<void> regular = check_kind(path, about); !regular)
    return tl::unexpected(std::move(regular).error());
  if (static_cast<std::size_t>(about.st_size) > bytes_max) return too_large(path, bytes_max);
  return read_all(fd, path, bytes_max);
}

}  // namespace

Expected<std::string> read_regular_file(const std::string& path, std::size_t bytes_max) {
  struct stat about {};
  // Before opening, since opening a device may have effects, and after it, since the file may
  // differ.
  if (::stat(path.c_str(), &about) != 0) return cannot(path);
  if (Expected<void> regular = check_kind(path, about); !regular)
    return tl::unexpected(std::move(regular).error());
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (fd < 0) return cannot(path);
  try {
    Expected<std::string> text = read_open(fd, path, bytes_max);
    ::close(fd);
    return text;
  } catch (...) {  // out of memory, and the caller continues
    ::close(fd);
    throw;
  }
}

}  // namespace vgyro
