#pragma once

// Writes texts in a separate thread, because a disk may be slow and no rate may wait for it. If
// texts come faster than they are written, only the newest is.

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/error.h"

namespace vgyro::daemon {

class BackgroundWriter {
 public:
  using Write = std::function<Expected<void>(const std::string&)>;

  /// `write` runs in the thread, which starts with the first text.
  explicit BackgroundWriter(Write write) : write_(std::move(write)) {}
  BackgroundWriter(const BackgroundWriter&) = delete;
  BackgroundWriter& operator=(const BackgroundWriter&) = delete;
  ~BackgroundWriter() { finish(); }

  void put(std::string text);

  /// The result of the newest text that was written; returned once.
  std::optional<Expected<void>> take_result();

  /// Returns when the last text is written. Nothing may be put afterwards.
  void finish();

 private:
  void write_what_comes();

  Write write_;
  std::thread thread_;
  std::mutex mutex_;  ///< guards what follows
  std::condition_variable wake_;
  bool stopping_ = false;
  std::optional<std::string> to_write_;
  std::optional<Expected<void>> result_;
};

}  // namespace vgyro::daemon
