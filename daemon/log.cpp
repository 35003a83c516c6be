#include "daemon/log.h"

#include <array>
#include <cstdlib>
#include <iterator>
#include <string>
#include <sys/stat.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

#include <fmt/format.h>

namespace vgyro::daemon {
namespace {

/// systemd names the stream it made; a redirected stderr is another one.
bool stderr_is_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");  // NOLINT(concurrency-mt-unsafe): at start
  struct stat status {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &status) != 0) return false;
  return fmt::format("{}:{}", status.st_dev, status.st_ino) == std::string_view(stream);
}

}  // namespace

Log::Log() : journal_(stderr_is_journal() ? &sd_journal_sendv : nullptr) {}

bool Log::write_journal(Severity severity, const Subject& subject, std::string_view message) const {
  const std::array<std::string, 5> fields{
      fmt::format("MESSAGE={}", message), fmt::format("PRIORITY={}", static_cast<int>(severity)),
      fmt::format("VGYRO_GYRO={}", subject.gyro), fmt::format("VGYRO_CAUSE={}", subject.cause),
      fmt::format("VGYRO_BUS={}", subject.bus)};
  std::array<iovec, fields.size()> parts{};
  int count = 0;
  for (const std::string& field : fields) {
    if (field.back() == '=') continue;  // nothing to say
    parts[static_cast<std::size_t>(count++)] = {const_cast<char*>(field.data()), field.size()};
  }
  return journal_(parts.data(), count) >= 0;
}

void Log::write(Severity severity, const Subject& subject, fmt::string_view text,
                fmt::format_args args) const {
  const std::string message = fmt::vformat(text, args);
  if (journal_ != nullptr && write_journal(severity, subject, message)) return;
  // Where journald does not answer its stream may; it takes the priority from the line's beginning.
  const std::string line = journal_ != nullptr
                               ? fmt::format("<{}>{}\n", static_cast<int>(severity), message)
                               : fmt::format("vgyrod: {}\n", message);
  // A full or closed stderr must not stop the gateway.
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, line.data(), line.size());
}

}  // namespace vgyro::daemon
