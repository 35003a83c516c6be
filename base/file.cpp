#include "base/file.h"

#include <filesystem>
#include <fstream>
#include <sstream>

namespace vgyro {

namespace {
constexpr std::uintmax_t kFileBytesMax = 64U << 20U;
}

Expected<std::string> read_file(const std::string& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) return fail(path, "is a directory, not a file");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(path, "cannot be read: " + system_reason());
  const std::uintmax_t bytes = std::filesystem::file_size(path, code);
  if (!code && bytes > kFileBytesMax) return fail(path, "is larger than 64 MiB");
  std::ostringstream text;
  text << file.rdbuf();
  if (file.bad()) return fail(path, "cannot be read to its end");
  return std::move(text).str();
}

}  // namespace vgyro
