#pragma once

// Words in the names of signals.

#include <initializer_list>
#include <string>
#include <string_view>

namespace vgyro::cli {

/// Does the text contain one of the words?
bool has_any(std::string_view text, std::initializer_list<std::string_view> words);

}  // namespace vgyro::cli
