#pragma once

// What one recording says of every shape that a fleet may be asked about, whether it was named in
// it or not: the evidence that adds up. Values only.

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "model/effect.h"

namespace vgyro::gap {

struct GyroEvidence {
  double samples = 0.0;
  std::optional<double> bias_dps;  ///< of this recording; nothing where only a difference is known
  double bias_sigma_dps = 0.0;
  double white_dps_rthz = 0.0;  ///< fitted to this recording, beside all that was found in it
  double walk_dps_rts = 0.0;
  /// Of ln white, of both, of ln walk; 0 where the likelihood does not say.
  std::array<double, 3> log_noise_covariance{};
  std::optional<std::array<double, 3>> temperature_c;  ///< least, mean, most
  double lost_share = 0.0;                             ///< frames that never came
  double masked_share = 0.0;                           ///< samples that were set aside
  std::vector<model::Effect> named;                    ///< in this recording alone, applied or not
};

/// Shapes of one gyro, or of both where only their difference is known, judged together.
struct PlaceEvidence {
  std::vector<std::size_t> gyros;  ///< whose
  std::vector<std::size_t> gyro;   ///< of each shape: which
  std::vector<std::size_t> shape;  ///< index in model::shapes()
  /// d log L / d size at size 0, what the model file knows and what was found counting to the size;
  /// and −d² log L / d size²: row by row, symmetric. Both less what `beside` explains.
  std::vector<double> score;
  std::vector<double> information;
  std::vector<std::string> beside;  ///< "bias of a", …: fitted beside and orthogonal
};

struct DriveEvidence {
  std::array<GyroEvidence, 2> gyros;
  std::vector<PlaceEvidence> places;
};

}  // namespace vgyro::gap
