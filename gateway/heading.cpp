#include "gateway/heading.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/angle.h"
#include "gateway/axes_plan.h"

namespace vgyro::gateway {

namespace {

// Rates further apart than this do not show how the vehicle turned in between.
constexpr double kLeap_s = 1.0;
// 1σ of the unobserved turn rate of a vehicle: a slow bend of a road.
constexpr double kUnseenTurn_dps = 10.0;
// Relative 1σ of the angle turned: gyros of one type may share a scale factor error.
constexpr double kScaleDoubt = 0.003;

}  // namespace

Heading::Heading(const CalibrationPlan& calibration) {
  if (!calibration.heading_deg || !calibration.latitude_deg) return;
  north_dps_ = kEarthRate_dps * std::cos(*calibration.latitude_deg * kRadPerDeg);
  heading_rad_ = *calibration.heading_deg * kRadPerDeg;
}

void Heading::follow(TimePoint t, const std::optional<Turn>& turn, bool rests) {
  if (!north_dps_) return;
  if (!begun_) at_ = t;
  begun_ = true;
  const double since_s = to_seconds(t - at_);
  if (since_s <= 0.0) return;
  at_ = t;
  if (rests) return;
  if (!turn || since_s > kLeap_s) {
    age(since_s);
    return;
  }
  // Compasses count clockwise, gyros the other way.
  const double angle_rad = turn->rate_dps * kRadPerDeg * since_s;
  heading_rad_ = std::remainder(heading_rad_ - angle_rad, 2.0 * std::numbers::pi);
  turned_rad_ += angle_rad;
  drift_rad_ += turn->bias_sigma_dps * kRadPerDeg * since_s;
  const double white_rad = turn->sigma_dps * kRadPerDeg * since_s;
  white_rad2_ += white_rad * white_rad;
}

double Heading::sigma_rad() const {
  const double scale_rad = kScaleDoubt * turned_rad_;
  const double sigma = std::sqrt(drift_rad_ * drift_rad_ + white_rad2_ + scale_rad * scale_rad);
  return std::min(sigma, kSigmaMost_rad);
}

// Means over a normally distributed heading: E cos(m·ψ) = cos(m·ψ₀)·exp(−m²σ²/2).
double Heading::part(std::size_t axis, double multiple) const {
  const double sigma = sigma_rad();
  const double angle = multiple * heading_rad_;
  return (axis == 0 ? std::cos(angle) : std::sin(angle)) *
         std::exp(-0.5 * multiple * multiple * sigma * sigma);
}

double Heading::earth_rate_dps(std::size_t axis) const {
  return *north_dps_ * part(axis, 1.0);
}

// cos² = ½ + ½ cos 2ψ, sin² = ½ − ½ cos 2ψ.
double Heading::earth_doubt_dps(std::size_t axis) const {
  const double mean = part(axis, 1.0);
  const double square = 0.5 + (axis == 0 ? 0.5 : -0.5) * part(0, 2.0);
  return *north_dps_ * std::sqrt(std::max(square - mean * mean, 0.0));
}

std::optional<HeadingMemory> Heading::memory() const {
  if (!north_dps_) return std::nullopt;
  return HeadingMemory{.heading_rad = heading_rad_, .sigma_rad = sigma_rad()};
}

void Heading::resume(const std::optional<HeadingMemory>& memory) {
  if (!north_dps_) return;
  if (memory) heading_rad_ = memory->heading_rad;
  drift_rad_ = memory ? memory->sigma_rad : kSigmaMost_rad;
  white_rad2_ = 0.0;
  turned_rad_ = 0.0;
}

void Heading::age(double seconds) {
  drift_rad_ = std::min(drift_rad_ + kUnseenTurn_dps * kRadPerDeg * seconds, kSigmaMost_rad);
}

}  // namespace vgyro::gateway
