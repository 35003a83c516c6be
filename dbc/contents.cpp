#include "dbc/contents.h"

#include <algorithm>
#include <utility>

#include <fmt/core.h>

namespace vgyro::dbc {

void Diagnostics::add(unsigned line, std::string what) {
  if (shown_.size() < kShownMax) {
    shown_.push_back({line, std::move(what)});
    return;
  }
  if (hidden_++ == 0) first_hidden_line_ = line;
}

std::vector<Diagnostic> Diagnostics::take() {
  std::stable_sort(shown_.begin(), shown_.end(),
                   [](const Diagnostic& a, const Diagnostic& b) { return a.line < b.line; });
  if (hidden_ > 0) shown_.push_back({first_hidden_line_, fmt::format("and {} more", hidden_)});
  return std::move(shown_);
}

SplitId split_id(FileId file_id) {
  constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;
  constexpr std::uint32_t kStandardIdMax = 0x7FF;
  const bool extended = (file_id & kExtendedBit) != 0 || file_id > kStandardIdMax;
  return {file_id & kExtendedMask, extended};
}

}  // namespace vgyro::dbc
