#pragma once

// What a drive brings into the fleet: the evidence of one recording, with the names of its gyros.
// Knows no file.

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "model/shape.h"

namespace vgyro::fleet {

/// A gyro, or one axis of a unit: which type, and which of it.
struct Identity {
  std::string type;
  std::string unit;

  friend auto operator<=>(const Identity&, const Identity&) = default;
};

struct DriveGyro {
  Identity identity;
  bool has_bias = false;
  double bias_dps = 0.0;
  double white_dps_rthz = 0.0;  ///< 0: not known
  double walk_dps_rts = 0.0;    ///< 0: none was seen
  double samples = 0.0;
  double lost_share = 0.0;
  double masked_share = 0.0;
  bool has_temperature = false;
  std::array<double, 2> temperature_c{};  ///< least, most
  std::vector<std::string> named;         ///< kinds that the drive alone named
};

/// Scores and information of shapes, judged together: of one gyro, or of a pair that only differs.
struct DrivePlace {
  std::vector<std::size_t> gyros;   ///< which of the drive's, one or both, in this order
  std::vector<std::size_t> column;  ///< slot × kShapeCount + shape; slot: place in `gyros`
  std::vector<double> score;        ///< d log L / d size, in 1/Shape::unit
  std::vector<double> information;  ///< row by row, lower triangle, in 1/Shape::unit²
};

struct Drive {
  /// "RECORDING-EVIDENCE", two digests: the same one counts once, and a recording only once.
  std::string id;
  double began_s = 0.0;
  double seconds = 0.0;
  std::string model;  ///< fingerprint of the model file that it was judged with
  std::array<DriveGyro, 2> gyros;
  std::vector<DrivePlace> places;
};

}  // namespace vgyro::fleet
