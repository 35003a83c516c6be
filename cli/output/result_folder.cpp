#include "cli/output/result_folder.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <unistd.h>

#include <fmt/format.h>

#include "cli/output/output_file.h"
#include "cli/output/unfinished.h"

namespace vgyro::cli {

namespace {

namespace fs = std::filesystem;

// Resolves symbolic links and removes a slash at the end, so that a path beside it can be formed.
fs::path real_path(const std::string& folder) {
  std::error_code ignored;
  const fs::path absolute = fs::absolute(folder, ignored);
  fs::path path = fs::weakly_canonical(absolute, ignored);
  if (path.empty()) path = absolute.lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  return path;
}

Error system_error(const std::string& folder, const std::error_code& code) {
  return {folder, "cannot be written: " + code.message(), {}};
}

// The nearest existing parent must be a writable folder.
Expected<void> check_parents(const std::string& folder, fs::path path) {
  std::error_code ignored;
  while (!fs::exists(path, ignored) && path.has_relative_path())
    path = path.parent_path();
  if (!fs::is_directory(path, ignored)) {
    return fail(folder, fmt::format("cannot be made: {} is no folder", path.string()));
  }
  if (::access(path.c_str(), W_OK) != 0) {
    return fail(folder, fmt::format("cannot be made in {}: {}", path.string(), system_reason()));
  }
  return {};
}

// A folder that is removed unless it is kept.
class Temporary {
 public:
  static Expected<Temporary> beside(const std::string& folder, const fs::path& path) {
    std::error_code code;
    fs::create_directories(path.parent_path(), code);
    if (code) return tl::unexpected(system_error(folder, code));
    std::string name = path.parent_path() / ("." + path.filename().string() + ".XXXXXX");
    if (::mkdtemp(name.data()) == nullptr) {
      return fail(folder, "cannot be written: " + system_reason());
    }
    return Temporary(name);
  }
  Temporary(Temporary&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  Temporary& operator=(Temporary&&) = delete;
  ~Temporary() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }

  [[nodiscard]] const fs::path& path() const { return path_; }
  void rename_to(const fs::path& to, std::error_code& code) {
    fs::rename(path_, to, code);
    if (!code) path_.clear();
  }

 private:
  explicit Temporary(fs::path path) : path_(std::move(path)) {}
  fs::path path_;
};

Expected<void> write_file(const fs::path& path, const std::string& text) {
  auto file = OutputFile::open(path.string());
  if (!file) return tl::unexpected(file.error());
  file->write(text);
  return file->close();
}

}  // namespace

Expected<void> check_result_folder(const std::string& folder,
                                   const std::vector<std::string>& names) {
  if (folder.empty()) return fail("--out", "is empty", "the name of a folder");
  const fs::path path = real_path(folder);
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (!fs::exists(status)) return check_parents(folder, path);
  if (!fs::is_directory(status)) return fail(folder, "is no folder", "choose another name");
  for (const fs::directory_entry& entry : fs::directory_iterator(path, code)) {
    const std::string name = entry.path().filename();
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    return fail(folder, fmt::format("holds \"{}\", which is not part of a result", name),
                "an earlier result is replaced, anything else is kept: choose another folder");
  }
  if (code) return tl::unexpected(system_error(folder, code));
  return {};
}

Expected<void> write_result_folder(const std::string& folder, const std::vector<ResultFile>& files,
                                   std::vector<std::string> names) {
  for (const ResultFile& file : files)
    names.push_back(file.name);
  if (auto free = check_result_folder(folder, names); !free) return free;
  const fs::path path = real_path(folder);
  const HoldSignals whole;
  auto fresh = Temporary::beside(folder, path);
  if (!fresh) return tl::unexpected(fresh.error());
  for (const ResultFile& file : files) {
    std::error_code ignored;
    fs::create_directories((fresh->path() / file.name).parent_path(), ignored);
    if (auto done = write_file(fresh->path() / file.name, file.text); !done) return done;
  }
  std::error_code code;
  fs::permissions(fresh->path(), fs::perms(0755), code);
  if (fs::exists(path)) {
    // Moves the earlier result aside; it is removed only when the new one is in place.
    auto earlier = Temporary::beside(folder, path);
    if (!earlier) return tl::unexpected(earlier.error());
    fs::rename(path, earlier->path(), code);
    if (code) return tl::unexpected(system_error(folder, code));
    fresh->rename_to(path, code);
    if (code) {
      std::error_code ignored;
      earlier->rename_to(path, ignored);
    }
  } else {
    fresh->rename_to(path, code);
  }
  if (code) return tl::unexpected(system_error(folder, code));
  return {};
}

}  // namespace vgyro::cli
