#pragma once

// Threads of the daemon. Signals stay the event loop's. A LooseThread may be left behind: what
// hangs in a disk, a pipe or the journal must not keep the process from ending. So whatever such a
// thread works on it owns, or shares by a pointer that counts.

#include <chrono>
#include <functional>
#include <memory>
#include <thread>

namespace vgyro::daemon {

/// A thread that no signal comes to. Throws std::system_error where there are no more threads.
std::thread start_thread(std::function<void()> work);

class LooseThread {
 public:
  LooseThread() = default;
  LooseThread(const LooseThread&) = delete;
  LooseThread& operator=(const LooseThread&) = delete;

  /// As start_thread(). One that was started before is left to itself.
  void start(std::function<void()> work);

  /// True when it has ended, or was never started; else, after `patience`, it is left to itself.
  bool finish(std::chrono::milliseconds patience);

 private:
  struct End;
  std::shared_ptr<End> end_;
};

}  // namespace vgyro::daemon
