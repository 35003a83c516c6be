#pragma once

// Captures on the disk: a folder each, DIRECTORY/20261130T204835Z-contradicted, with the recording
// and a description. It is written under another name, brought to the disk and renamed, so a folder
// with a capture's name is whole, whatever killed the process. Their number and bytes are limited;
// the oldest go first, by name. Removes nothing that is not its own. One gateway has a directory.
// write() may take long, so it belongs in a thread of its own; the other calls come from the loop.

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

/// What there is to say of a capture beside its frames.
struct CaptureNote {
  CaptureCause cause = CaptureCause::kAsked;
  std::string text;                 ///< the cause, for people
  std::vector<std::string> also;    ///< what happened besides before it was written
  TimePoint at;                     ///< of the cause, on the host's clock
  std::string instance;             ///< of several gateways; empty: the only one
  std::string fingerprint;          ///< of the configuration in use
  std::vector<std::string> inputs;  ///< what is recorded: "can0 101"
  std::string overlaps;             ///< an earlier capture that holds some of the frames too
};

struct CaptureLimits {
  std::size_t count = 0;  ///< captures on the disk
  std::uint64_t bytes = 0;
};

class CaptureStore {
 public:
  static constexpr std::string_view kRecording = "recording.log.xz";
  static constexpr std::string_view kDescription = "capture.json";

  /// Touches nothing yet.
  CaptureStore(std::string directory, CaptureLimits limits);

  /// Once, at the start: makes the directory and removes what a killed writer left. `other` tells
  /// whether another gateway has the directory; that is the one error that does not go away.
  Expected<void> open(bool& other);

  /// Writes a capture; returns its folder. After a failure nothing of it is left.
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
