#include "gateway/config_files.h"

#include <algorithm>
#include <filesystem>
#include <lzma.h>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "base/bounded_file.h"
#include "base/toml_merge.h"

namespace vgyro::gateway {
namespace {

// A configuration takes some kB; a file this large is something else.
constexpr std::size_t kConfigBytesMax = std::size_t{1} << 20U;
// A fleet's, a vehicle's and a workshop's make three; more than this is a folder of something else.
constexpr std::size_t kOverlaysMax = 64;
// The limit of the DBC reader.
constexpr std::size_t kNamedFileBytesMax = std::size_t{16} << 20U;

Expected<toml::table> read_one(const std::string& path) {
  const Expected<std::string> text = read_regular_file(path, kConfigBytesMax);
  if (!text) return tl::unexpected(text.error());
  return parse_toml(*text, path, "write strings in quotes and tables in [brackets]");
}

// Names that begin with a dot are temporary files of an editor.
bool is_overlay(const std::filesystem::path& path) {
  return path.extension() == ".toml" && !path.filename().string().starts_with('.');
}

Expected<std::vector<std::string>> overlays_of(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).replace_extension(".d");
  std::vector<std::string> found;
  std::error_code error;
  if (folder == std::filesystem::path(path) || !std::filesystem::is_directory(folder, error))
    return found;
  std::filesystem::directory_iterator at(folder, error);
  for (; !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    if (is_overlay(at->path())) found.push_back(at->path().string());
    if (found.size() > kOverlaysMax) {
      return fail(folder.string(), fmt::format("holds more than {} files *.toml", kOverlaysMax),
                  "is it the right folder? all of them would go over " + path);
    }
  }
  if (error) return fail(folder.string(), "cannot be read: " + error.message());
  std::sort(found.begin(), found.end());
  return found;
}

std::uint64_t add(std::uint64_t crc, std::string_view text) {
  return lzma_crc64(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), crc);
}

}  // namespace

Expected<ConfigText> read_config_files(const std::string& path) {
  Expected<toml::table> table = read_one(path);
  if (!table) return tl::unexpected(table.error());
  ConfigText config{.table = std::move(*table), .files = {path}};
  const Expected<std::vector<std::string>> overlays = overlays_of(path);
  if (!overlays) return tl::unexpected(overlays.error());
  for (const std::string& overlay : *overlays) {
    Expected<toml::table> later = read_one(overlay);
    if (!later) return tl::unexpected(later.error());
    merge_toml(config.table, std::move(*later));
    config.files.push_back(overlay);
  }
  return config;
}

std::string config_fingerprint(const toml::table& table, const std::string& overrides,
                               std::span<const std::string> named_files) {
  std::uint64_t crc = 0;
  for (const TomlOrigin& origin : toml_origins(table))
    crc = add(crc, origin.key + '=' + origin.value + '\n');
  crc = add(crc, overrides + '\n');
  for (const std::string& file : named_files) {
    // The file was read a moment ago; if it has disappeared since, it counts as empty.
    const Expected<std::string> text = read_regular_file(file, kNamedFileBytesMax);
    const std::uint64_t bytes = text ? text->size() : 0;
    crc = add(crc, fmt::format("{}\n", bytes));
    if (text) crc = add(crc, *text);
  }
  return fmt::format("{:016x}", crc);
}

}  // namespace vgyro::gateway
