#pragma once

// Evidence files: of a drive, as `vgyro gap --evidence` and `vgyro allan --evidence` leave it, and
// of a pool, as `vgyro fleet` does. docs/fleet.md describes both. A file is read without trust.

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/error.h"
#include "cli/gap/report.h"
#include "fleet/pool.h"
#include "gap/recording.h"

namespace vgyro::cli {

inline constexpr int kEvidenceFormat = 1;

struct DriveOfPair {
  const GapSubject& subject;
  const std::vector<gap::Recording>& recordings;
  gap::DriveEvidence evidence;
  std::array<bool, 2> flipped{};  ///< the readings are against the sensor's sign
  std::string verdict;            ///< of vgyro gap; empty: of vgyro allan
};

/// One line, with a newline at its end. `files`: those that made up configuration and model.
std::string drive_text(const DriveOfPair& drive, const std::vector<std::string>& config_files,
                       const std::string& model_file);

/// Adds every line of an evidence file: drives, or pools. Returns how many drives were there
/// already. Error: where, what is wrong, and what would be right.
Expected<std::size_t> add_evidence(const std::string& path, fleet::Pool& pool);

/// The pool as one line.
std::string pool_text(const fleet::Pool& pool);

}  // namespace vgyro::cli
