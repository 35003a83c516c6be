#pragma once

// JSON as every command writes it: indented, and valid whatever bytes a name from a file holds.

#include <string>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace vgyro::cli {

/// Ends with a newline; replaces bytes that are not UTF-8.
std::string json_text(const nlohmann::ordered_json& json);
/// Writes to a file; "-" is standard output. The error names the file and the reason.
Expected<void> write_json(const std::string& path, const nlohmann::ordered_json& json);

}  // namespace vgyro::cli
