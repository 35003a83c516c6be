#pragma once

// Errors and warnings on stderr, in the one form that all commands use.

#include <vector>

#include "base/error.h"

namespace vgyro::cli {

/// "error: where: what; remedy"; returns kBadInput.
int report(const Error& error);
/// Reports the first errors, and the number of others.
int report(const std::vector<Error>& errors);
/// "warning: where: what; remedy"
void warn(const Error& warning);

}  // namespace vgyro::cli
