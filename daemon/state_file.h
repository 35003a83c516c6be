#pragma once

// A small file that is whole at every moment, whatever kills the process or the machine: a new file
// is written beside it, synced, and renamed over the old one. One writer at a time. Independent of
// the contents.

#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro::daemon {

class StateFile {
 public:
  /// Of a file longer than `bytes_max`, read() returns only one byte more. Does not touch the disk
  /// yet.
  StateFile(std::string path, std::size_t bytes_max);

  /// Nothing if there is no file. Never waits for a pipe or a device.
  [[nodiscard]] Expected<std::optional<std::string>> read() const;

  /// After success the file holds the new text, even after a loss of power; after a failure the old
  /// one.
  Expected<void> write(std::string_view text) const;

  /// Whether write() could succeed; the error says what is in the way.
  [[nodiscard]] Expected<void> check_writable() const;

  /// Renames the file to aside_path(), over an earlier one.
  Expected<void> set_aside() const;
  /// Removes the file; no error if there is none.
  Expected<void> remove() const;
  /// Removes what a killed writer left behind.
  void clean_up() const;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& aside_path() const { return aside_path_; }

 private:
  [[nodiscard]] Expected<void> write_new(std::string_view text) const;
  [[nodiscard]] Expected<void> put_in_place() const;

  std::string path_;
  std::string directory_;
  std::string new_path_;
  std::string aside_path_;
  std::size_t bytes_max_;
};

}  // namespace vgyro::daemon
