#include "cli/gyro_names.h"

#include <algorithm>
#include <vector>

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"

namespace vgyro::cli {

namespace {

constexpr std::string_view kGyro = "gyro=";

bool is_number(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

Expected<std::string> numbered(const std::string& condition, const model::GyroNames& gyros) {
  if (!condition.starts_with(kGyro)) return condition;
  const std::string name = condition.substr(kGyro.size());
  if (is_number(name)) return condition;
  if (gyros.any || name == gyros.names[0]) return fmt::format("{}1", kGyro);
  if (name == gyros.names[1]) return fmt::format("{}2", kGyro);
  return fail("--accept", fmt::format("there is no gyro \"{}\"", printable(name)),
              suggest_name(name, {gyros.names.begin(), gyros.names.end()}));
}

}  // namespace

Expected<std::string> with_gyro_numbers(const std::string& word, const model::GyroNames& gyros) {
  std::string result;
  for (std::size_t from = 0; from <= word.size();) {
    const std::size_t end = std::min(word.find(',', from), word.size());
    const auto condition = numbered(word.substr(from, end - from), gyros);
    if (!condition) return condition;
    result += (from == 0 ? "" : ",") + *condition;
    from = end + 1;
  }
  return result;
}

}  // namespace vgyro::cli
