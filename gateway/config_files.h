#pragma once

// The text of a configuration: its file, and what lies over it in the folder beside it. Of
// vgyro.toml that is vgyro.d/*.toml, in the order of their names; a later file goes over an earlier
// one (base/toml_merge.h). Knows nothing of what the keys mean.

#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/toml_reader.h"

namespace vgyro::gateway {

struct ConfigText {
  toml::table table;               ///< of all files; each key knows its file and line
  std::vector<std::string> files;  ///< the first is the configuration itself
};

Expected<ConfigText> read_config_files(const std::string& path);

/// 16 hexadecimal digits of everything that the meaning of a configuration depends on: its values,
/// wherever they were written and without comments, what the command line says instead, and the
/// bytes of the files that it names. The same on every machine; finds no forger.
std::string config_fingerprint(const toml::table& table, const std::string& overrides,
                               std::span<const std::string> named_files);

}  // namespace vgyro::gateway
