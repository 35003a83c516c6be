#include "base/spelling.h"

#include <algorithm>

#include <fmt/core.h>
#include <fmt/ranges.h>

namespace vgyro {

namespace {

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

// A longer list is useless on a terminal.
constexpr std::size_t kListedMax = 12;

}  // namespace

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    c = lower(c);
  return result;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> last(b.size() + 1);
  std::vector<std::size_t> now(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
    last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const bool same = lower(a[i - 1]) == lower(b[j - 1]);
      now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + (same ? 0U : 1U)});
      const bool swapped = i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) &&
                           lower(a[i - 2]) == lower(b[j - 1]);
      if (swapped) now[j] = std::min(now[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(now);
  }
  return last[b.size()];
}

std::optional<std::string> nearest_name(std::string_view name,
                                        const std::vector<std::string>& candidates) {
  std::optional<std::string> best;
  std::size_t best_distance = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::optional<UnknownOption> unknown_option(const std::vector<std::string>& left_over,
                                            const std::vector<std::string>& known) {
  for (const std::string& word : left_over) {
    if (word.size() < 2 || word.front() != '-') continue;
    const std::string name = word.substr(0, word.find('='));
    return UnknownOption{name, nearest_name(name, known)};
  }
  return std::nullopt;
}

std::string suggest_name(std::string_view name, const std::vector<std::string>& candidates) {
  if (candidates.empty()) return {};
  if (const auto near = nearest_name(name, candidates)) {
    return fmt::format("did you mean \"{}\"?", *near);
  }
  const auto shown = static_cast<std::ptrdiff_t>(std::min(candidates.size(), kListedMax));
  return fmt::format("one of: {}{}",
                     fmt::join(candidates.begin(), candidates.begin() + shown, ", "),
                     candidates.size() > kListedMax ? ", …" : "");
}

}  // namespace vgyro
