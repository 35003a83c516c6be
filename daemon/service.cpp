#include "daemon/service.h"

#include <cstddef>
#include <cstdlib>
#include <ctime>
#include <sys/socket.h>
#include <sys/un.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>
#include <utility>

#include <fmt/format.h>

namespace vgyro::daemon {
namespace {

std::string manager_address() {
  const char* address = std::getenv("NOTIFY_SOCKET");  // NOLINT(concurrency-mt-unsafe): at start
  return address == nullptr ? std::string() : std::string(address);
}

}  // namespace

Notifier::Notifier() : Notifier(manager_address()) {}

Notifier::Notifier(const std::string& address) : address_(address) {
  const bool is_known = !address_.empty() && (address_[0] == '/' || address_[0] == '@');
  if (!is_known || address_.size() >= sizeof(sockaddr_un::sun_path)) return;
  fd_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

Notifier::~Notifier() {
  if (fd_ >= 0) ::close(fd_);
}

void Notifier::ready(const std::string& status) {
  tell_surely(fmt::format("READY=1\nSTATUS={}", status));
}

// The time lets systemd distinguish a reload that it requested from any other.
void Notifier::reloading() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  tell_surely(fmt::format("RELOADING=1\nMONOTONIC_USEC={}\nSTATUS=reading the configuration again",
                          std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000));
}

void Notifier::stopping() {
  tell_surely("STOPPING=1\nSTATUS=stopping");
}

void Notifier::status(const std::string& status) {
  tell("STATUS=" + status);
}

void Notifier::alive() {
  tell("WATCHDOG=1");
}

// Not repeated: the next second has a newer status.
void Notifier::tell(const std::string& text) {
  if (fd_ >= 0 && (!pay_debts() || !send(text))) ++failures_;
}

void Notifier::tell_surely(std::string text) {
  if (fd_ < 0 || (pay_debts() && send(text))) return;
  ++failures_;
  if (owed_.size() == kOwedMost) owed_.pop_front();
  owed_.push_back(std::move(text));
}

bool Notifier::pay_debts() {
  while (!owed_.empty() && send(owed_.front()))
    owed_.pop_front();
  return owed_.empty();
}

bool Notifier::send(const std::string& text) {
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  address_.copy(to.sun_path, sizeof(to.sun_path) - 1);
  if (address_[0] == '@') to.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  return ::sendto(fd_, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                  reinterpret_cast<const sockaddr*>(&to), size) >= 0;
}

std::uint64_t watchdog_usec() {
  std::uint64_t usec = 0;
  return sd_watchdog_enabled(0, &usec) > 0 ? usec : 0;
}

}  // namespace vgyro::daemon
