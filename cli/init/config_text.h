#pragma once

// The proposal as vgyro.toml. Every doubt is a comment.

#include <optional>
#include <string>
#include <vector>

#include "cli/init/choice.h"
#include "cli/init/circumstances.h"

namespace vgyro::cli {

/// What --turned says, and what the first gyro says to that.
struct Turn {
  double told_deg = 0.0;
  std::optional<double> seen_deg;  ///< nothing where samples are missing
  [[nodiscard]] bool is_backward() const { return seen_deg && *seen_deg * told_deg < 0.0; }
};

struct Proposal {
  const std::vector<Candidate>& candidates;
  const Choice& choice;
  const std::vector<Found>& messages;
  const Circumstances& circumstances;
  const Traffic& traffic;
  std::string folder;  ///< of the file, for the paths in it
  std::optional<Turn> turn;
  std::vector<std::string> remarks;  ///< what stands above all
};

/// With one gyro only, the second's table is a comment.
std::string config_text(const Proposal& proposal);

}  // namespace vgyro::cli
