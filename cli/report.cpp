#include <cstdio>

#include <fmt/core.h>

#include "cli/commands.h"

namespace vgyro::cli {

int report(const Error& error) {
  fmt::print(stderr, "error: {}\n", error.message());
  return kBadInput;
}

int report(const std::vector<Error>& errors) {
  for (const Error& error : errors)
    report(error);
  return kBadInput;
}

void warn(const Error& warning) {
  fmt::print(stderr, "warning: {}\n", warning.message());
}

}  // namespace vgyro::cli
