#pragma once

// How one gyro comes to read what it reads, said once, in the order of docs/model-file.md:
//   late rate  Ω' = low-passes( Ω(t − Σ delay) )
//   reading    = quantised( dead band( saturated( Ω' + offsets + responses(Ω') )))
//   stamp      = t · (1 + Σ skew)
// The simulator plays it, the gateway takes it back (fusion/compensation.h), the gap workflow asks
// what it foretells. Here stands what is the same each time: noise, spikes, stuck values, jitter
// and lost frames are drawn by the simulator. Rates in deg/s, times in seconds since the first
// frame of the recording.

#include <array>
#include <complex>
#include <concepts>
#include <span>
#include <utility>
#include <vector>

#include "model/effect.h"

namespace vgyro::model {

/// True of lags and clock_skew: with them the reading is of another instant than its stamp.
bool moves_in_time(Kind kind);

/// Ω'' / w² + 2·damping·Ω' / w + Ω = input, w = 2π·cutoff.
struct SecondOrder {
  double cutoff_hz = 0.0;
  double damping = 0.0;

  /// Of the two first-order low-passes, real or not, that it is when they are one behind the other:
  /// y' = pole·(u − y).
  [[nodiscard]] std::array<std::complex<double>, 2> poles() const;
};

class Equation {
 public:
  /// A gyro that reads the rate.
  Equation() = default;
  /// `effects` of one gyro, of any kind; those outside the equation are ignored. Of one
  /// kind they act in the order given.
  explicit Equation(std::span<const Effect> effects);

  // When.

  /// 1 + Σ skew: seconds of the stamps in one second of the truth.
  [[nodiscard]] double clock_rate() const { return clock_rate_; }
  [[nodiscard]] double stamp_s(double true_s) const { return true_s * clock_rate_; }
  [[nodiscard]] double true_time_s(double stamp_s) const { return stamp_s / clock_rate_; }
  /// Σ delay, without the low-passes.
  [[nodiscard]] double delay_s() const { return delay_s_; }
  /// Whose rate the low-passes are given at this true time.
  [[nodiscard]] double felt_at_s(double true_s) const { return true_s - delay_s_; }
  /// Of the low-passes of first order, one behind the other, in Hz.
  [[nodiscard]] std::span<const double> cutoffs_hz() const { return cutoffs_hz_; }
  /// Behind those, of second order.
  [[nodiscard]] std::span<const SecondOrder> second_orders() const { return second_orders_; }
  /// How much later than the rate the reading comes, for rates that change slowly: Σ delay and the
  /// low-passes' group delays.
  [[nodiscard]] double lag_s() const { return lag_s_; }
  /// Whether anything moves it in time.
  [[nodiscard]] bool is_late() const { return is_late_; }

  /// Ω' at this true time. `low_passed(t_s)` is the rate behind all low-passes;
  /// the caller computes it from the rate over time.
  template <std::invocable<double> LowPassed>
  [[nodiscard]] double late_rate_dps(LowPassed&& low_passed, double true_s) const {
    return std::forward<LowPassed>(low_passed)(felt_at_s(true_s));
  }

  // What. Surroundings are those of the true instant, which no delay moves. An effect whose input
  // is not known adds nothing.

  /// Offsets or responses are there.
  [[nodiscard]] bool adds() const { return !added_.empty(); }
  [[nodiscard]] bool responds() const { return !responses_.empty(); }
  /// Ω' + offsets + responses(Ω'), before any noise and clip.
  [[nodiscard]] double reading_dps(double late_dps, const Surroundings& surroundings) const;
  /// Offsets + responses(Ω').
  [[nodiscard]] double added_dps(double late_dps, const Surroundings& surroundings) const;
  [[nodiscard]] double offset_dps(const Surroundings& surroundings) const;
  /// What a clip makes of the finished reading.
  [[nodiscard]] double clipped_dps(double reading_dps) const;

  // Back.

  /// A reading less its offsets: Ω' + responses(Ω').
  [[nodiscard]] double without_offsets_dps(double reading_dps,
                                           const Surroundings& surroundings) const;
  /// By how much Ω' + responses(Ω') exceeds `wanted_dps`, a reading without offsets.
  [[nodiscard]] double excess_dps(double late_dps, double wanted_dps,
                                  const Surroundings& surroundings) const;
  /// d reading / d Ω'.
  [[nodiscard]] double slope(double late_dps, const Surroundings& surroundings) const;

 private:
  void take(const Effect& effect);

  std::vector<Effect> added_;  ///< offsets and responses as they were given: sums keep their digits
  std::vector<Effect> offsets_;
  std::vector<Effect> responses_;
  std::vector<Effect> clips_;
  std::vector<double> cutoffs_hz_;
  std::vector<SecondOrder> second_orders_;
  double delay_s_ = 0.0;
  double lag_s_ = 0.0;
  double clock_rate_ = 1.0;
  bool is_late_ = false;
};

}  // namespace vgyro::model
