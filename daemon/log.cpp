#include "daemon/log.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <new>
#include <poll.h>
#include <string>
#include <sys/stat.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <fmt/format.h>

namespace vgyro::daemon {
namespace {

/// systemd names the stream that it made for stderr; a redirected stderr is another one.
bool stderr_is_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");  // NOLINT(concurrency-mt-unsafe): at start
  struct stat status {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &status) != 0) return false;
  return fmt::format("{}:{}", status.st_dev, status.st_ino) == std::string_view(stream);
}

bool write_journal(Log::Journal journal, const Line& line) {
  const std::array<std::string, 5> fields{
      fmt::format("MESSAGE={}", line.message),
      fmt::format("PRIORITY={}", static_cast<int>(line.severity)),
      fmt::format("VGYRO_GYRO={}", line.gyro), fmt::format("VGYRO_CAUSE={}", line.cause),
      fmt::format("VGYRO_BUS={}", line.bus)};
  std::array<iovec, fields.size()> parts{};
  int count = 0;
  for (const std::string& field : fields) {
    if (field.back() == '=') continue;  // empty
    parts[static_cast<std::size_t>(count++)] = {const_cast<char*>(field.data()), field.size()};
  }
  return journal(parts.data(), count) >= 0;
}

// Another process that shares stderr may have made it non-blocking.
bool write_stderr(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
    if (written >= 0) {
      text.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN) {
      pollfd stream{.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
      ::poll(&stream, 1, -1);
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

bool write_line(Log::Journal journal, const Line& line) {
  if (journal == nullptr) return write_stderr(fmt::format("vgyrod: {}\n", line.message));
  if (write_journal(journal, line)) return true;
  // If journald's socket fails, its stream may still work; it reads the priority from the line's
  // prefix.
  return write_stderr(fmt::format("<{}>{}\n", static_cast<int>(line.severity), line.message));
}

}  // namespace

Log::Log() : Log(stderr_is_journal() ? &sd_journal_sendv : nullptr) {}

Log::Log(Journal journal)
    : lines_([journal](const Line& line) { return write_line(journal, line); }) {}

void Log::toggle_debug() {
  if (debugging_) notice("debug messages end; the configured level applies");
  debugging_ = !debugging_;
  if (debugging_) notice("debug messages begin; SIGUSR1 ends them");
}

void Log::write(Severity severity, const Subject& subject, fmt::string_view text,
                fmt::format_args args) {
  if (!is_wanted(severity)) return;
  try {
    lines_.put({.severity = severity,
                .message = fmt::vformat(text, args),
                .gyro = std::string(subject.gyro),
                .cause = std::string(subject.cause),
                .bus = std::string(subject.bus)});
  } catch (const std::bad_alloc&) {  // the caller goes on
    lines_.count_lost();
  }
}

}  // namespace vgyro::daemon
