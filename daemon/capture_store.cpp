#include "daemon/capture_store.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/whole_write.h"

namespace vgyro::daemon {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Folders for a capture while it is written and while it is removed; neither is a capture's name.
constexpr std::string_view kNew = ".new";
constexpr std::string_view kOld = ".old";
constexpr std::size_t kStampCharacters = 16;  // "20261130T204835Z"
constexpr int kSameSecondMost = 99;           // captures of one cause within a second
constexpr mode_t kFolderMode = 0750;          // the service's umask leaves its own user only
constexpr mode_t kFileMode = 0640;
constexpr int kDescriptionFormat = 1;
constexpr const char* kRemedy =
    "free space on its disk, or give the gateway a directory that it may write to (--capture DIR)";

struct CaptureName {
  TimePoint at;
  CaptureCause cause = CaptureCause::kAsked;
};

// "20261130T204835Z-contradicted", possibly followed by "-2".
std::optional<CaptureName> parse_name(const std::string& name) {
  if (name.size() <= kStampCharacters || name[kStampCharacters] != '-') return std::nullopt;
  std::tm parts{};
  const char* const end = ::strptime(name.c_str(), "%Y%m%dT%H%M%SZ", &parts);
  if (end != name.c_str() + kStampCharacters) return std::nullopt;
  std::string_view cause = std::string_view(name).substr(kStampCharacters + 1);
  const std::size_t dash = cause.find('-');
  if (dash != std::string_view::npos) {
    const std::string_view number = cause.substr(dash + 1);
    const bool is_number =
        !number.empty() && number.find_first_not_of("0123456789") == std::string_view::npos;
    if (!is_number) return std::nullopt;
    cause = cause.substr(0, dash);
  }
  const std::optional<CaptureCause> known = capture_cause_from(cause);
  if (!known) return std::nullopt;
  return CaptureName{TimePoint{std::chrono::seconds(::timegm(&parts))}, *known};
}

std::uint64_t bytes_in(const fs::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unknown;
    const std::uint64_t size = entry->file_size(unknown);
    if (!unknown) bytes += size;
  }
  return bytes;
}

bool sync_directory(const std::string& path) {
  const Descriptor directory(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return directory.is_open() && ::fsync(directory.get()) == 0;
}

/// `put` writes the bytes. The file is synced: it must be on the disk before the folder is renamed.
template <class Put>
bool write_file(const std::string& path, const Put& put) {
  Descriptor file(
      ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, kFileMode));
  return file.is_open() && put(file.get()) && ::fsync(file.get()) == 0 && file.close();
}

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? std::string(name.data())
                                                          : std::string();
}

// Microseconds, as the recording has them.
double seconds_of(TimePoint stamp) {
  const auto whole = std::chrono::floor<std::chrono::microseconds>(stamp.time_since_epoch());
  return static_cast<double>(whole.count()) * 1e-6;
}

Json description_of(const CaptureNote& note, const CaptureRing::Blocks& blocks) {
  std::uint64_t frames = 0;
  std::uint64_t dropped = 0;
  TimePoint first = blocks.front()->first;
  TimePoint last = blocks.front()->last;
  Json earlier = Json::array();
  for (const auto& block : blocks) {
    frames += block->frames;
    // Frames dropped before the first block are not part of this recording's time.
    if (block != blocks.front()) dropped += block->dropped_before;
    first = std::min(first, block->first);
    last = std::max(last, block->last);
    const std::string& fingerprint = block->source->fingerprint;
    const bool is_new = fingerprint != note.fingerprint &&
                        std::find(earlier.begin(), earlier.end(), fingerprint) == earlier.end();
    if (is_new) earlier.push_back(fingerprint);
  }
  return {{"format", kDescriptionFormat},
          {"cause", to_string(note.cause)},
          {"text", note.text},
          {"also", note.also},
          {"time", utc_name(note.at)},
          {"host", host_name()},
          {"instance", note.instance},
          {"version", VGYRO_VERSION},
          {"fingerprint", note.fingerprint},
          {"earlier_fingerprints", earlier},
          {"overlaps", note.overlaps.empty() ? Json() : Json(note.overlaps)},
          {"recording", CaptureStore::kRecording},
          {"inputs", note.inputs},
          {"first_stamp_s", seconds_of(first)},
          {"last_stamp_s", seconds_of(last)},
          {"frames", frames},
          {"frames_dropped", dropped}};
}

}  // namespace

std::string utc_name(TimePoint time) {
  const std::time_t seconds =
      std::chrono::floor<std::chrono::seconds>(time.time_since_epoch()).count();
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y%m%dT%H%M%SZ", &parts)};
}

CaptureStore::CaptureStore(std::string directory, CaptureLimits limits)
    : directory_(std::move(directory)), limits_(limits), lock_(directory_ + "/vgyrod") {}

std::string CaptureStore::path(std::string_view name) const {
  return fmt::format("{}/{}", directory_, name);
}

