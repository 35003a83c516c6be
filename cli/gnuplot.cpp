#include "cli/gnuplot.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include "base/printable.h"
#include "cli/output_file.h"

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
    return fmt::format("pdfcairo size {}in font 'DejaVu Sans,11'",
                       width > height ? "11.7in,8.3" : "8.3in,11.7");
  }
  return {};
}

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// In memory: no folder can be full, and no reader that ends early ends this program.
Expected<File> memory_file(const std::string& path) {
  const int fd = ::memfd_create("vgyro-picture", MFD_CLOEXEC);
  if (fd < 0) return fail(path, "cannot be drawn: " + system_reason());
  return File(::fdopen(fd, "w+b"), &std::fclose);
}

// gnuplot with this input and output, without the user's own settings; its exit status.
Expected<int> run_program(int input, int output) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  std::string name = "gnuplot";
  std::string settings = "--default-settings";
  std::string from_input = "-";
  const std::array<char*, 4> words{name.data(), settings.data(), from_input.data(), nullptr};
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, name.c_str(), &actions, nullptr, words.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return fail({}, system_reason(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return fail({}, system_reason());
  }
  return status;
}

// gnuplot does not notice when its picture cannot be written; OutputFile does.
void copy(std::FILE* from, OutputFile& to) {
  std::rewind(from);
  std::array<char, 65'536> block{};
  while (const std::size_t got = std::fread(block.data(), 1, block.size(), from))
    to.write({block.data(), got});
}

}  // namespace

Expected<void> check_picture_path(const std::string& path) {
  if (terminal_of(path, 1, 1).empty()) {
    return fail(path, "is no kind of picture that can be drawn",
                "a name ending in .svg, .png or .pdf");
  }
  const std::string folder = std::filesystem::path(path).parent_path().string();
  if (::access(folder.empty() ? "." : folder.c_str(), W_OK) != 0) {
    return fail(path, "cannot be written: " + system_reason());
  }
  // Not by trying: a pipe to a program that is not there ends this one.
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

Expected<void> run_gnuplot(const std::string& path, const std::function<void(std::FILE*)>& write) {
  if (auto good = check_picture_path(path); !good) return good;
  const auto script = memory_file(path);
  if (!script) return tl::unexpected(script.error());
  const auto picture = memory_file(path);
  if (!picture) return tl::unexpected(picture.error());
  write(script->get());
  std::rewind(script->get());
  const auto status = run_program(::fileno(script->get()), ::fileno(picture->get()));
  if (!status) return fail(path, "cannot be drawn: gnuplot: " + status.error().what);
  if (*status != 0) return fail(path, "was not drawn: gnuplot failed, as it says above");
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  copy(picture->get(), *file);
  return file->close();
}

}  // namespace vgyro::cli
