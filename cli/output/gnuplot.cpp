#include "cli/output/gnuplot.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

#include <fmt/format.h>

#include "base/printable.h"
#include "cli/output/output_file.h"

namespace vgyro::cli {

namespace {

std::string terminal_of(const std::string& path, int width, int height) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".svg") {
    return fmt::format("svg size {},{} dynamic font 'DejaVu Sans,13' background 'white'", width,
                       height);
  }
  if (ending == ".png") {
    return fmt::format("pngcairo size {},{} font 'DejaVu Sans,11'", width, height);
  }
  if (ending == ".pdf") {
    return fmt::format("pdfcairo size {}in font 'DejaVu Sans,{}'",
                       width > height ? "11.7in,8.3" : "8.3in,11.7", width > height ? 11 : 6);
  }
  return {};
}

struct Descriptor {
  explicit Descriptor(int number = -1) : fd(number) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { close(); }
  void close() {
    if (fd >= 0) ::close(std::exchange(fd, -1));
  }
  int fd;
};

// Writes to a nameless file rather than a pipe: a reader that ends early would end this program
// too.
bool write_script(int fd, std::string_view script) {
  while (!script.empty()) {
    const ssize_t written = ::write(fd, script.data(), script.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    script.remove_prefix(static_cast<std::size_t>(written));
  }
  return ::lseek(fd, 0, SEEK_SET) == 0;
}

Expected<pid_t> start_gnuplot(int input, int output) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  std::string name = "gnuplot";
  std::string settings = "--default-settings";  // ignore the user's settings
  std::string from_input = "-";
  const std::array<char*, 4> words{name.data(), settings.data(), from_input.data(), nullptr};
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, name.c_str(), &actions, nullptr, words.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return fail({}, "gnuplot cannot be started: " + system_reason(error));
  return child;
}

std::string read_to_end(int fd) {
  std::string text;
  std::array<char, 65'536> block{};
  while (true) {
    const ssize_t got = ::read(fd, block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return text;  // the exit status shows whether gnuplot has finished
    text.append(block.data(), static_cast<std::size_t>(got));
  }
}

// The output of gnuplot for the script.
Expected<std::string> picture_of(const std::string& script) {
  const Descriptor input(::memfd_create("vgyro-script", MFD_CLOEXEC));
  if (input.fd < 0 || !write_script(input.fd, script)) {
    return fail({}, "no script for gnuplot: " + system_reason());
  }
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return fail({}, "no pipe: " + system_reason());
  const Descriptor from(ends[0]);
  Descriptor to(ends[1]);
  const auto child = start_gnuplot(input.fd, to.fd);
  if (!child) return tl::unexpected(child.error());
  to.close();
  std::string picture = read_to_end(from.fd);
  int status = 0;
  while (::waitpid(*child, &status, 0) < 0 && errno == EINTR) {
  }
  if (status != 0) return fail({}, "gnuplot failed; see its message above");
  return picture;
}

}  // namespace

Expected<void> check_picture_path(const std::string& path) {
  if (terminal_of(path, 1, 1).empty()) {
    return fail(path, "is not a kind of picture that can be drawn",
                "a name ending in .svg, .png or .pdf");
  }
  const std::string folder = std::filesystem::path(path).parent_path().string();
  if (::access(folder.empty() ? "." : folder.c_str(), W_OK) != 0) {
    return fail(path, "cannot be written: " + system_reason());
  }
  // Not by trying to start it: a pipe to a missing program would end this one.
  // NOLINTNEXTLINE(concurrency-mt-unsafe): the program has one thread
  if (::system("command -v gnuplot >/dev/null 2>&1") != 0) {
    return fail(path, "cannot be drawn: there is no gnuplot", "apt-get install gnuplot-nox");
  }
  return {};
}

std::string picture_script(const std::string& path, int width, int height) {
  return fmt::format("set terminal {}\nset encoding utf8\n", terminal_of(path, width, height));
}

std::string gnuplot_text(const std::string& text) {
  std::string result = "'";
  for (const char c : printable(text)) {
    if (c == '\'') result += '\'';
    result += c;
  }
  return result + "'";
}

Expected<void> run_gnuplot(const std::string& path, const std::string& script) {
  if (auto good = check_picture_path(path); !good) return good;
  const auto picture = picture_of(script);
  if (!picture) return fail(path, "was not drawn: " + picture.error().what);
  // gnuplot does not notice if its picture cannot be written.
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  file->write(*picture);
  return file->close();
}

}  // namespace vgyro::cli
