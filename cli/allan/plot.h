#pragma once

// The picture of `vgyro allan`: all three curves together, then each with its bounds, the fitted
// model and its parts.

#include <string>

#include "base/error.h"
#include "cli/allan/report.h"

namespace vgyro::cli {

/// Errors are those of run_gnuplot().
Expected<void> draw_allan(const std::string& path, const AllanReport& report);

}  // namespace vgyro::cli
