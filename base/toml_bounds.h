#pragma once

// A text's shape, before the TOML library sees it: that one goes as deep into its stack as the text
// nests, and a text of a megabyte can nest a megabyte deep. What a person writes stays far below
// these bounds. Judges no syntax: where the text is no TOML, the library says so.

#include <cstddef>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro {

inline constexpr std::size_t kTomlBytesMax = 1U << 20U;
inline constexpr unsigned kTomlLinesMax = 20'000;
inline constexpr std::size_t kTomlLineBytesMax = 8'192;
/// Brackets and braces inside each other; files of ours need two.
inline constexpr int kTomlNestingMax = 16;
/// Of "a.b.c"; files of ours need one.
inline constexpr int kTomlKeyPartsMax = 16;

/// Error with file and line at the first bound that is broken.
Expected<void> check_toml_shape(std::string_view text, const std::string& file);

}  // namespace vgyro
