#include "daemon/log.h"

#include <cstdlib>
#include <iterator>
#include <string_view>
#include <sys/stat.h>
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

Log::Log() : to_journal_(stderr_is_journal()) {}

void Log::write(Severity severity, fmt::string_view text, fmt::format_args args) const {
  fmt::memory_buffer line;
  if (to_journal_) {
    fmt::format_to(std::back_inserter(line), "<{}>", static_cast<int>(severity));
  } else {
    fmt::format_to(std::back_inserter(line), "vgyrod: ");
  }
  fmt::vformat_to(std::back_inserter(line), text, args);
  line.push_back('\n');
  // A full or closed stderr must not stop the gateway.
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, line.data(), line.size());
}

}  // namespace vgyro::daemon
