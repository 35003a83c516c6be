#pragma once

// Made recordings, studied, with all that an error may depend on in closed form; and errors planted
// in what was observed, so that one recording serves many tests.

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "gap/observations.h"
#include "gap/study.h"
#include "tests/gap/made_recording.h"

namespace vgyro::gap {

/// Swings by 10 K and does not come back to where it was.
inline double true_temperature_c(double t_s) {
  return 25.0 + 5.0 * std::sin(2.0 * kPi * t_s / 70.0) + 0.03 * t_s;
}
inline double true_temperature_slope_c_s(double t_s) {
  return 5.0 * 2.0 * kPi / 70.0 * std::cos(2.0 * kPi * t_s / 70.0) + 0.03;
}

/// Tilts slowly; z shakes in bursts.
inline double true_acceleration_g(std::size_t axis, double t_s) {
  if (axis == 0) return 0.05 * std::sin(2.0 * kPi * t_s / 23.0);
  if (axis == 1) return 0.04 * std::sin(2.0 * kPi * t_s / 17.0 + 1.0);
  const bool shakes = std::fmod(t_s, 30.0) > 18.0;
  return 1.0 + (shakes ? 0.1 * std::sin(2.0 * kPi * 12.5 * t_s) : 0.0);
}

/// The angle that the true rate has turned by, at multiples of the interval: Simpson's rule.
inline std::vector<double> true_angle_rad(const Making& making) {
  constexpr int kParts = 4;
  std::vector<double> angle{0.0};
  const auto count = static_cast<std::size_t>(making.seconds / making.interval_s);
  const double part_s = making.interval_s / kParts;
  for (std::size_t i = 0; i < count; ++i) {
    double sum = 0.0;
    for (int k = 0; k < kParts; ++k) {
      const double t_s = static_cast<double>(i) * making.interval_s + k * part_s;
      sum += true_rate_dps(making, t_s) + 4.0 * true_rate_dps(making, t_s + 0.5 * part_s) +
             true_rate_dps(making, t_s + part_s);
    }
    angle.push_back(angle.back() + sum * part_s / 6.0 * kPi / 180.0);
  }
  return angle;
}

/// The true rate behind a first-order low-pass, likewise: a hundred small steps in each interval.
inline std::vector<double> low_passed_rate_dps(const Making& making, double cutoff_hz) {
  constexpr int kParts = 100;
  const auto count = static_cast<std::size_t>(making.seconds / making.interval_s);
  const double part_s = making.interval_s / kParts;
  const double keeps = std::exp(-2.0 * kPi * cutoff_hz * part_s);
  double state_dps = true_rate_dps(making, 0.0);
  std::vector<double> rate_dps{state_dps};
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < kParts; ++k) {
      const double middle_s = static_cast<double>(i) * making.interval_s + (k + 0.5) * part_s;
      const double input_dps = true_rate_dps(making, middle_s);
      state_dps = input_dps + (state_dps - input_dps) * keeps;
    }
    rate_dps.push_back(state_dps);
  }
  return rate_dps;
}

inline void add_surroundings(Recording& recording) {
  recording.has_acceleration = true;
  for (GyroSeries& gyro : recording.gyros) {
    for (const double t_s : gyro.t_s)
      gyro.temperature_c.push_back(true_temperature_c(t_s));
  }
  for (const double t_s : recording.gyros[0].t_s) {
    recording.acceleration.t_s.push_back(t_s);
    for (std::size_t axis = 0; axis < 3; ++axis)
      recording.acceleration.g[axis].push_back(true_acceleration_g(axis, t_s));
  }
}

inline Recording without_reference(Recording recording) {
  recording.has_reference = false;
  recording.reference_dps = {};
  return recording;
}

/// A study does not outlive its recording.
class MadeStudy {
 public:
  MadeStudy(Recording recording, const Effects& known) : recording_(std::move(recording)) {
    auto begun = Study::begin(recording_, known);
    if (begun) study_ = std::move(*begun);
  }
  explicit MadeStudy(const Making& making)
      : MadeStudy(make_recording(making), noise_effects(making)) {}
  MadeStudy(const MadeStudy&) = delete;
  MadeStudy& operator=(const MadeStudy&) = delete;

  [[nodiscard]] const Recording& recording() const { return recording_; }
  /// Null: it was refused.
  [[nodiscard]] const std::shared_ptr<const Study>& study() const { return study_; }
  [[nodiscard]] std::shared_ptr<const Observations> observations(std::size_t place) const {
    return study_->observations()[place];
  }

