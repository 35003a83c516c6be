#pragma once

// A folder of results that is there whole or not at all: its files are written into a folder beside
// it, which then takes its name. It replaces an earlier result, never anything else.

#include <string>
#include <utility>
#include <vector>

#include "base/error.h"

namespace vgyro::cli {

struct ResultFile {
  std::string name;  ///< may be in a folder within: "models/a.toml"; names then hold that folder
  std::string text;
};

/// Before the work: error when `folder` is something that a result must not replace: a file, or a
/// folder that holds anything but files of these names.
Expected<void> check_result_folder(const std::string& folder,
                                   const std::vector<std::string>& names);

/// Checks again, then writes. `names`: what an earlier result may consist of besides these files.
Expected<void> write_result_folder(const std::string& folder, const std::vector<ResultFile>& files,
                                   std::vector<std::string> names = {});

}  // namespace vgyro::cli
