#pragma once

// What the gap workflow found, for programs (gap.json, compare --json) and for people (the
// terminal). The fields of the JSON are an interface: they change only with a new `format`.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cli/gap/provenance.h"
#include "gap/result.h"

namespace vgyro::cli {

/// What was judged, by the names that the user gave.
struct GapSubject {
  std::string config;
  std::string model;  ///< empty: none was given
  std::string log;
  std::array<std::string, 2> gyros;  ///< their names
  /// Of a pair about one axis of whole units: "x", "y" or "z" of the vehicle; empty: of two single
  /// gyros.
  std::string axis = {};
  std::array<std::string, 2> types = {};    ///< of the gyros; empty: the configuration says none
  std::array<std::string, 2> serials = {};  ///< of the gyros; empty: as for types
  std::array<std::size_t, 2> sensor_axis = {};  ///< which of the unit's own lies along it
  Provenance provenance = {};                   ///< for the page alone

  /// For the model file: nothing of two single gyros, or where the kind is all the unit's.
  [[nodiscard]] std::optional<std::size_t> axis_of(model::Kind kind, std::size_t gyro) const;
};

/// Parameters of the named effects with no more digits than their σ justifies: the rest would look
/// like knowledge. Files and tables then say the same number.
void round_to_sigma(gap::Result& result);

nlohmann::ordered_json gap_json(const GapSubject& subject, const gap::Result& result);
nlohmann::ordered_json comparison_json(const GapSubject& subject,
                                       const gap::Comparison& comparison);

/// Some twenty lines.
std::string gap_text(const GapSubject& subject, const gap::Result& result);
std::string comparison_text(const GapSubject& subject, const gap::Comparison& comparison);

/// "error -4.2e-04 ± 3e-06"
std::string value_text(const gap::NamedEffect& named);

/// Kinds that cannot be told for the same reason, together.
struct NotTold {
  std::string who;  ///< "a, b: temperature_bias, temperature_rate_bias"
  std::string why;
  std::string experiment;
};
std::vector<NotTold> not_told(const GapSubject& subject, const gap::Result& result);

/// What the time limit left open; empty where there was time for all.
std::string open_text(const gap::Result& result);

/// What is in the gap's account and not in the model file; empty where nothing is.
std::string not_applied_text(const gap::Result& result);

/// One sentence.
std::string verdict_text(const gap::Result& result);

/// "0.0312", and "0" of what is next to nothing.
std::string gap_number(double nats);

/// Columns as wide as they need, the last one as it is.
std::string table(const std::vector<std::vector<std::string>>& rows);

}  // namespace vgyro::cli
