#pragma once

// A sampled quantity between its samples. Where they are even: a windowed sinc over the nearest 32,
// exact for slow motion, which meets a sine of up to two fifths of the sampling rate to 1e-3 of its
// amplitude. Where they are not, polynomials through the nearest six: 3e-4 at a tenth of the rate.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace vgyro::gap {

class SampledCurve {
 public:
  static constexpr std::size_t kPoints = 6;  ///< of a polynomial
  static constexpr std::size_t kReach = 16;  ///< samples on either side that the sinc weighs
  static constexpr std::size_t kPointsMax = 2 * kReach;
  SampledCurve() = default;
  /// Times that do not increase are passed over. Memory: a copy.
  SampledCurve(std::span<const double> t_s, std::span<const double> value);

  /// Another quantity at the same times, which both share.
  [[nodiscard]] SampledCurve with_values(std::vector<double> value) const;

  [[nodiscard]] bool empty() const { return value_.size() < 2; }
  [[nodiscard]] double from_s() const { return times_->t_s.front(); }
  [[nodiscard]] double to_s() const { return times_->t_s.back(); }
  [[nodiscard]] double interval_s() const { return times_->interval_s; }
  [[nodiscard]] std::span<const double> times_s() const { return times_->t_s; }
  [[nodiscard]] std::span<const double> values() const { return value_; }

  /// Of the sample at or before an instant between the first and the last one; beyond the ends of
  /// the outermost two.
  [[nodiscard]] std::size_t index_before(double t_s) const;

  struct Point {
    double value = 0.0;
    double slope = 0.0;  ///< per second
  };
  /// What the samples from `first` on count in the value at an instant.
  struct Weights {
    std::size_t first = 0;
    std::array<double, kPointsMax> value{};
    std::size_t count = 0;
  };
  [[nodiscard]] Weights weights_at(double t_s) const;
  /// Beyond the ends the outermost value, slope 0.
  [[nodiscard]] Point at(double t_s) const;
  /// Its value, in a third of the time.
  [[nodiscard]] double value_at(double t_s) const;
  /// At the quarters of each interval, kQuarters values for each, and at the last sample.
  static constexpr std::size_t kQuarters = 4;
  [[nodiscard]] std::vector<double> quarters() const;
  /// The same by the nearest six samples alone: for what may hold spikes, which a sinc spreads.
  [[nodiscard]] Point nearby(double t_s) const;
  /// Straight between neighbours: for what steps.
  [[nodiscard]] double linear(double t_s) const;
  /// No sample within `reach_s` on both sides.
  [[nodiscard]] bool hole_at(double t_s, double reach_s) const;

 private:
  [[nodiscard]] std::size_t first_about(double t_s) const;
  [[nodiscard]] Point polynomial_at(double t_s) const;
  /// The samples about the interval behind `before` are evenly spaced.
  [[nodiscard]] bool is_even_about(std::size_t before) const;

  struct Times {
    std::vector<double> t_s;
    std::vector<std::uint8_t> even_steps;  ///< that led up to each sample, as far as it matters
    double interval_s = 0.0;               ///< median
    std::vector<std::uint32_t> places;     ///< of each interval from the first sample on: a sample
    /// Sets the others from the times. Precondition: two or more.
    void measure_steps();
    void set_places();
  };
  static const std::shared_ptr<const Times>& no_times();

  std::shared_ptr<const Times> times_ = no_times();
  std::vector<double> value_;
};

}  // namespace vgyro::gap
