#pragma once

// One TOML table laid over another, as a later file over an earlier one. Keys keep the place where
// they were written, so that complaints name the right file and line.

#include <string>
#include <vector>

#include "base/toml_reader.h"

namespace vgyro {

/// A table is merged key by key, a list of tables table by table in their order (what is beyond the
/// earlier list is added to it), anything else takes the place of what was there.
void merge_toml(toml::table& into, toml::table&& later);

/// A value of a table, and where it was written.
struct TomlOrigin {
  std::string key;    ///< "calibration.rest_s", "gyro[1].bus"
  std::string value;  ///< as TOML
  std::string where;  ///< "file:line"
};

/// Of every value, in the order of their keys.
std::vector<TomlOrigin> toml_origins(const toml::table& table);

}  // namespace vgyro
