#pragma once

// What `vgyro gap` and `vgyro compare` begin with: configuration, model file, recording.

#include <optional>
#include <string>
#include <vector>

#include <tl/expected.hpp>

#include "base/error.h"
#include "cli/gap/report.h"
#include "cli/output/progress.h"
#include "gap/recording.h"
#include "gap/workflow.h"
#include "model/file.h"

namespace vgyro::cli {

struct GapInputs {
  GapSubject subject;
  model::Model model;  ///< empty when there is none
  std::vector<gap::Recording> recordings;
};

/// `model` comes before the configuration's own; `doing` is for the line of progress;
/// `outputs` must be none of the files that are read.
tl::expected<GapInputs, std::vector<Error>> load_gap_inputs(
    const std::string& config, const std::optional<std::string>& model,
    const std::vector<std::string>& logs, const std::string& doing,
    const std::vector<std::string>& outputs);

/// Of the workflow; it tells `progress`, which must live as long, how far it is.
gap::Settings settings_of(std::uint64_t seed, Progress& progress);

/// An error of the workflow, which does not know the log's name.
Error at_log(Error error, const std::string& log);

}  // namespace vgyro::cli
