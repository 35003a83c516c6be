#pragma once

// Draws pictures with gnuplot; the file's ending selects the format: .svg, .png or .pdf.

#include <iterator>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/error.h"

namespace vgyro::cli {

/// Checks before the long work: the ending, the folder, and whether gnuplot is installed.
Expected<void> check_picture_path(const std::string& path);

/// "set terminal …" for a picture of this size; a pdf is one page, portrait or landscape. There is
/// no "set output", because gnuplot runs a name that begins with "|" as a command.
std::string picture_script(const std::string& path, int width, int height);

/// Quotes a text for a gnuplot script: in single quotes gnuplot expands neither commands nor
/// variables.
std::string gnuplot_text(const std::string& text);

/// Adds to a script.
template <class... T>
void put(std::string& script, fmt::format_string<T...> form, T&&... values) {
  fmt::format_to(std::back_inserter(script), form, std::forward<T>(values)...);
}

/// Runs the script. gnuplot prints the picture, which is written to a file opened here, so that
/// `path` can only be a file name. Error if gnuplot is missing or fails.
Expected<void> run_gnuplot(const std::string& path, const std::string& script);

}  // namespace vgyro::cli
