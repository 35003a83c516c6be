#include "daemon/line_queue.h"

#include <utility>

#include <fmt/format.h>

namespace vgyro::daemon {
namespace {

// Wait at the end of the process; a journal that works takes milliseconds.
constexpr std::chrono::milliseconds kLastPatience{1000};

Line remark_of(std::uint64_t lost) {
  return {
      .severity = Severity::kWarning,
      .message = fmt::format("{} lines of this log are missing here: nothing read the log", lost),
      .gyro = {},
      .cause = "log_lost",
      .bus = {}};
}

}  // namespace

struct LineQueue::Shared {
  struct Entry {
    Line line;
    std::uint64_t lost_before = 0;  ///< lines lost right before this one
  };

  explicit Shared(Write the_write) : write(std::move(the_write)) {}
  void write_what_comes();
  void write_next(std::unique_lock<std::mutex>& lock);
  void count_lost() {
    ++lost;
    ++did_not_fit;
  }

  const Write write;
  std::mutex mutex;  ///< guards what follows
  std::condition_variable wake;
  std::condition_variable idle;
  std::deque<Entry> entries;
  std::uint64_t lost = 0;
  std::uint64_t did_not_fit = 0;  ///< of `lost`: after the last entry
  std::uint64_t failed = 0;       ///< of `lost`: could not be written, not reported yet
  bool writing = false;
  bool closed = false;
};

void LineQueue::Shared::write_what_comes() {
  std::unique_lock lock(mutex);
  for (;;) {
    if (entries.empty() && did_not_fit == 0) {
      idle.notify_all();
      if (closed) return;
      wake.wait(lock);
      continue;
    }
    write_next(lock);
  }
}

// Writes the next line or, if none is left, how many did not fit after the last one.
void LineQueue::Shared::write_next(std::unique_lock<std::mutex>& lock) {
  const bool has_line = !entries.empty();
  Entry entry;
  if (has_line) {
    entry = std::move(entries.front());
    entries.pop_front();
  } else {
    entry.lost_before = std::exchange(did_not_fit, 0);
  }
  const std::uint64_t missing = entry.lost_before + std::exchange(failed, 0);
  writing = true;
  lock.unlock();
  const bool said = missing == 0 || write(remark_of(missing));
  const bool written = said && (!has_line || write(entry.line));
  lock.lock();
  writing = false;
  if (!said) failed += missing;
  if (has_line && !written) {
    ++lost;
    ++failed;
  }
}

LineQueue::LineQueue(Write write) : shared_(std::make_shared<Shared>(std::move(write))) {
  thread_.start([shared = shared_] { shared->write_what_comes(); });
}

LineQueue::~LineQueue() {
  {
    const std::scoped_lock lock(shared_->mutex);
    shared_->closed = true;
  }
  shared_->wake.notify_one();
  thread_.finish(kLastPatience);
}

void LineQueue::put(Line line) {
  {
    const std::scoped_lock lock(shared_->mutex);
    if (shared_->entries.size() >= kLinesMost) {
      shared_->count_lost();
      return;
    }
    shared_->entries.push_back({std::move(line), shared_->did_not_fit});
    shared_->did_not_fit = 0;
  }
  shared_->wake.notify_one();
}

void LineQueue::count_lost() {
  {
    const std::scoped_lock lock(shared_->mutex);
    shared_->count_lost();
  }
  shared_->wake.notify_one();
}

bool LineQueue::flush(std::chrono::milliseconds patience) {
  std::unique_lock lock(shared_->mutex);
  return shared_->idle.wait_for(lock, patience, [&] {
    return shared_->entries.empty() && shared_->did_not_fit == 0 && !shared_->writing;
  });
}

std::uint64_t LineQueue::lost() const {
  const std::scoped_lock lock(shared_->mutex);
  return shared_->lost;
}

}  // namespace vgyro::daemon
