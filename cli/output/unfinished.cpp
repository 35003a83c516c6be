#include "cli/output/unfinished.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

#include "base/printable.h"

namespace vgyro::cli {

namespace {

// What the handler may access: memory that never moves.
struct Slot {
  std::atomic<bool> used{false};
  std::array<char, PATH_MAX> temporary{};
  std::array<char, NAME_MAX + 1> shown{};
};
std::array<Slot, Unfinished::kMost> slots;
std::atomic<bool> finish_on_interrupt{false};
constexpr std::array<int, 4> kSignals{SIGHUP, SIGINT, SIGPIPE, SIGTERM};
static_assert(std::atomic<bool>::is_always_lock_free, "a handler may not wait for a lock");

// If standard error is closed, nothing can be done here.
void say_in_handler(const char* text) {
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, text, std::strlen(text));
}

void remove_unfinished(bool say) {
  for (Slot& slot : slots) {
    if (!slot.used.exchange(false)) continue;
    ::unlink(slot.temporary.data());
    if (!say) continue;
    say_in_handler("interrupted: ");
    say_in_handler(slot.shown.data());
    say_in_handler(" was not written\n");
  }
}

void end(int signal_number) {
  const int before = errno;
  if (signal_number == SIGINT && finish_on_interrupt.exchange(false)) {
    say_in_handler(
        "\ninterrupted: finishing with what has arrived; interrupt again to end at once\n");
    errno = before;
    return;
  }
  // SIGPIPE needs no message: the reader has closed the pipe itself.
  remove_unfinished(signal_number != SIGPIPE);
  ::signal(signal_number, SIG_DFL);
  ::raise(signal_number);
}

mode_t permissions_at(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0) return info.st_mode & 07777U;
  const mode_t mask = ::umask(0);  // the only way to read it; a single thread opens files
  ::umask(mask);
  return 0666U & ~mask;
}

std::size_t take_slot(const std::string& temporary, const std::string& shown) {
  const auto free =
      std::find_if(slots.begin(), slots.end(), [](const Slot& slot) { return !slot.used; });
  if (free == slots.end() || temporary.size() >= free->temporary.size()) return slots.size();
  std::copy_n(temporary.c_str(), temporary.size() + 1, free->temporary.begin());
  const std::string name = printable(shown).substr(0, free->shown.size() - 1);
  std::copy_n(name.c_str(), name.size() + 1, free->shown.begin());
  free->used = true;
  return static_cast<std::size_t>(free - slots.begin());
}

}  // namespace

void guard_unfinished() {
  for (const int number : kSignals) {
    struct sigaction before {};
    ::sigaction(number, nullptr, &before);
    if (before.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = end;
    action.sa_flags = SA_RESTART;
    ::sigemptyset(&action.sa_mask);
    ::sigaction(number, &action, nullptr);
  }
}

HoldSignals::HoldSignals() {
  sigset_t held{};
  ::sigemptyset(&held);
  for (const int number : kSignals)
    ::sigaddset(&held, number);
  ::pthread_sigmask(SIG_BLOCK, &held, &before_);
}

HoldSignals::~HoldSignals() {
  ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

FinishOnInterrupt::FinishOnInterrupt(bool wanted) {
  finish_on_interrupt = wanted;
}

FinishOnInterrupt::~FinishOnInterrupt() {
  finish_on_interrupt = false;
}

Unfinished::Unfinished(int fd, std::size_t slot, std::string path, std::string shown)
    : fd_(fd), slot_(slot), path_(std::move(path)), shown_(std::move(shown)) {}

Unfinished::Unfinished(Unfinished&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      slot_(std::exchange(other.slot_, kNone)),
      path_(std::move(other.path_)),
      shown_(std::move(other.shown_)) {}

Unfinished::~Unfinished() {
  if (slot_ != kNone && slots[slot_].used.exchange(false)) {
    ::unlink(slots[slot_].temporary.data());
  }
}

Expected<Unfinished> Unfinished::beside(const std::string& path, const std::string& shown) {
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "" : path.substr(0, slash + 1);
  std::string temporary = folder + ".vgyro-unfinished-XXXXXX";
  const mode_t permissions = permissions_at(path);
  const int fd = ::mkostemp(temporary.data(), O_CLOEXEC);
  if (fd < 0) return fail(shown, "cannot be written: " + system_reason());
  const std::size_t slot = take_slot(temporary, shown);
  if (slot == kNone) {
    ::close(fd);
    ::unlink(temporary.c_str());
    return fail(shown, "cannot be written: too many files at once");
  }
  // A file system without permissions gives all files the same ones.
  [[maybe_unused]] const int ignored = ::fchmod(fd, permissions);
  return Unfinished(fd, slot, path, shown);
}

Expected<void> Unfinished::keep() {
  Slot& slot = slots[slot_];
  if (::rename(slot.temporary.data(), path_.c_str()) != 0) {
    return fail(shown_, "cannot be written: " + system_reason());
  }
  slot.used = false;
  slot_ = kNone;
  return {};
}

}  // namespace vgyro::cli
