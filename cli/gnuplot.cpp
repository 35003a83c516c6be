#include "cli/gnuplot.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <unistd.h>

#include <fmt/format.h>

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
  return fmt::format("set terminal {}\nset output {}\nset encoding utf8\n",
                     terminal_of(path, width, height), gnuplot_text(path));
}

std::string gnuplot_text(const std::string& text) {
  std::string result = "'";
  for (const char c : text) {
    if (c == '\'') result += '\'';
    if (c != '\n') result += c;
  }
  return result + "'";
}

Expected<void> run_gnuplot(const std::string& path, const std::function<void(std::FILE*)>& write) {
  if (auto good = check_picture_path(path); !good) return good;
  std::FILE* to = std::fopen(path.c_str(), "wb");
  if (to == nullptr) return fail(path, "cannot be written: " + system_reason());
  std::fclose(to);
  std::FILE* gnuplot = ::popen("gnuplot", "w");
  if (gnuplot == nullptr) return fail(path, "cannot be drawn: gnuplot could not be started");
  write(gnuplot);
  if (::pclose(gnuplot) == 0) return {};
  return fail(path, "was not drawn: gnuplot failed, as it says above");
}

}  // namespace vgyro::cli
