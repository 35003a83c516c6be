#pragma once

// What one drive contributes to the fleet: the evidence of one recording, with the identities of
// its gyros. Independent of files.

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "model/shape.h"

namespace vgyro::fleet {

/// A gyro, or one axis of a whole unit: its type, and which unit of that type it is.
struct Identity {
  std::string type;
  std::string unit;

  friend auto operator<=>(const Identity&, const Identity&) = default;
};

struct DriveGyro {
  Identity identity;
  bool has_bias = false;
  double bias_dps = 0.0;
  double white_dps_rthz = 0.0;  ///< 0: unknown
  double walk_dps_rts = 0.0;    ///< 0: none seen
  double samples = 0.0;
  double lost_share = 0.0;
  double masked_share = 0.0;
  bool has_temperature = false;
  std::array<double, 2> temperature_c{};  ///< least, most
  std::vector<std::string> named;         ///< kinds named by this drive alone
};

/// Scores and information of shapes that are judged together: those of one gyro, or of a pair of
/// which only the difference is known.
struct DrivePlace {
  std::vector<std::size_t> gyros;   ///< one or both of the drive's, in this order
  std::vector<std::size_t> column;  ///< slot × kShapeCount + shape; slot: index into `gyros`
  std::vector<double> score;        ///< d log L / d size, in 1/Shape::unit
  std::vector<double> information;  ///< row by row, lower triangle, in 1/Shape::unit²
};

struct Drive {
  /// "RECORDING-EVIDENCE", two digests. The same evidence counts once; a second evidence of the
  /// same recording is an error.
  std::string id;
  double began_s = 0.0;
  double seconds = 0.0;
  std::string model;  ///< fingerprint of the model file used to judge it
  std::array<DriveGyro, 2> gyros;
  std::vector<DrivePlace> places;
};

}  // namespace vgyro::fleet
