#pragma once

// Where the vehicle's x axis points, and with it how much of the Earth's rate stands about x and y:
// as configured while the platform calibrates, from then on by the virtual rate about z. Its σ
// grows with that rate's σ, with the angle turned, and with every second without a known
// rate. Reads no clock, allocates nothing.

#include <cstddef>
#include <optional>

#include "base/time.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// What is kept of it across a restart.
struct HeadingMemory {
  double heading_rad = 0.0;  ///< clockwise from north
  double sigma_rad = 0.0;
};

class Heading {
 public:
  /// Beyond this nothing is known of it: a uniform distribution has less.
  static constexpr double kSigmaMost_rad = 4.0;

  /// Configured, or not: then there is no heading.
  explicit Heading(const CalibrationPlan& calibration);

  /// The rate about z at `t`, with its σ and the σ of its bias; nothing where it is not valid, or
  /// there is none. `rests`: the platform calibrates, so it does not turn.
  struct Turn {
    double rate_dps = 0.0;
    double sigma_dps = 0.0;
    double bias_sigma_dps = 0.0;
  };
  void follow(TimePoint t, const std::optional<Turn>& turn, bool rests);

  [[nodiscard]] bool is_told() const { return north_dps_.has_value(); }
  /// The horizontal component of the Earth's rate. Precondition: is_told().
  [[nodiscard]] double north_dps() const { return *north_dps_; }
  /// About x (0) or y (1): what is expected of the Earth's rate, and 1σ of what it may be instead.
  /// Precondition: is_told().
  [[nodiscard]] double earth_rate_dps(std::size_t axis) const;
  [[nodiscard]] double earth_doubt_dps(std::size_t axis) const;

  [[nodiscard]] std::optional<HeadingMemory> memory() const;
  /// Nothing: where it points is not known any more.
  void resume(const std::optional<HeadingMemory>& memory);
  /// Nobody looked for so long.
  void age(double seconds);

 private:
  [[nodiscard]] double sigma_rad() const;
  /// cos and sin of the heading about x and y.
  [[nodiscard]] double part(std::size_t axis, double multiple) const;

  std::optional<double> north_dps_;
  double heading_rad_ = 0.0;
  double turned_rad_ = 0.0;  ///< since it was known
  double drift_rad_ = 0.0;   ///< 1σ of what grows with time
  double white_rad2_ = 0.0;  ///< variance of what averages out
  TimePoint at_;
  bool begun_ = false;
};

}  // namespace vgyro::gateway
