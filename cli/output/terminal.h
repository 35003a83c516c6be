#pragma once

// Prints texts for people, to standard output and to stderr. Control characters in them are shown,
// not executed (base/printable.h). A text that cannot be written does not end the program;
// finish_output() reports at the end that standard output lost something.

#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>

#include "base/error.h"

namespace vgyro::cli {

/// Call first: if the caller has closed a standard stream, a file opened later must not get its
/// number.
void keep_standard_streams();

void put_text(std::FILE* to, std::string_view text);

template <class... T>
void say(fmt::format_string<T...> form, T&&... values) {
  put_text(stdout, fmt::format(form, std::forward<T>(values)...));
}

/// Prints to stderr.
template <class... T>
void tell(fmt::format_string<T...> form, T&&... values) {
  put_text(stderr, fmt::format(form, std::forward<T>(values)...));
}

/// Prints raw text that holds the program's own control sequences; names in it must be printable().
void draw(std::FILE* to, std::string_view text);

/// Flushes standard output; false if any of it has been lost.
bool flush_output();

/// Flushes standard output. Error, with the cause, if any of it has been lost.
Expected<void> finish_output();

}  // namespace vgyro::cli
