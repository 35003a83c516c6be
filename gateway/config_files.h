#pragma once

// The text of a configuration: its file and the overlays in the folder beside it. For vgyro.toml
// these are vgyro.d/*.toml, in the order of their names; a later file overrides an earlier one
// (base/toml_merge.h). Knows nothing of what the keys mean.

#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/toml_reader.h"

namespace vgyro::gateway {

struct ConfigText {
  toml::table table;               ///< merged from all files; each key keeps its file and line
  std::vector<std::string> files;  ///< the first is the configuration itself
};

Expected<ConfigText> read_config_files(const std::string& path);

/// 16 hexadecimal digits that depend on everything that the meaning of a configuration depends on:
/// its values, regardless of file and comments; the overrides of the command line; the bytes of the
/// files that it names. The same on every machine. No protection against forgery.
std::string config_fingerprint(const toml::table& table, const std::string& overrides,
                               std::span<const std::string> named_files);

}  // namespace vgyro::gateway
