#include "cli/log_notes.h"

#include <iterator>

#include <fmt/format.h>

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

std::string log_text(const std::string& path, const canlog::LogCounts& counts, bool xl_used) {
  std::string text = fmt::format("{}: {} frames", path, counts.frames);
  auto to = std::back_inserter(text);
  if (counts.xl_frames > 0) {
    fmt::format_to(to, ", {} CAN XL frames{}", counts.xl_frames, xl_used ? "" : " passed over");
  }
  if (counts.malformed_lines > 0) {
    fmt::format_to(to, ", {} not understood", count_of(counts.malformed_lines, counts.item));
  }
  text += passed_over_text(counts);
  if (counts.cut_off_lines > 0) {
    fmt::format_to(to, "; the log ends inside {} {}, which was not used", counts.item,
                   counts.lines + 1);
  }
  text += '\n';
  for (const canlog::MalformedLine& bad : counts.first_malformed)
    fmt::format_to(to, "  {} {}: {}\n", counts.item, bad.line, bad.why);
  return text;
}

}  // namespace vgyro::cli
