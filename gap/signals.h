#pragma once

// What a gyro's error may depend on, at any instant of a recording: the true rate with its slope
// and angle, the gyro's temperature and supply voltage, acceleration, vibration. And from that,
// what a gyro should read.

#include <array>
#include <span>
#include <vector>

#include "gap/curve.h"
#include "gap/recording.h"
#include "model/effect.h"
#include "model/equation.h"
#include "model/temperature_past.h"

namespace vgyro::gap {

/// The motion as well as it is known.
class Motion {
 public:
  Motion() = default;
  explicit Motion(SampledCurve rate_dps);

  [[nodiscard]] SampledCurve::Point rate(double t_s) const { return rate_dps_.at(t_s); }
  [[nodiscard]] double angle_rad(double t_s) const;
  /// The rate through a first-order low-pass.
  [[nodiscard]] SampledCurve low_passed(double cutoff_hz) const;
  [[nodiscard]] SampledCurve low_passed(const model::SecondOrder& second) const;
  [[nodiscard]] const SampledCurve& curve() const { return rate_dps_; }

 private:
  SampledCurve rate_dps_;
  std::vector<double> angle_deg_;  ///< at the curve's samples, from time 0
};

struct Signals {
  Motion motion;  ///< as this gyro is judged against
  SampledCurve temperature_c;
  SampledCurve temperature_slope_c_s;
  double temperature_step_c = 0.0;  ///< of its values; 0: it never changed
  /// From this step on its slope, and how it turned, are guesses.
  static constexpr double kCoarseTemperature_c = 0.2;
  std::vector<model::TemperaturePast> temperature_past;  ///< at each sample of temperature_c
  std::array<SampledCurve, 3> acceleration_g;
  SampledCurve vibration_g2;
  SampledCurve supply_v;
  std::array<SampledCurve, 3> other_rate_dps;

  [[nodiscard]] model::Surroundings at(double t_s) const;
  /// The same with an angle of 0.
  [[nodiscard]] model::Surroundings without_motion_at(double t_s) const;
};

/// Temperature smoothed by local parabolas over `reach_s` to both sides, with its slope.
void smooth_temperature(const GyroSeries& gyro, Signals& signals);
/// As it is told: it steps, and a parabola through a step follows nothing.
void set_supply(const GyroSeries& gyro, Signals& signals);
void set_other_rates(const GyroSeries& gyro, Signals& signals);
void set_acceleration(const AccelerationSeries& acceleration, Signals& signals);

/// All of them, as the recording holds them.
void set_circumstances(const GyroSeries& gyro, const AccelerationSeries& acceleration,
                       Signals& signals);

/// What one gyro's effects say it reads, by model::Equation along a motion: deterministic kinds
/// only, before clipping, in deg/s.
class Prediction {
 public:
  /// `effects` of this gyro. The signals must live as long.
  Prediction(std::span<const model::Effect> effects, const Signals& signals);
  /// Ω' of what is stamped `t_s`.
  [[nodiscard]] double late_dps(double t_s) const;
  /// The reading that is stamped `t_s`.
  [[nodiscard]] double at(double t_s) const;

 private:
  model::Equation equation_;
  const Signals& signals_;
  std::vector<SampledCurve> low_passed_;  ///< one after the other
};

}  // namespace vgyro::gap
