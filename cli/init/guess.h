#pragma once

// Messages that no DBC file describes, described by trial: which fields could be rates, what their
// scales may be, and the DBC file that says so. A log does not show a scale: only a gyro whose
// scale is known, or a turn by a known angle does.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/init/candidates.h"
#include "cli/init/choice.h"

namespace vgyro::cli {

/// Described by trial, in raw numbers. Not moved: `found` points into it.
struct Guess {
  dbc::Database database;
  std::vector<Found> found;
  std::size_t streams = 0;  ///< that were tried
};
/// Of all identifiers that are not among `known` and come often enough.
std::unique_ptr<Guess> guess_messages(const Traffic& traffic, const std::vector<Found>& known);

/// The fields that follow a candidate or a field of another message.
void add_guessed(std::vector<Candidate>& candidates, const Guess& guess);

/// How far the platform turned by this gyro, in the series' unit times seconds, less what it says
/// in the log's first three seconds, which must be a rest. Nothing where samples are missing.
std::optional<double> turned_angle(const analysis::StampedSignal& series);

/// The proposal's further needs, where one of the pair is guessed. Not moved.
struct Described {
  dbc::Database database;  ///< the guessed ones of the pair, with scales, counters, checks
  std::vector<std::string> remarks;  ///< how sure that is, for the configuration
  std::string text;                  ///< the DBC file
};
/// Points the pair's guessed candidates into the result, with series in deg/s. `path`: of the DBC
/// file; `turned_deg`: by which the platform turned in the whole log. Nothing where none is
/// guessed.
std::unique_ptr<Described> describe(std::vector<Candidate>& candidates, Choice& choice,
                                    const std::string& path, std::optional<double> turned_deg);

}  // namespace vgyro::cli
