#pragma once

// What a gyro's error may depend on, at any instant of a recording: the true rate with its slope
// and angle, the gyro's temperature and supply voltage, acceleration, vibration. And from that,
// what a gyro should read.

#include <array>
#include <memory>
#include <span>
#include <utility>
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
  explicit Motion(SampledCurve rate_dps) : rate_dps_(std::move(rate_dps)) {}

  [[nodiscard]] SampledCurve::Point rate(double t_s) const { return rate_dps_.at(t_s); }
  [[nodiscard]] double angle_rad(double t_s) const;
  /// What a first-order low-pass makes of it, and one of second order. The last answers are kept:
  /// what the model knows is asked for again and again.
  [[nodiscard]] std::shared_ptr<const Motion> low_passed(double cutoff_hz) const;
  [[nodiscard]] std::shared_ptr<const Motion> low_passed(const model::SecondOrder& second) const;
  [[nodiscard]] const SampledCurve& curve() const { return rate_dps_; }

 private:
  using Values = std::shared_ptr<const std::vector<double>>;
  [[nodiscard]] const std::vector<double>& quarters() const;
  [[nodiscard]] const std::vector<double>& angle_deg() const;

  SampledCurve rate_dps_;
  // Made when they are first asked for; copies share them.
  mutable Values quarters_;   ///< at the quarters of each interval
  mutable Values angle_deg_;  ///< at the curve's samples, from time 0
  struct Filtered {
    double cutoff_hz = 0.0;
    double damping = 0.0;  ///< 0: of first order
    std::shared_ptr<const Motion> motion;
  };
  template <class Filter>
  std::shared_ptr<const Motion> remembered(double cutoff_hz, double damping,
                                           const Filter& filter) const;
  mutable std::vector<Filtered> filtered_;
};

struct Signals {
  Motion motion;  ///< as this gyro is judged against
  /// As the other gyro alone tells it; empty where the motion is known otherwise.
  Motion motion_by_other;
  /// What the other gyro alone reads, with its noise, at any instant; empty where the motion is
  /// known otherwise. What a comparison of both readings gains by lateness is reckoned by it: a
  /// part of the noise that is late beside a part that is not is less noise than either, and any
  /// lateness would seem to take some off. A low-pass is not: it would take the other's noise off.
  SampledCurve other_reading_dps;
  /// By which what the equation says of lateness is reckoned.
  [[nodiscard]] const Motion& on_time(const model::Equation& equation) const {
    const bool passes_low = !equation.cutoffs_hz().empty() || !equation.second_orders().empty();
    return passes_low || motion_by_other.curve().empty() ? motion : motion_by_other;
  }
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
  /// By which lateness is reckoned.
  [[nodiscard]] const Motion& on_time() const { return signals_.on_time(equation_); }
  /// Ω' of what is stamped `t_s`.
  [[nodiscard]] double late_dps(double t_s) const;
  /// The same along another curve; no low-pass.
  [[nodiscard]] double late_dps(double t_s, const SampledCurve& felt_dps) const;
  [[nodiscard]] bool passes_low() const { return low_passed_ != nullptr; }
  /// The reading that is stamped `t_s`.
  [[nodiscard]] double at(double t_s) const;

 private:
  model::Equation equation_;
  const Signals& signals_;
  std::shared_ptr<const Motion> low_passed_;  ///< behind all low-passes; none: the motion itself
};

}  // namespace vgyro::gap
