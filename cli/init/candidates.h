#pragma once

// Finds signals of the log that could be rates of rotation according to the DBC files, and their
// companions in the same message: counter, check value, temperature, validity, sign.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/likeness.h"
#include "cli/init/traffic.h"
#include "dbc/database.h"

namespace vgyro::cli {

/// A message of a DBC file that occurs in the log.
struct Found {
  const Stream* stream = nullptr;
  const dbc::Database* database = nullptr;
  const dbc::Message* message = nullptr;
};

/// An exact identifier takes precedence over J1939's PGN from the same sender, and that over any
/// sender; of several files that describe a message, the first one counts.
std::vector<Found> find_messages(const Traffic& traffic,
                                 const std::vector<dbc::Database>& databases);

struct Candidate {
  Found found;
  const dbc::Signal* signal = nullptr;
  std::string sign_signal;         ///< for a magnitude: the sign bit
  std::string assumed_unit;        ///< if the DBC file has none
  analysis::StampedSignal series;  ///< deg/s
  analysis::SignalFigures figures;
  bool guessed = false;     ///< found by trial of layouts: the series is in raw numbers
  double name_score = 0.0;  ///< from the name alone: positive for a yaw rate, negative for other
                            ///< things
  std::string why_not;      ///< set: not a gyro, whatever it correlates with

  [[nodiscard]] std::string place() const;  ///< "can0 GYRO_A.RateZ"
};

std::vector<Candidate> find_candidates(const std::vector<Found>& messages);

/// Above 0 for names of yaw rates, below 0 for other axes and other things that turn.
double name_score(std::string_view signal, std::string_view message);

struct E2eFound {
  std::string kind;
  std::string data_id;  ///< as written in the configuration; empty: none
  std::size_t byte = 0;
  std::string signal;  ///< signal that carries the check value; empty: the DBC file has none there
};

struct Companions {
  std::string counter;
  std::optional<std::int64_t> counter_max;  ///< if it differs from the gateway's default
  std::string temperature;
  std::string valid;
  std::optional<E2eFound> e2e;
  std::vector<std::string> remarks;  ///< doubts, as comments in the file
};
/// `main` is the signal that the message is read for.
Companions find_companions(const Found& found, const dbc::Signal& main);

/// A protection that agrees with all frames; tried at every byte.
std::optional<E2eFound> find_e2e(const Found& found);

/// The values of a signal, times `scale`; stamps since the epoch. Leaves out values outside the DBC
/// file's range, values labelled invalid, and the protocol's codes.
analysis::StampedSignal series_of(const Found& found, const dbc::Signal& signal, double scale,
                                  const dbc::Signal* sign = nullptr);

}  // namespace vgyro::cli
