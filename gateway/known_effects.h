#pragma once

// Corrects the readings of both gyros for the effects in the model file, and reports which inputs
// these need. Without a model file every reading stays unchanged.

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/time.h"
#include "fusion/compensation.h"
#include "fusion/compensation_doubt.h"
#include "gateway/plan.h"
#include "gateway/surroundings.h"

namespace vgyro::gateway {

class KnownEffects {
 public:
  explicit KnownEffects(const Plan& plan);

  /// Bit mask of model::Need: the inputs that the effects of this gyro depend on.
  [[nodiscard]] std::uint8_t needs(std::size_t gyro) const { return needs_[gyro]; }
  [[nodiscard]] bool take_any(std::size_t gyro) const { return compensations_[gyro].takes_any(); }

  /// The reading at `t` less the known effects, deg/s.
  [[nodiscard]] double take_off(std::size_t gyro, double reading_dps,
                                const Surroundings& surroundings, TimePoint t) const {
    // Most configurations have no model and need no surroundings.
    return take_any(gyro) ? take_off_any(gyro, reading_dps, surroundings, t) : reading_dps;
  }
  /// Whether the model file states a σ for any of its effects.
  [[nodiscard]] bool is_doubted() const { return doubts_[0].any() || doubts_[1].any(); }
  /// Marks `t` as a time at which biases were learned at rest: they absorbed the error in the
  /// effects.
  [[gnu::cold, gnu::noinline]] void settle(const Surroundings& surroundings, TimePoint t);
  /// 1σ in deg/s of a rate, composed with these shares of the gyros, due to the doubt in the
  /// effects.
  [[nodiscard]] [[gnu::cold, gnu::noinline]] double doubt_dps(double rate_dps,
                                                              const std::array<double, 2>& shares,
                                                              const Surroundings& surroundings,
                                                              TimePoint t) const;

  /// The part of the known effects that is the gyro's zero offset at `t`, deg/s.
  [[nodiscard]] double zero_offset_dps(std::size_t gyro, const Surroundings& surroundings,
                                       TimePoint t) const;

  /// A sample with stamp t belongs to the rate at t − lag.
  [[nodiscard]] Duration lag(std::size_t gyro) const { return compensations_[gyro].lag(); }
  /// The larger lag of both gyros: by how much the bus is ahead of a rate that was dated back.
  [[nodiscard]] Duration lag_most() const { return lag_most_; }

 private:
  [[nodiscard]] [[gnu::noinline]] double take_off_any(std::size_t gyro, double reading_dps,
                                                      const Surroundings& surroundings,
                                                      TimePoint t) const;

  std::array<fusion::Compensation, 2> compensations_;
  std::array<fusion::CompensationDoubt, 2> doubts_;
  std::array<std::uint8_t, 2> needs_{};
  Duration lag_most_{0};
};

}  // namespace vgyro::gateway
