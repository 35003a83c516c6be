#pragma once

// A folder of results that appears whole or not at all: the files are written into a temporary
// folder beside it, which is then renamed. It replaces an earlier result, never anything else.

#include <string>
#include <utility>
#include <vector>

#include "base/error.h"

namespace vgyro::cli {

struct ResultFile {
  std::string name;  ///< may include a folder: "models/a.toml"; `names` then lists that folder too
  std::string text;
};

/// Call before the work: error if a result must not replace `folder`, because it is a file, or a
/// folder with files of other names.
Expected<void> check_result_folder(const std::string& folder,
                                   const std::vector<std::string>& names);

/// Checks again, then writes. `names` lists what an earlier result may hold besides these files.
Expected<void> write_result_folder(const std::string& folder, const std::vector<ResultFile>& files,
                                   std::vector<std::string> names = {});

}  // namespace vgyro::cli
