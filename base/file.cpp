#include "base/file.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace vgyro {

namespace {

constexpr std::size_t kFileBytesMax = 64U << 20U;
constexpr std::size_t kBlockBytes = 1U << 16U;

struct Descriptor {
  explicit Descriptor(int number) : fd(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
  int fd;
};

// The size that the file reports is only a hint: a pipe has none, and a file may grow.
std::size_t first_room(const struct stat& info) {
  if (!S_ISREG(info.st_mode) || info.st_size <= 0) return kBlockBytes;
  return std::min(static_cast<std::size_t>(info.st_size), kFileBytesMax) + 1;
}

}  // namespace

Expected<std::string> read_file(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.fd < 0) return fail(path, "cannot be read: " + system_reason());
  struct stat info {};
  if (::fstat(file.fd, &info) != 0) return fail(path, "cannot be read: " + system_reason());
  if (S_ISDIR(info.st_mode)) return fail(path, "is a directory, not a file");
  std::string text(first_room(info), '\0');
  std::size_t used = 0;
  while (true) {
    if (used == text.size()) text.resize(used + std::max(used, kBlockBytes));
    const ssize_t got = ::read(file.fd, text.data() + used, text.size() - used);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return fail(path, "cannot be read to its end: " + system_reason());
    if (got == 0) break;
    used += static_cast<std::size_t>(got);
    if (used > kFileBytesMax) return fail(path, "is larger than 64 MiB");
  }
  text.resize(used);
  return text;
}

}  // namespace vgyro
