#pragma once

// The quantities besides the rate that the gyros' errors depend on, from the frames that carry
// them: temperatures, supply voltages, acceleration, the angle turned so far, and time since the
// first frame. Also the wheels' state. Values that were never received are unknown. When
// acceleration, temperature or voltage falls silent, the last value is held, because gravity, heat
// and supply go on; speed is not held.

#include <array>
#include <optional>
#include <utility>

#include "base/time.h"
#include "can/frame.h"
#include "fusion/corrector.h"
#include "fusion/moving_variance.h"
#include "fusion/stamp_guard.h"
#include "fusion/temperature_filter.h"
#include "gateway/gyro_input.h"
#include "gateway/intake.h"
#include "gateway/plan.h"
#include "model/catalogue.h"
#include "model/effect.h"
#include "model/temperature_past.h"

namespace vgyro::gateway {

class Surroundings {
 public:
  /// A speed older than this is unknown.
  static constexpr Duration kSpeedStale = std::chrono::seconds(1);
  static constexpr double kStandingBelow_m_s = 0.05;
  /// After the last known rate the angle is extrapolated for no longer than this.
  static constexpr Duration kAngleAhead = std::chrono::seconds(1);
  /// A longer leap of time means that a clock was set, not that a gyro went on warming up.
  static constexpr Duration kLeap = std::chrono::hours(24);

  explicit Surroundings(const Plan& plan);

  /// The first frame that has a role: zero of the model's time.
  void begin(TimePoint t) {
    if (!begun_) set_zero(t);
  }
  /// Moves time on to that of an accepted sample.
  void reach(TimePoint t) {
    const bool goes_on = begun_ && t >= zero_ && t >= newest_ && span(newest_, t) <= kLeap;
    if (!goes_on) return leap(t);
    newest_ = t;
  }

  /// Takes the gyro's own temperature, voltage and other axes, as far as `needs` (model::Need) has
  /// them.
  void hear_gyro(std::size_t gyro, TimePoint t, const GyroInput& input, std::uint8_t needs);
  /// Ignores NaN.
  void add_temperature(std::size_t gyro, TimePoint t, double temperature_c);
  void add_supply(std::size_t gyro, double supply_v);
  /// Rates about x, y and z in the same frame as the gyro's rate; NaN is none, and replaces the
  /// last one.
  void set_other_rates(std::size_t gyro, const std::array<double, 3>& rate_dps) {
    other_rate_dps_[gyro] = rate_dps;
  }
  /// False when the frame cannot be used.
  bool receive_acceleration(const can::Frame& frame, TimePoint raw, fusion::StampGuard& guard);
  bool receive_speed(const can::Frame& frame, TimePoint raw, fusion::StampGuard& guard);
  /// The true rate as far as it is known; times may be out of order. A leap ahead of the gyros is
  /// ignored, since only they move time.
  void add_rate(TimePoint t, double rate_dps);

  [[nodiscard]] model::Surroundings at(std::size_t gyro, TimePoint t) const;
  [[nodiscard]] fusion::Wheels wheels(TimePoint t) const;
  /// NaN if unknown.
  [[nodiscard]] double temperature_c(std::size_t gyro) const {
    return temperatures_[gyro].temperature_c();
  }
  /// Variance of the specific force's magnitude; NaN without an accelerometer.
  [[nodiscard]] double vibration_g2() const;
  /// The inputs in `needs` (model::Need) that were never received.
  [[nodiscard]] std::uint8_t missing(std::size_t gyro, std::uint8_t needs) const;

 private:
  struct Source;
  static const std::array<Source, model::kNeedCount> kSources;

  template <std::size_t... places>
  void hear_from(std::index_sequence<places...> all, std::size_t gyro, TimePoint t,
                 const GyroInput& input, std::uint8_t needs);
  void set_zero(TimePoint t);
  [[gnu::cold, gnu::noinline]] void leap(TimePoint t);

  bool begun_ = false;
  TimePoint zero_;
  TimePoint newest_;
  std::array<fusion::TemperatureFilter, 2> temperatures_;
  std::array<model::TemperaturePast, 2> temperature_pasts_;
  std::array<double, 2> supply_v_;
  std::array<std::array<double, 3>, 2> other_rate_dps_;
  std::array<double, 3> acceleration_g_;
  fusion::MovingVariance vibration_;
  TimePoint angle_at_;
  double angle_rad_ = 0.0;
  double rate_dps_;
  std::optional<AxesIntake> accelerometer_;
  std::optional<ScalarIntake> speed_;
  std::optional<TimePoint> speed_at_;
  double speed_m_s_ = 0.0;
};

}  // namespace vgyro::gateway
