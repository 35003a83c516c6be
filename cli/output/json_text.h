#pragma once

// JSON as every command writes it: indented, and whole whatever bytes a name from a file holds.

#include <string>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace vgyro::cli {

/// With a newline at the end; bytes that are no UTF-8 are replaced.
std::string json_text(const nlohmann::ordered_json& json);
/// To a file; "-" is standard output. The error names the file and the reason.
Expected<void> write_json(const std::string& path, const nlohmann::ordered_json& json);

}  // namespace vgyro::cli
