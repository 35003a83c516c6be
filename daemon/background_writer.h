#pragma once

// Writes texts in a thread of its own, for a disk may take its time and a rate that waits for it is
// worth nothing. Of several texts the newest is written.

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

  /// The thread begins with the first text; `write` runs there.
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
