#include "cli/init/words.h"

#include <algorithm>

namespace vgyro::cli {

bool has_any(std::string_view text, std::initializer_list<std::string_view> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](std::string_view word) { return text.find(word) != text.npos; });
}

}  // namespace vgyro::cli
