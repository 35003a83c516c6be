#pragma once

// Pictures are drawn by gnuplot; the file's ending says the format: .svg, .png or .pdf.

#include <iterator>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/error.h"

namespace vgyro::cli {

/// For a check before the long work: the ending, the folder, and whether there is a gnuplot.
Expected<void> check_picture_path(const std::string& path);

/// "set terminal …" for a picture of that size; pdf is one page, upright or not. There is no "set
/// output": gnuplot takes a name that begins with "|" for a command.
std::string picture_script(const std::string& path, int width, int height);

/// Quoted for a gnuplot script, where it is text and nothing else: in single quotes gnuplot knows
/// neither commands nor variables.
std::string gnuplot_text(const std::string& text);

/// Adds to a script.
template <class... T>
void put(std::string& script, fmt::format_string<T...> form, T&&... values) {
  fmt::format_to(std::back_inserter(script), form, std::forward<T>(values)...);
}

/// Runs the script; what gnuplot prints is the picture, and goes into the file that is opened here,
/// by a name that can be nothing else. Error when gnuplot is missing or fails.
Expected<void> run_gnuplot(const std::string& path, const std::string& script);

}  // namespace vgyro::cli
