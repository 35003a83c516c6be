#pragma once

// What else of a log serves two gyros: where the platform rests, a wheel speed, accelerations.

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
  std::size_t agreeing = 0;             ///< other speeds of the log that say the same
  std::optional<double> resting_m_s{};  ///< most of what it says in the rest
};

struct AccelerometerFound {
  const Found* found = nullptr;
  std::array<const dbc::Signal*, 3> axes{};
  double magnitude_g = 0.0;  ///< median; of a whole accelerometer 1
};

struct Circumstances {
  std::optional<analysis::Stretch>
      rest;  ///< the longest, at least 30 s; since the log's first frame
  std::optional<SpeedFound> speed;
  std::optional<AccelerometerFound> accelerometer;
  std::vector<std::string> remarks;  ///< what was seen and does not fit, for the file
};

/// `begin_s`: the log's first frame, as the series have it.
Circumstances find_circumstances(const std::vector<Found>& messages,
                                 const std::vector<Candidate>& candidates, const Choice& choice,
                                 double begin_s);

}  // namespace vgyro::cli
