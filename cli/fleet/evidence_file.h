#pragma once

// Evidence files: of a drive, as `vgyro gap --evidence` and `vgyro allan --evidence` write it, and
// of a pool, as `vgyro fleet` writes it. docs/fleet.md describes both. Files are not trusted.

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
  std::array<bool, 2> flipped{};  ///< the readings have the opposite sign of the sensor's
  std::string verdict;            ///< of vgyro gap; empty: evidence of vgyro allan
};

/// One line, with a newline at its end. The digests of `config_files` and `model_file` are part of
/// it.
std::string drive_text(const DriveOfPair& drive, const std::vector<std::string>& config_files,
                       const std::string& model_file);

/// Adds every line of an evidence file, drives or pools. Returns the number of drives that were in
/// the pool already. Error: where, what is wrong, and what would be right.
Expected<std::size_t> add_evidence(const std::string& path, fleet::Pool& pool);

/// The pool as one line.
std::string pool_text(const fleet::Pool& pool);

}  // namespace vgyro::cli
