#pragma once

// The evidence of one drive, read without trust; docs/fleet.md describes its fields.

#include <string_view>

#include "cli/fleet/json_reader.h"
#include "fleet/drive.h"

namespace vgyro::cli {

/// `line`: the text of `json`; its digest distinguishes two evidences of one recording. Throws
/// Fault.
fleet::Drive drive_of(JsonValue json, std::string_view line);

}  // namespace vgyro::cli
