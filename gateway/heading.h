#pragma once

// The direction of the vehicle's x axis, and from it the Earth's rate about x and y. The heading is
// the configured one during calibration; from then on the virtual rate about z is integrated. Its σ
// grows with that rate's σ, with the angle turned, and with every second without a known rate.
// Reads no clock, allocates nothing.

#include <cstddef>
#include <optional>

#include "base/time.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// What is kept of the heading across a restart.
struct HeadingMemory {
  double heading_rad = 0.0;  ///< clockwise from north
  double sigma_rad = 0.0;
};

class Heading {
 public:
  /// Beyond this σ the heading is unknown: even a uniform distribution has a smaller one.
  static constexpr double kSigmaMost_rad = 4.0;

  /// Without a configured heading and latitude is_told() stays false.
  explicit Heading(const CalibrationPlan& calibration);

  /// The rate about z at `t`, with its σ and the σ of its bias; nothing if there is no valid rate.
  /// `rests`: the platform calibrates, so it does not turn.
  struct Turn {
    double rate_dps = 0.0;
    double sigma_dps = 0.0;
    double bias_sigma_dps = 0.0;
  };
  void follow(TimePoint t, const std::optional<Turn>& turn, bool rests);

  [[nodiscard]] bool is_told() const { return north_dps_.has_value(); }
  /// The horizontal component of the Earth's rate. Precondition: is_told().
  [[nodiscard]] double north_dps() const { return *north_dps_; }
  /// The expected Earth's rate about x (0) or y (1), and 1σ of its error.
  /// Precondition: is_told().
  [[nodiscard]] double earth_rate_dps(std::size_t axis) const;
  [[nodiscard]] double earth_doubt_dps(std::size_t axis) const;

  [[nodiscard]] std::optional<HeadingMemory> memory() const;
  /// Without a memory the heading becomes unknown.
  void resume(const std::optional<HeadingMemory>& memory);
  /// Adds the uncertainty of this many seconds without a known rate.
  void age(double seconds);

 private:
  [[nodiscard]] double sigma_rad() const;
  /// The expected value of cos (x) or sin (y) of `multiple` times the heading.
  [[nodiscard]] double part(std::size_t axis, double multiple) const;

  std::optional<double> north_dps_;
  double heading_rad_ = 0.0;
  double turned_rad_ = 0.0;  ///< since the heading was last known
  double drift_rad_ = 0.0;   ///< 1σ of the part that grows with time
  double white_rad2_ = 0.0;  ///< variance of the part that averages out
  TimePoint at_;
  bool begun_ = false;
};

}  // namespace vgyro::gateway
