#pragma once

// What goes wrong on the way from the sensor to the log, done to made recordings; each helper says
// what it did, so that a test can hold what is found against it.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "gap/recording.h"
#include "gap/timing.h"
#include "gap/transport.h"
#include "tests/gap/made_recording.h"

namespace vgyro::gap {

/// Of one sample of gyro k, in deg/s.
inline double sample_noise_dps(const Making& making, std::size_t gyro) {
  return making.white_dps_rthz[gyro] / std::sqrt(making.interval_s);
}

inline Recording without_reference(Recording recording) {
  recording.has_reference = false;
  recording.reference_dps = {};
  return recording;
}

/// Both gyros turn at this rate instead of the made one; there is no reference.
inline Recording turned(Making making, const std::function<double(double t_s)>& rate_dps) {
  making.error = [&, own = making.error](std::size_t gyro, double t_s, double made_dps) {
    return own(gyro, t_s, made_dps) + rate_dps(t_s) - made_dps;
  };
  return without_reference(make_recording(making));
}

inline std::array<Transport, 2> check_both(const Recording& recording,
                                           const std::vector<model::Effect>& known = {}) {
  std::array<std::vector<model::Effect>, 2> of_gyro;
  for (const model::Effect& effect : known)
    of_gyro[effect.gyro].push_back(effect);
  return {check_transport(recording.gyros[0], 0, of_gyro[0]),
          check_transport(recording.gyros[1], 1, of_gyro[1])};
}

inline Timing timing_of(const Recording& recording, const std::array<Transport, 2>& transports) {
  return find_timing(recording, transports, {});
}

inline void add_spikes(GyroSeries& series, const std::vector<std::size_t>& at, double size_dps) {
  double sign = 1.0;
  for (const std::size_t i : at) {
    series.rate_dps[i] += sign * size_dps;
    sign = -sign;
  }
}

/// Rising indices, `apart` at least from each other and from both ends.
inline std::vector<std::size_t> scattered(std::size_t samples, std::size_t apart, double share,
                                          std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::bernoulli_distribution chosen(share);
  std::vector<std::size_t> at;
  std::size_t next = apart;
  for (std::size_t i = 0; i + apart < samples; ++i) {
    if (!chosen(random) || i < next) continue;
    at.push_back(i);
    next = i + apart;
  }
  return at;
}

inline std::vector<std::size_t> masked_samples(const Transport& transport) {
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < transport.masked.size(); ++i) {
    if (transport.masked[i] != 0) at.push_back(i);
  }
  return at;
}

inline void freeze(GyroSeries& series, std::size_t from, std::size_t to) {
  for (std::size_t i = from + 1; i < to; ++i)
    series.rate_dps[i] = series.rate_dps[from];
}

/// Each stamp is later than before, but never before the last.
inline void delay_stamps(GyroSeries& series, const std::function<double()>& late_s) {
  double last_s = 0.0;
  for (double& t_s : series.t_s) {
    t_s = std::max(last_s, t_s + late_s());
    last_s = t_s;
  }
}

/// Keeps what `lost` does not take, but the first and last always. Returns how many it took.
inline std::size_t lose(GyroSeries& series, const std::function<bool(std::size_t i)>& lost) {
  GyroSeries kept = series;
  kept.t_s.clear(), kept.rate_dps.clear(), kept.counter.clear();
  const std::size_t n = series.t_s.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0 && i + 1 < n && lost(i)) continue;
    kept.t_s.push_back(series.t_s[i]);
    kept.rate_dps.push_back(series.rate_dps[i]);
    if (!series.counter.empty()) kept.counter.push_back(series.counter[i]);
  }
  series = std::move(kept);
  return n - series.t_s.size();
}

}  // namespace vgyro::gap
