#pragma once

// The gateway's status for people: a table, and one line for logs. Computes text from JSON only. A
// value missing in the status is shown as "–".

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgyro::cli {

struct ViewOptions {
  bool colour = false;
  std::vector<double> rates_dps;  ///< the last ones, oldest first; drawn from two on; NaN: gap
};

std::string status_table(const nlohmann::ordered_json& status, const ViewOptions& options);

/// For a pipe: state, rate and biases, no line end.
std::string status_line(const nlohmann::ordered_json& status);

/// A row of blocks, one for each value, scaled from the smallest to the largest; NaN is a blank.
std::string sparkline(const std::vector<double>& values);

}  // namespace vgyro::cli
