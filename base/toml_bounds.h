#pragma once

// Limits the shape of a text before the TOML library parses it: the library's stack grows with the
// nesting of the text, and a text of a megabyte can nest a megabyte deep. Files written by people
// stay far below these bounds. Does not check syntax: the library reports texts that are not TOML.

#include <cstddef>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro {

inline constexpr std::size_t kTomlBytesMax = 1U << 20U;
inline constexpr unsigned kTomlLinesMax = 20'000;
inline constexpr std::size_t kTomlLineBytesMax = 8'192;
/// Nesting of brackets and braces; files of the product need two.
inline constexpr int kTomlNestingMax = 16;
/// Parts of "a.b.c"; files of the product need one.
inline constexpr int kTomlKeyPartsMax = 16;

/// Error with file and line at the first bound that is exceeded.
Expected<void> check_toml_shape(std::string_view text, const std::string& file);

}  // namespace vgyro
