#include "cli/log_notes.h"

#include <fmt/core.h>

namespace vgyro::cli {

std::string name_of(const std::vector<std::string>& logs) {
  return logs.size() == 1 ? logs.front()
                          : fmt::format("{} and {} more", logs.front(), logs.size() - 1);
}

std::string count_of(std::uint64_t count, std::string_view item) {
  return fmt::format("{} {}{}", count, item, count == 1 ? "" : "s");
}

std::string passed_over_text(const canlog::LogCounts& counts) {
  std::string text;
  if (counts.other_lines > 0) {
    text += ", " + count_of(counts.other_lines, fmt::format("other {}", counts.item));
  }
  if (counts.skipped_bytes > 0) text += ", " + count_of(counts.skipped_bytes, "stray byte");
  return text.empty() ? text : text + " passed over";
}

}  // namespace vgyro::cli
