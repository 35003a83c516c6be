#pragma once

// Threads of the daemon. They block all signals, which the event loop handles. A LooseThread may be
// left behind: one that hangs on a disk, a pipe or the journal must not keep the process from
// ending. So it must own its data, or share them by std::shared_ptr.

#include <chrono>
#include <functional>
#include <memory>
#include <thread>

namespace vgyro::daemon {

/// Starts a thread that receives no signals. Throws std::system_error if there are no more threads.
std::thread start_thread(std::function<void()> work);

class LooseThread {
 public:
  LooseThread() = default;
  LooseThread(const LooseThread&) = delete;
  LooseThread& operator=(const LooseThread&) = delete;

  /// Like start_thread(). A thread that was started before is left running.
  void start(std::function<void()> work);

  /// Waits at most `patience`. True if the thread has ended or was never started; otherwise it is
  /// left running.
  bool finish(std::chrono::milliseconds patience);

 private:
  struct End;
  std::shared_ptr<End> end_;
};

}  // namespace vgyro::daemon
