#include "cli/gap/accept.h"

#include <fmt/core.h>

#include "base/printable.h"
#include "base/spelling.h"
#include "model/catalogue.h"

namespace vgyro::cli {

namespace {

constexpr const char* kWhere = "--accept";
constexpr const char* kRemedy =
    "gyro=1 or gyro=2, kind=KIND, both with a comma between them, or likeliest";

Expected<void> take(const std::string& condition, gap::Acceptance& acceptance) {
  if (condition == "gyro=1" || condition == "gyro=2") {
    acceptance.gyro = condition.back() == '1' ? 0 : 1;
    return {};
  }
  constexpr std::string_view kKind = "kind=";
  if (!condition.starts_with(kKind)) {
    return fail(kWhere, fmt::format("\"{}\" names no reading", printable(condition)), kRemedy);
  }
  const std::string name = condition.substr(kKind.size());
  const model::KindInfo* kind = model::find_kind(name);
  if (kind == nullptr) {
    return fail(kWhere, fmt::format("there is no kind \"{}\"", printable(name)),
                suggest_name(name, model::kind_names()) + "; `vgyro model list` shows them all");
  }
  acceptance.kind = kind->kind;
  return {};
}

}  // namespace

Expected<gap::Acceptance> acceptance_from(const std::string& word) {
  gap::Acceptance acceptance;
  if (word == "likeliest") return acceptance;
  for (std::size_t from = 0; from <= word.size();) {
    const std::size_t end = std::min(word.find(',', from), word.size());
    const auto taken = take(word.substr(from, end - from), acceptance);
    if (!taken) return tl::unexpected(taken.error());
    from = end + 1;
  }
  return acceptance;
}

}  // namespace vgyro::cli
