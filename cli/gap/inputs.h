#pragma once

// What `vgyro gap` and `vgyro compare` begin with: configuration, model file, recordings; of two
// whole units once for each axis that is looked at. The workflow knows pairs of gyros and no axes:
// effects go to it in the sign in which the pair's readings are, and come back in the sensor's own.

#include <array>
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

struct GapPair {
  GapSubject subject;
  model::Model model;  ///< what is of this pair, in its readings' sign; empty when there is none
  std::vector<gap::Recording> recordings;
  std::array<bool, 2> flipped{};  ///< the readings are against the sensor's sign

  /// As the model file and people know it: which of the unit's axes, in the sensor's sign.
  [[nodiscard]] model::Effect for_file(const model::Effect& effect) const;
  /// The same of everything that was found.
  void tell_of_sensors(gap::Result& result) const;
  /// "gap, axis z", for the line of progress.
  [[nodiscard]] std::string doing(const std::string& command) const;
};

struct GapInputs {
  std::vector<std::string> files;  ///< of the configuration: itself, DBC files, model
  model::Model model;              ///< the whole file; empty when there is none
  std::vector<GapPair> pairs;  ///< one; of two whole units one for each axis, in the order x, y, z
};

struct GapRequest {
  std::string config;
  std::optional<std::string> model;  ///< before the configuration's own
  std::vector<std::string> logs;
  std::string axis;  ///< of whole units; empty: all
};

/// `command` is for the line of progress; `outputs` must be none of the files that are read.
tl::expected<GapInputs, std::vector<Error>> load_gap_inputs(
    const GapRequest& request, const std::string& command, const std::vector<std::string>& outputs);

/// Of the workflow; it tells `progress`, which must live as long, how far it is.
gap::Settings settings_of(std::uint64_t seed, Progress& progress);

/// An error of the workflow, which does not know the log's name.
Error at_log(Error error, const GapSubject& subject);

}  // namespace vgyro::cli
