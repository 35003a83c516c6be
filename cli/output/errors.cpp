#include "cli/output/errors.h"

#include <algorithm>

#include "cli/exit_code.h"
#include "cli/output/terminal.h"

namespace vgyro::cli {

int report(const Error& error) {
  tell("error: {}\n", error.message());
  return kBadInput;
}

int report(const std::vector<Error>& errors) {
  // A wrong file can cause an error for every line.
  constexpr std::size_t kMost = 40;
  for (std::size_t i = 0; i < std::min(errors.size(), kMost); ++i)
    report(errors[i]);
  if (errors.size() > kMost) tell("error: … and {} more\n", errors.size() - kMost);
  return kBadInput;
}

void warn(const Error& warning) {
  tell("warning: {}\n", warning.message());
}

}  // namespace vgyro::cli
