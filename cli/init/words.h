#pragma once

// Names of signals, as a person reads them.

#include <initializer_list>
#include <string>
#include <string_view>

namespace vgyro::cli {

/// Does one of the words stand in the text?
bool has_any(std::string_view text, std::initializer_list<std::string_view> words);

}  // namespace vgyro::cli
