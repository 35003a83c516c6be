#include "cli/commands.h"
#include "cli/terminal.h"

namespace vgyro::cli {

int report(const Error& error) {
  tell("error: {}\n", error.message());
  return kBadInput;
}

int report(const std::vector<Error>& errors) {
  for (const Error& error : errors)
    report(error);
  return kBadInput;
}

void warn(const Error& warning) {
  tell("warning: {}\n", warning.message());
}

}  // namespace vgyro::cli
