#include "cli/output/terminal.h"

#include <cerrno>
#include <fcntl.h>
#include <unistd.h>

#include "base/printable.h"

namespace vgyro::cli {

namespace {

// The first cause; stdio only records that there was an error. Used by one thread.
int output_errno = 0;

void note(bool good) {
  if (!good && output_errno == 0) output_errno = errno == 0 ? EIO : errno;
}

}  // namespace

void keep_standard_streams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(fd, F_GETFD) >= 0) continue;
    // Opened in the wrong direction, so that reading or writing fails as on a closed stream.
    const int placed = ::open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);
    if (placed > STDERR_FILENO) ::close(placed);
  }
}

void draw(std::FILE* to, std::string_view text) {
  errno = 0;
  const bool good = std::fwrite(text.data(), 1, text.size(), to) == text.size();
  if (to == stdout) note(good);
}

void put_text(std::FILE* to, std::string_view text) {
  draw(to, printable_lines(text));
}

bool flush_output() {
  errno = 0;
  note(std::fflush(stdout) == 0);
  return output_errno == 0;
}

Expected<void> finish_output() {
  if (flush_output()) return {};
  return fail("standard output", "cannot be written: " + system_reason(output_errno));
}

}  // namespace vgyro::cli
