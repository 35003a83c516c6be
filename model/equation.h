#pragma once

// How a gyro's reading follows from the true rate, defined once, in the order of
// docs/model-file.md:
//   late rate  Ω' = low-passes( Ω(t − Σ delay) )
//   reading    = quantised( dead band( saturated( Ω' + offsets + responses(Ω') )))
//   stamp      = t · (1 + Σ skew)
// The simulator applies it, the gateway inverts it (fusion/compensation.h), the gap workflow
// predicts readings with it. It covers what is deterministic; the simulator draws noise, spikes,
// stuck values, jitter and lost frames. Rates in deg/s, times in seconds since the first frame of
// the recording.

#include <array>
#include <complex>
#include <concepts>
#include <span>
#include <utility>
#include <vector>

#include "model/effect.h"

namespace vgyro::model {

/// True for lags and clock_skew: with them the reading belongs to another instant than its stamp.
bool moves_in_time(Kind kind);

/// Ω'' / w² + 2·damping·Ω' / w + Ω = input, w = 2π·cutoff.
struct SecondOrder {
  double cutoff_hz = 0.0;
  double damping = 0.0;

  /// The two first-order low-passes in series, real or complex, that it is equal to:
  /// y' = pole·(u − y).
  [[nodiscard]] std::array<std::complex<double>, 2> poles() const;
};

class Equation {
 public:
  /// A gyro that reads the true rate.
  Equation() = default;
  /// `effects` belong to one gyro and may be of any kind; those outside the equation are ignored.
  /// Effects of one kind act in the given order.
  explicit Equation(std::span<const Effect> effects);

  // --- time

  /// 1 + Σ skew: seconds of the stamps in one second of the truth.
  [[nodiscard]] double clock_rate() const { return clock_rate_; }
  [[nodiscard]] double stamp_s(double true_s) const { return true_s * clock_rate_; }
  [[nodiscard]] double true_time_s(double stamp_s) const { return stamp_s / clock_rate_; }
  /// Σ delay, without the low-passes' lag.
  [[nodiscard]] double delay_s() const { return delay_s_; }
  /// The true time of the rate that enters the low-passes at this true time.
  [[nodiscard]] double felt_at_s(double true_s) const { return true_s - delay_s_; }
  /// Cut-offs of the first-order low-passes in series, Hz.
  [[nodiscard]] std::span<const double> cutoffs_hz() const { return cutoffs_hz_; }
  /// Second-order low-passes, which follow those.
  [[nodiscard]] std::span<const SecondOrder> second_orders() const { return second_orders_; }
  /// How much later than the rate the reading is, for rates that change slowly: Σ delay and the
  /// group delays of the low-passes.
  [[nodiscard]] double lag_s() const { return lag_s_; }
  /// Whether any effect moves the reading in time.
  [[nodiscard]] bool is_late() const { return is_late_; }

  /// Ω' at this true time. `low_passed(t_s)` is the rate after all low-passes, which the caller
  /// computes from the rate over time.
  template <std::invocable<double> LowPassed>
  [[nodiscard]] double late_rate_dps(LowPassed&& low_passed, double true_s) const {
    return std::forward<LowPassed>(low_passed)(felt_at_s(true_s));
  }

  // --- value. Surroundings are those of the true instant, independent of delays. An effect whose
  // input is unknown adds nothing.

  /// Are there offsets or responses?
  [[nodiscard]] bool adds() const { return !added_.empty(); }
  [[nodiscard]] bool responds() const { return !responses_.empty(); }
  /// Ω' + offsets + responses(Ω'), before any noise and clip.
  [[nodiscard]] double reading_dps(double late_dps, const Surroundings& surroundings) const;
  /// Offsets + responses(Ω').
  [[nodiscard]] double added_dps(double late_dps, const Surroundings& surroundings) const;
  [[nodiscard]] double offset_dps(const Surroundings& surroundings) const;
  /// The finished reading after all clips.
  [[nodiscard]] double clipped_dps(double reading_dps) const;

  // --- inverse

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

  std::vector<Effect> added_;  ///< offsets and responses in the given order, which keeps sums bit
                               ///< for bit
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