Expected<void> CaptureStore::make_directory() const {
  std::error_code error;
  if (fs::is_directory(directory_, error)) return {};
  if (::mkdir(directory_.c_str(), kFolderMode) == 0) return {};
  return fail(directory_, "no directory for captures: " + system_reason(), kRemedy);
}

Expected<void> CaptureStore::open(bool& other) {
  other = false;
  Expected<void> made = make_directory();
  if (!made) return made;
  if (lock_.take() == FileLock::Outcome::kHeld) {
    other = true;
    return fail(directory_, "another gateway keeps its captures there (" + lock_.holder() + ")",
                "give this one a directory of its own (--capture DIR)");
  }
  clean_up();
  if (::access(directory_.c_str(), W_OK | X_OK) == 0) return {};
  return fail(directory_, "captures cannot be written: " + system_reason(), kRemedy);
}

Expected<std::string> CaptureStore::write(const CaptureNote& note,
                                          const CaptureRing::Blocks& blocks) const {
  std::uint64_t bytes = 0;
  for (const auto& block : blocks)
    bytes += block->xz.size();
  clean_up();
  Expected<void> done = make_directory();
  if (done) done = make_room(bytes);
  if (done) done = write_new(note, blocks);
  Expected<std::string> placed;
  if (done) placed = put_in_place(note);
  if (!done) placed = tl::unexpected(done.error());
  if (!placed) clean_up();
  return placed;
}

// Called before the capture is written, so that the limits hold while it is.
Expected<void> CaptureStore::make_room(std::uint64_t bytes) const {
  if (bytes > limits_.bytes) {
    return fail(directory_, fmt::format("a capture of {} bytes exceeds the disk limit", bytes),
                "raise --capture-disk, or lower --capture-memory");
  }
  const std::vector<std::string> captures = names();
  std::vector<std::uint64_t> sizes;
  std::uint64_t sum = bytes;
  for (const std::string& name : captures)
    sum += sizes.emplace_back(bytes_in(path(name)));
  std::size_t left = captures.size();
  for (std::size_t i = 0; left + 1 > limits_.count || sum > limits_.bytes; ++i, --left) {
    if (left == 0) break;
    if (!remove(captures[i]))
      return fail(path(captures[i]), "cannot be removed: " + system_reason(), kRemedy);
    sum -= sizes[i];
  }
  return {};
}

Expected<void> CaptureStore::write_new(const CaptureNote& note,
                                       const CaptureRing::Blocks& blocks) const {
  const std::string folder = path(kNew);
  const std::string description =
      description_of(note, blocks).dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
  const auto put_blocks = [&](int fd) {
    return std::all_of(blocks.begin(), blocks.end(),
                       [fd](const auto& block) { return write_all(fd, block->xz); });
  };
  const auto put_description = [&](int fd) { return write_all(fd, description); };
  const bool whole = ::mkdir(folder.c_str(), kFolderMode) == 0 &&
                     write_file(fmt::format("{}/{}", folder, kRecording), put_blocks) &&
                     write_file(fmt::format("{}/{}", folder, kDescription), put_description) &&
                     sync_directory(folder);
  if (whole) return {};
  return fail(directory_, "the capture cannot be written: " + system_reason(), kRemedy);
}

Expected<std::string> CaptureStore::put_in_place(const CaptureNote& note) const {
  const std::string stem = fmt::format("{}-{}", utc_name(note.at), to_string(note.cause));
  std::string name = stem;
  std::error_code error;
  for (int number = 2; fs::exists(path(name), error) && number <= kSameSecondMost; ++number)
    name = fmt::format("{}-{}", stem, number);
  const std::string placed = path(name);
  if (::rename(path(kNew).c_str(), placed.c_str()) == 0 && sync_directory(directory_))
    return placed;
  return fail(directory_, "the capture cannot be written: " + system_reason(), kRemedy);
}

// Renames the folder first: half a capture must not look like a whole one.
bool CaptureStore::remove(const std::string& name) const {
  if (::rename(path(name).c_str(), path(kOld).c_str()) != 0) return false;
  std::error_code error;
  fs::remove_all(path(kOld), error);
  if (error) errno = error.value();
  return !error;
}

void CaptureStore::clean_up() const {
  std::error_code error;
  fs::remove_all(path(kNew), error);
  fs::remove_all(path(kOld), error);
}

std::vector<std::string> CaptureStore::names() const {
  std::vector<std::string> found;
  std::error_code error;
  for (fs::directory_iterator entry(directory_, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unknown;
    const std::string name = entry->path().filename().string();
    if (parse_name(name) && entry->symlink_status(unknown).type() == fs::file_type::directory)
      found.push_back(name);
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::optional<TimePoint> CaptureStore::newest(CaptureCause cause) const {
  std::optional<TimePoint> newest;
  for (const std::string& name : names()) {
    const std::optional<CaptureName> parsed = parse_name(name);
    if (parsed && parsed->cause == cause) newest = parsed->at;
  }
  return newest;
}

}  // namespace vgyro::daemon
