#include "cli/output/overwrite.h"

#include <filesystem>
#include <optional>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/core.h>

namespace vgyro::cli {

namespace {

/// Where a file is. `name` is empty for an existing file, which its inode identifies.
struct Place {
  dev_t device = 0;
  ino_t inode = 0;  ///< of the file, or of its future folder
  std::string name;

  friend bool operator==(const Place&, const Place&) = default;
};

// Nothing for devices, pipes and the empty name, which hold nothing.
std::optional<Place> place_of(const std::string& path, int descriptor_of_dash) {
  if (path.empty()) return std::nullopt;
  struct stat info {};
  const bool there =
      path == "-" ? ::fstat(descriptor_of_dash, &info) == 0 : ::stat(path.c_str(), &info) == 0;
  if (there) {
    if (!S_ISREG(info.st_mode)) return std::nullopt;
    return Place{info.st_dev, info.st_ino, {}};
  }
  const std::filesystem::path file(path);
  const std::string folder = file.has_parent_path() ? file.parent_path().string() : ".";
  if (path == "-" || ::stat(folder.c_str(), &info) != 0) return std::nullopt;
  return Place{info.st_dev, info.st_ino, file.filename().string()};
}

std::string spoken(const std::string& path, const char* dash) {
  return path == "-" ? dash : path;
}

}  // namespace

Expected<void> check_outputs(const std::vector<std::string>& inputs,
                             const std::vector<std::string>& outputs) {
  constexpr const char* kRemedy = "choose another name";
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const auto output = place_of(outputs[i], STDOUT_FILENO);
    if (!output) continue;
    const std::string name = spoken(outputs[i], "standard output");
    for (const std::string& input : inputs) {
      if (place_of(input, STDIN_FILENO) != output) continue;
      const std::string read = spoken(input, "standard input");
      return fail(name,
                  fmt::format("is also an input{} and would be overwritten",
                              read == name ? "" : fmt::format(", {},", read)),
                  kRemedy);
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (outputs[k] == "-" && outputs[i] == "-") continue;
      if (place_of(outputs[k], STDOUT_FILENO) != output) continue;
      return fail(name,
                  fmt::format("is also another output, {}: one would overwrite the other",
                              spoken(outputs[k], "standard output")),
                  kRemedy);
    }
  }
  return {};
}

}  // namespace vgyro::cli
