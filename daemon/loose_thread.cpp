#include "daemon/loose_thread.h"

#include <condition_variable>
#include <csignal>
#include <mutex>
#include <utility>

namespace vgyro::daemon {

std::thread start_thread(std::function<void()> work) {
  sigset_t all;
  sigset_t before;
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_BLOCK, &all, &before);
  try {
    std::thread thread(std::move(work));
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
    return thread;
  } catch (...) {
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
    throw;
  }
}

struct LooseThread::End {
  std::mutex mutex;
  std::condition_variable reached;
  bool is_reached = false;
};

void LooseThread::start(std::function<void()> work) {
  auto end = std::make_shared<End>();
  start_thread([end, work = std::move(work)]() mutable {
    work();
    work = nullptr;  // frees what it shares before finish() returns
    const std::scoped_lock lock(end->mutex);
    end->is_reached = true;
    end->reached.notify_all();
  }).detach();
  end_ = std::move(end);
}

bool LooseThread::finish(std::chrono::milliseconds patience) {
  const std::shared_ptr<End> end = std::exchange(end_, nullptr);
  if (end == nullptr) return true;
  std::unique_lock lock(end->mutex);
  return end->reached.wait_for(lock, patience, [&] { return end->is_reached; });
}

}  // namespace vgyro::daemon
