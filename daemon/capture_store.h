#pragma once

// Captures on disk: one folder each, DIRECTORY/20261130T204835Z-contradicted, with the recording
// and a description. The folder is written under another name, synced and renamed, so a folder with
// a capture's name is whole, whatever killed the process. The number of captures and their bytes
// are limited; the oldest by name are removed first, and nothing but captures. Each gateway has a
// directory of its own. write() may take long, so it belongs in a separate thread; the other calls
// come from the loop.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "daemon/capture_cause.h"
#include "daemon/capture_ring.h"
#include "daemon/file_lock.h"

namespace vgyro::daemon {

/// The description of a capture: all but its frames.
struct CaptureNote {
  CaptureCause cause = CaptureCause::kAsked;
  std::string text;                 ///< the cause, for people
  std::vector<std::string> also;    ///< further causes until it was written, for people
  TimePoint at;                     ///< time of the cause, on the host's clock
  std::string instance;             ///< name of one of several gateways, or empty
  std::string fingerprint;          ///< of the configuration in use
  std::vector<std::string> inputs;  ///< what is recorded: "can0 101"
  std::string overlaps;             ///< earlier capture with some of the same frames, or empty
};

struct CaptureLimits {
  std::size_t count = 0;  ///< captures on the disk
  std::uint64_t bytes = 0;
};

class CaptureStore {
 public:
  static constexpr std::string_view kRecording = "recording.log.xz";
  static constexpr std::string_view kDescription = "capture.json";

  /// Does not touch the disk yet.
  CaptureStore(std::string directory, CaptureLimits limits);

  /// Call once, at the start: makes the directory and removes what a killed writer left. Sets
  /// `other` if another gateway uses the directory, the only error that is permanent.
  Expected<void> open(bool& other);

  /// Writes a capture and returns its folder. A failure leaves nothing behind.
  [[nodiscard]] Expected<std::string> write(const CaptureNote& note,
                                            const CaptureRing::Blocks& blocks) const;

  /// When the newest capture of this cause was made, by its name.
  [[nodiscard]] std::optional<TimePoint> newest(CaptureCause cause) const;

  /// Names of the captures, oldest first.
  [[nodiscard]] std::vector<std::string> names() const;

  [[nodiscard]] const std::string& directory() const { return directory_; }

 private:
  [[nodiscard]] std::string path(std::string_view name) const;
  Expected<void> make_directory() const;
  [[nodiscard]] Expected<void> make_room(std::uint64_t bytes) const;
  [[nodiscard]] Expected<void> write_new(const CaptureNote& note,
                                         const CaptureRing::Blocks& blocks) const;
  [[nodiscard]] Expected<std::string> put_in_place(const CaptureNote& note) const;
  [[nodiscard]] bool remove(const std::string& name) const;
  void clean_up() const;

  std::string directory_;
  CaptureLimits limits_;
  FileLock lock_;
};

/// "20261130T204835Z"
std::string utc_name(TimePoint time);

}  // namespace vgyro::daemon
