#include "daemon/background_writer.h"

#include <utility>

#include "daemon/loose_thread.h"

namespace vgyro::daemon {

void BackgroundWriter::put(std::string text) {
  if (!thread_.joinable()) thread_ = start_thread([this] { write_what_comes(); });
  {
    const std::scoped_lock lock(mutex_);
    to_write_ = std::move(text);
  }
  wake_.notify_one();
}

std::optional<Expected<void>> BackgroundWriter::take_result() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(result_, std::nullopt);
}

void BackgroundWriter::finish() {
  if (!thread_.joinable()) return;
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void BackgroundWriter::write_what_comes() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [this] { return stopping_ || to_write_; });
    if (!to_write_) return;
    const std::string text = *std::exchange(to_write_, std::nullopt);
    lock.unlock();
    const Expected<void> written = write_(text);
    lock.lock();
    result_ = written;
  }
}

}  // namespace vgyro::daemon