 private:
  Recording recording_;
  std::shared_ptr<const Study> study_;
};

/// The same observations of one gyro with an error in each reading.
inline std::shared_ptr<const Observations> planted(
    const Observations& clean, std::size_t gyro,
    const std::function<double(double t_s, double rate_dps)>& error_dps) {
  auto data = std::make_shared<Observations>(clean);
  for (std::size_t i = 0; i < data->t_s.size(); ++i) {
    const double share = share_of(data->channel[i], gyro);
    if (share == 0.0) continue;
    data->observed_dps[static_cast<Eigen::Index>(i)] +=
        share * error_dps(data->t_s[i], clean.rate[gyro][i].value);
  }
  return data;
}

/// Both gyros' signals of a motion in closed form, and nothing else that moves.
inline std::shared_ptr<const Signals> signals_of(const Making& making) {
  std::vector<double> t_s;
  std::vector<double> rate_dps;
  const auto count = static_cast<std::size_t>(making.seconds / making.interval_s) + 1;
  for (std::size_t i = 0; i < count; ++i) {
    t_s.push_back(static_cast<double>(i) * making.interval_s);
    rate_dps.push_back(true_rate_dps(making, t_s.back()));
  }
  auto signals = std::make_shared<Signals>();
  signals->motion = Motion(SampledCurve(t_s, rate_dps));
  return signals;
}

/// White noise and walk of one gyro at even instants from 0 on, the walk beginning at 0.
inline std::vector<double> drawn_noise(const Making& making, std::size_t gyro,
                                       std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto count = static_cast<std::size_t>(making.seconds / making.interval_s);
  std::vector<double> values;
  double walk_dps = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0)
      walk_dps += making.walk_dps_rts[gyro] * std::sqrt(making.interval_s) * normal(random);
    values.push_back(walk_dps +
                     making.white_dps_rthz[gyro] / std::sqrt(making.interval_s) * normal(random));
  }
  return values;
}

inline Circumstances circumstances_of(const Making& making, bool with_reference) {
  const auto signals = signals_of(making);
  return {making.seconds,
          with_reference,
          {making.interval_s, making.interval_s},
          {},
          {signals, signals}};
}

/// Noise and `making.error` of gyro 1 against a rate that is known exactly: no recording, no study.
inline std::shared_ptr<const Observations> observations_of_one(const Making& making) {
  std::mt19937_64 random(making.seed);
  const std::vector<double> noise = drawn_noise(making, 0, random);
  std::vector<Observation> samples;
  for (std::size_t i = 0; i < noise.size(); ++i) {
    const double t_s = static_cast<double>(i) * making.interval_s;
    const double rate_dps = true_rate_dps(making, t_s);
    samples.push_back({t_s, Channel::kGyro1, noise[i] + making.error(0, t_s, rate_dps), rate_dps});
  }
  return std::make_shared<Observations>(make_observations(
      std::move(samples), circumstances_of(making, true), {true, false}, {nullptr, 2}, 0.0, {}));
}

/// Both gyros at rest and then their difference, read at the same instants.
inline std::shared_ptr<const Observations> observations_of_two(const Making& making) {
  std::mt19937_64 random(making.seed);
  const std::array noise{drawn_noise(making, 0, random), drawn_noise(making, 1, random)};
  std::vector<double> t_s;
  for (std::size_t i = 0; i < noise[0].size(); ++i)
    t_s.push_back(static_cast<double>(i) * making.interval_s);
  const SampledCurve second(t_s, noise[1]);
  std::vector<Observation> samples;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const double rate_dps = true_rate_dps(making, t_s[i]);
    const std::array error{noise[0][i] + making.error(0, t_s[i], rate_dps),
                           noise[1][i] + making.error(1, t_s[i], rate_dps)};
    if (t_s[i] <= making.rest_s) {
      samples.push_back({t_s[i], Channel::kGyro1, error[0], rate_dps});
      samples.push_back({t_s[i], Channel::kGyro2, error[1], rate_dps});
    } else {
      samples.push_back({t_s[i], Channel::kDifference, error[0] - error[1], rate_dps});
    }
  }
  return std::make_shared<Observations>(make_observations(
      std::move(samples), circumstances_of(making, false), {true, true}, {&second, 1}, 0.0, {}));
}

}  // namespace vgyro::gap
