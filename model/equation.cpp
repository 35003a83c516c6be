#include "model/equation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/catalogue.h"

namespace vgyro::model {

namespace {

constexpr double kPerPpm = 1e-6;

// Adds one by one: another order of summing would change the last digits, and the same model must
// give the same bytes.
double plus_each_dps(double sum_dps, std::span<const Effect> effects, double late_dps,
                     const Surroundings& surroundings) {
  for (const Effect& effect : effects)
    sum_dps += added_dps(effect, late_dps, surroundings);
  return sum_dps;
}

}  // namespace

std::array<std::complex<double>, 2> SecondOrder::poles() const {
  // Equal poles are moved apart, because callers divide by their difference.
  constexpr double kApart = 1e-3;
  std::complex<double> root = std::sqrt(std::complex<double>(damping * damping - 1.0, 0.0));
  if (std::abs(root) < kApart) root = kApart;
  const double w = 2.0 * std::numbers::pi * cutoff_hz;
  // The smaller pole follows from the product of both: a difference would lose digits.
  const std::complex<double> larger = w * (damping + root);
  return {w * w / larger, larger};
}

bool moves_in_time(Kind kind) {
  return info(kind).nature == Nature::kLag || kind == Kind::kClockSkew;
}

Equation::Equation(std::span<const Effect> effects) {
  for (const Effect& effect : effects)
    take(effect);
  // The order of Kind: saturation, dead band, quantisation.
  std::stable_sort(clips_.begin(), clips_.end(),
                   [](const Effect& a, const Effect& b) { return a.kind < b.kind; });
}

void Equation::take(const Effect& effect) {
  is_late_ = is_late_ || moves_in_time(effect.kind);
  switch (info(effect.kind).nature) {
    case Nature::kOffset:
      added_.push_back(effect);
      offsets_.push_back(effect);
      break;
    case Nature::kResponse:
      added_.push_back(effect);
      responses_.push_back(effect);
      break;
    case Nature::kLag:
      lag_s_ += model::lag_s(effect);
      if (effect.kind == Kind::kDelay) delay_s_ += effect.parameters[0];
      if (effect.kind == Kind::kBandwidth) cutoffs_hz_.push_back(effect.parameters[0]);
      if (effect.kind == Kind::kBandwidthSecondOrder)
        second_orders_.push_back({effect.parameters[0], effect.parameters[1]});
      break;
    case Nature::kClip:
      clips_.push_back(effect);
      break;
    case Nature::kDisturbance:
      if (effect.kind == Kind::kClockSkew) clock_rate_ += effect.parameters[0] * kPerPpm;
      break;
    case Nature::kNoise:
      break;
  }
}

double Equation::reading_dps(double late_dps, const Surroundings& surroundings) const {
  return plus_each_dps(late_dps, added_, late_dps, surroundings);
}

double Equation::added_dps(double late_dps, const Surroundings& surroundings) const {
  return plus_each_dps(0.0, added_, late_dps, surroundings);
}

double Equation::offset_dps(const Surroundings& surroundings) const {
  return plus_each_dps(0.0, offsets_, 0.0, surroundings);
}

double Equation::clipped_dps(double reading_dps) const {
  for (const Effect& effect : clips_)
    reading_dps = model::clipped_dps(effect, reading_dps);
  return reading_dps;
}

double Equation::without_offsets_dps(double reading_dps, const Surroundings& surroundings) const {
  for (const Effect& effect : offsets_)
    reading_dps -= model::added_dps(effect, 0.0, surroundings);
  return reading_dps;
}

double Equation::excess_dps(double late_dps, double wanted_dps,
                            const Surroundings& surroundings) const {
  return plus_each_dps(late_dps - wanted_dps, responses_, late_dps, surroundings);
}

double Equation::slope(double late_dps, const Surroundings& surroundings) const {
  double slope = 1.0;
  for (const Effect& effect : responses_)
    slope += model::slope(effect, late_dps, surroundings);
  return slope;
}

}  // namespace vgyro::model
