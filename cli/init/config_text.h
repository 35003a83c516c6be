#pragma once

// The proposal as vgyro.toml. Every doubt is a comment.

#include <string>

#include "cli/init/choice.h"
#include "cli/init/circumstances.h"

namespace vgyro::cli {

struct Proposal {
  const std::vector<Candidate>& candidates;
  const Choice& choice;
  const std::vector<Found>& messages;
  const Circumstances& circumstances;
  const Traffic& traffic;
  std::string folder;  ///< of the file, for the paths in it
};

/// With one gyro only, the second's table is a comment.
std::string config_text(const Proposal& proposal);

}  // namespace vgyro::cli
