#pragma once

// The [[gyro]] tables: a single gyro, or a whole unit of two or three axes. Errors carry file and
// line, as in gateway/config.

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "base/toml_reader.h"
#include "gateway/input_conflicts.h"
#include "gateway/plan.h"
#include "gateway/signal_resolver.h"

namespace vgyro::gateway {

/// Shared by all tables of a configuration.
struct TableContext {
  const std::string& file;    ///< the configuration's own path
  const std::string& folder;  ///< DBC paths are relative to it
  DatabaseCache& cache;
  std::vector<std::string>& buses;
  std::set<BusFile>& bus_files;
  std::vector<Error>& errors;
  std::vector<Error>& warnings;
};

/// Reads one [[gyro]] table; nothing after an error. For a whole unit, GyroPlan::axes are filled.
std::optional<GyroPlan> read_gyro(const toml::table& table, std::size_t index,
                                  TableContext context);

struct Limits {
  double low = 0.0;
  double high = 0.0;
  bool above_low = false;  ///< `low` itself is excluded
};

/// A number within limits; nothing after an error, or if the key is absent.
std::optional<double> number_within(TomlReader& reader, std::string_view key, const Limits& limits,
                                    std::string_view unit);

/// The key `sign` of any table that names rates, or a similar key: 1 or -1; nothing if it is
/// absent, or after an error.
std::optional<double> sign_of(TomlReader& reader, std::string_view key = "sign");
/// The key `source_address` of any table that reads a message.
void read_source_address(TomlReader& reader, const dbc::Message& message, FrameMatch& match);

}  // namespace vgyro::gateway
