#pragma once

// The proposal as the text of vgyro.toml. Every doubt is a comment.

#include <optional>
#include <string>
#include <vector>

#include "cli/init/choice.h"
#include "cli/init/circumstances.h"

namespace vgyro::cli {

/// The turn stated by --turned, and the turn that the first gyro measured.
struct Turn {
  double told_deg = 0.0;
  std::optional<double> seen_deg;  ///< nothing if samples are missing
  [[nodiscard]] bool is_backward() const { return seen_deg && *seen_deg * told_deg < 0.0; }
};

struct Proposal {
  const std::vector<Candidate>& candidates;
  const Choice& choice;
  const std::vector<Found>& messages;
  const Circumstances& circumstances;
  const Traffic& traffic;
  std::string folder;  ///< folder of the file, for the paths in it
  std::optional<Turn> turn;
  std::vector<std::string> remarks;  ///< comments at the top
};

/// With a single gyro, the table of the second one is a comment.
std::string config_text(const Proposal& proposal);

}  // namespace vgyro::cli
