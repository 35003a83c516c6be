#pragma once

// What the workflow knows of a recording: plain numbers, decoded, in the order in which they came.
// No frames. Times are seconds since the first frame that has a role: the model's time.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vgyro::gap {

/// One gyro's usable frames; all vectors have one entry for each, but `counter`,
/// `temperature_c`, `supply_v` and `other_rate_dps`, which are empty where the configuration names
/// none.
struct GyroSeries {
  std::string name;
  std::vector<double> t_s;       ///< stamps, as they are; never decreasing
  std::vector<double> rate_dps;  ///< as decoded, not corrected
  std::vector<double> temperature_c;
  std::vector<double> supply_v;
  std::array<std::vector<double>, 3> other_rate_dps;  ///< about x, y and z of the unit
  std::vector<std::uint32_t> counter;                 ///< alive counter, raw
  std::uint32_t counter_modulus = 0;                  ///< 0: no counter
  double step_dps = 0.0;   ///< between neighbouring values of the signal; 0: a float
  double limit_dps = 0.0;  ///< largest magnitude that the signal can carry; 0: unknown
};

struct ScalarSeries {
  std::vector<double> t_s;
  std::vector<double> value;
};

struct AccelerationSeries {
  std::vector<double> t_s;
  std::array<std::vector<double>, 3> g;  ///< x, y, z
};

struct Recording {
  std::array<GyroSeries, 2> gyros;
  ScalarSeries reference_dps;  ///< empty: there is none
  AccelerationSeries acceleration;
  bool has_reference = false;     ///< configured
  bool has_acceleration = false;  ///< configured
  double began_s = 0.0;           ///< of the first frame, since 1970; 0: not known
  double seconds = 0.0;           ///< from the first frame to the last
  double rest_s = 0.0;            ///< at least this long at rest in the beginning; 0: not known
  double rest_rate_dps = 0.0;     ///< the true rate at rest
};

}  // namespace vgyro::gap
