#pragma once

// Describes messages that are in no DBC file, by trial: which fields could be rates, what their
// scales may be, and a DBC file with the result. A log does not show a scale: that takes a gyro of
// known scale, or a turn by a known angle.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/init/candidates.h"
#include "cli/init/choice.h"

namespace vgyro::cli {

/// Messages described by trial, in raw numbers. Must not move: `found` points into it.
struct Guess {
  dbc::Database database;
  std::vector<Found> found;
  std::size_t streams = 0;  ///< number of streams tried
};
/// Tries all identifiers that are not among `known` and come often enough.
std::unique_ptr<Guess> guess_messages(const Traffic& traffic, const std::vector<Found>& known);

/// Adds the fields that follow a candidate or a field of another message.
void add_guessed(std::vector<Candidate>& candidates, const Guess& guess);

/// The angle by which the platform turned according to this gyro, in the series' unit times
/// seconds, less the gyro's mean in the log's first three seconds, which must be a rest. Nothing if
/// samples are missing.
std::optional<double> turned_angle(const analysis::StampedSignal& series);

/// Additions to a proposal whose pair has a guessed gyro. Must not move.
struct Described {
  dbc::Database database;  ///< guessed messages of the pair, with scales, counters, checks
  std::vector<std::string> remarks;  ///< how certain the guess is, for the configuration
  std::string text;                  ///< the DBC file
};
/// Lets the guessed candidates of the pair refer to the result, with series in deg/s. `path` is the
/// DBC file's; `turned_deg` is the platform's turn over the whole log. Nothing if none is guessed.
std::unique_ptr<Described> describe(std::vector<Candidate>& candidates, Choice& choice,
                                    const std::string& path, std::optional<double> turned_deg);

}  // namespace vgyro::cli
