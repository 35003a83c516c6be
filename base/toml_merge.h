#pragma once

// Merges a later TOML file over an earlier one. Keys keep the place where they were written, so
// that errors name the right file and line.

#include <string>
#include <vector>

#include "base/toml_reader.h"

namespace vgyro {

/// Merges a table key by key, and a list of tables table by table in order (further ones are
/// appended); any other value replaces the earlier one.
void merge_toml(toml::table& into, toml::table&& later);

/// A value of a table, and where it was written.
struct TomlOrigin {
  std::string key;    ///< "calibration.rest_s", "gyro[1].bus"
  std::string value;  ///< as TOML
  std::string where;  ///< "file:line"
};

/// The origins of all values, in the order of their keys.
std::vector<TomlOrigin> toml_origins(const toml::table& table);

}  // namespace vgyro
