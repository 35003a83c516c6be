#pragma once

// Texts for people: the one way to standard output and to stderr. Control characters in them are
// shown, not obeyed (base/printable.h). A text that cannot be written ends nothing; that standard
// output lost something is told at the end, by finish_output().

#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "base/error.h"

namespace vgyro::cli {

/// Where the caller has closed one of the three standard streams, its number must not go to a file
/// that is opened later. First of all.
void keep_standard_streams();

void put_text(std::FILE* to, std::string_view text);

template <class... T>
void say(fmt::format_string<T...> form, T&&... values) {
  put_text(stdout, fmt::format(form, std::forward<T>(values)...));
}

/// On stderr.
template <class... T>
void tell(fmt::format_string<T...> form, T&&... values) {
  put_text(stderr, fmt::format(form, std::forward<T>(values)...));
}

/// Raw, for a text that holds sequences of our own for the terminal; names in it are printable().
void draw(std::FILE* to, std::string_view text);

/// Flushes standard output; false when any of it was lost so far.
bool flush_output();

/// Flushes standard output. Error: some of it was lost so far, and why.
Expected<void> finish_output();

}  // namespace vgyro::cli
