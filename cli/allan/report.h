#pragma once

// The report of `vgyro allan`: as text, as JSON (docs/allan.md has the fields), and as TOML to
// paste.

#include <array>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "analysis/pair_noise.h"
#include "analysis/recommendation.h"

namespace vgyro::cli {

struct AllanReport {
  std::string log;
  std::array<std::string, 2> gyro_names;
  analysis::PairNoise noise;
  analysis::Recommendation recommendation;
  std::string axis = {};  ///< axis of the vehicle; empty: two single gyros
  /// For a pair about an axis: the axis of each unit's own that lies along it.
  std::array<std::optional<std::size_t>, 2> sensor_axis = {};
};

std::string to_text(const AllanReport& report);
nlohmann::ordered_json to_json(const AllanReport& report);

/// Lines for the configuration file.
std::string corrector_toml(const AllanReport& report);
/// [[effect]] tables for the model file; empty if no gyro could be evaluated.
std::string model_toml(const AllanReport& report);

}  // namespace vgyro::cli
