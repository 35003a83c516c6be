#pragma once

// Which signals of the log, by the DBC files, could be rates of rotation, and what goes with them
// in the same message: counter, check value, temperature, validity, sign.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/likeness.h"
#include "cli/init/traffic.h"
#include "dbc/database.h"

namespace vgyro::cli {

/// A message of a DBC file that is in the log.
struct Found {
  const Stream* stream = nullptr;
  const dbc::Database* database = nullptr;
  const dbc::Message* message = nullptr;
};

/// The very identifier goes before J1939's PGN from the same sender, that before any sender; a
/// message of the first file that describes it.
std::vector<Found> find_messages(const Traffic& traffic,
                                 const std::vector<dbc::Database>& databases);

struct Candidate {
  Found found;
  const dbc::Signal* signal = nullptr;
  std::string sign_signal;         ///< of a magnitude: the bit that says negative
  std::string assumed_unit;        ///< where the DBC file has none
  analysis::StampedSignal series;  ///< deg/s
  analysis::SignalFigures figures;
  bool guessed = false;     ///< by trial of layouts: the series is in raw numbers
  double name_score = 0.0;  ///< by the name alone: above 0 a yaw rate, below it something else
  std::string why_not;      ///< set: no gyro, whatever it correlates with

  [[nodiscard]] std::string place() const;  ///< "can0 GYRO_A.RateZ"
};

std::vector<Candidate> find_candidates(const std::vector<Found>& messages);

/// Above 0 for names of yaw rates, below 0 for other axes and other things that turn.
double name_score(std::string_view signal, std::string_view message);

struct E2eFound {
  std::string kind;
  std::string data_id;  ///< as the configuration wants it; empty: none
  std::size_t byte = 0;
  std::string signal;  ///< that carries it; empty: the DBC file has none there
};

struct Companions {
  std::string counter;
  std::optional<std::int64_t> counter_max;  ///< where it is not what gateway takes by itself
  std::string temperature;
  std::string valid;
  std::optional<E2eFound> e2e;
  std::vector<std::string> remarks;  ///< doubts, for the file
};
/// `main`: the signal that the message is read for.
Companions find_companions(const Found& found, const dbc::Signal& main);

/// A protection that all frames agree with; tried at every byte.
std::optional<E2eFound> find_e2e(const Found& found);

/// Of a signal, times `scale`; stamps since the epoch. What lies out of the DBC file's range, is
/// labelled invalid or is one of the protocol's codes is left out.
analysis::StampedSignal series_of(const Found& found, const dbc::Signal& signal, double scale,
                                  const dbc::Signal* sign = nullptr);

}  // namespace vgyro::cli
