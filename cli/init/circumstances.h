#pragma once

// Finds other contents of a log that serve two gyros: rest of the platform, wheel speed,
// accelerations.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "analysis/rest.h"
#include "cli/init/candidates.h"
#include "cli/init/choice.h"

namespace vgyro::cli {

struct SpeedFound {
  const Found* found = nullptr;
  const dbc::Signal* signal = nullptr;
  std::size_t agreeing = 0;             ///< other speeds of the log that agree
  std::optional<double> resting_m_s{};  ///< its usual value during the rest
};

struct AccelerometerFound {
  const Found* found = nullptr;
  std::array<const dbc::Signal*, 3> axes{};
  double magnitude_g = 0.0;  ///< median; 1 for a complete accelerometer
};

struct Circumstances {
  std::optional<analysis::Stretch>
      rest;  ///< the longest, at least 30 s; time since the log's first frame
  std::optional<SpeedFound> speed;
  std::optional<AccelerometerFound> accelerometer;
  std::vector<std::string> remarks;  ///< observations that do not fit, as comments in the file
};

/// `begin_s` is the time of the log's first frame in the series.
Circumstances find_circumstances(const std::vector<Found>& messages,
                                 const std::vector<Candidate>& candidates, const Choice& choice,
                                 double begin_s);

}  // namespace vgyro::cli
