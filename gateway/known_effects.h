#pragma once

// Corrects the readings of both gyros for the effects in the model file; and says which inputs
// they need. Without a model file every reading stays unchanged.

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

  /// A bit mask of model::Need: what the effects of this gyro depend on.
  [[nodiscard]] std::uint8_t needs(std::size_t gyro) const { return needs_[gyro]; }
  [[nodiscard]] bool take_any(std::size_t gyro) const { return compensations_[gyro].takes_any(); }

  /// The reading at `t` less what is known of it, deg/s.
  [[nodiscard]] double take_off(std::size_t gyro, double reading_dps,
                                const Surroundings& surroundings, TimePoint t) const {
    // Most have no model, and ask for no surroundings.
    return take_any(gyro) ? take_off_any(gyro, reading_dps, surroundings, t) : reading_dps;
  }
  /// Whether the model file says how far it may be wrong.
  [[nodiscard]] bool is_doubted() const { return doubts_[0].any() || doubts_[1].any(); }
  /// The biases were learned, at rest, with what is taken off at `t`.
  [[gnu::cold, gnu::noinline]] void settle(const Surroundings& surroundings, TimePoint t);
  /// 1σ of what that does to a rate of which each gyro has such a share, deg/s.
  [[nodiscard]] [[gnu::cold, gnu::noinline]] double doubt_dps(double rate_dps,
                                                              const std::array<double, 2>& shares,
                                                              const Surroundings& surroundings,
                                                              TimePoint t) const;

  /// What of it is the gyro's zero offset at `t`, deg/s.
  [[nodiscard]] double zero_offset_dps(std::size_t gyro, const Surroundings& surroundings,
                                       TimePoint t) const;

  /// A sample stamped t is of the rate at t − lag.
  [[nodiscard]] Duration lag(std::size_t gyro) const { return compensations_[gyro].lag(); }
  /// What the bus has reached when a rate dated back comes out.
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
