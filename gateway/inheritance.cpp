#include "gateway/inheritance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "fusion/corrector.h"
#include "gateway/estimator.h"

namespace vgyro::gateway {
namespace {

/// The old biases with σ grown by the time since; nothing if the memory cannot be right.
std::optional<fusion::DriftMemory> aged(const SavedState& before, const SavedState& now,
                                        const Plan& plan) {
  const bool age_is_known = now.rate_stamp >= before.rate_stamp;
  const double age_s =
      age_is_known ? to_seconds(now.rate_stamp - before.rate_stamp) : Estimator::kUnknownAge_s;
  const auto corrector =
      fusion::make_optimal_corrector({.window_s = plan.corrector.window_s,
                                      .stop_rate_dps = plan.calibration.stop_rate_dps,
                                      .gyros = plan.corrector.gyros});
  if (!corrector->resume(before.drift, age_s, 0.0)) return std::nullopt;
  return corrector->memory(0.0);
}

/// `shift_dps`: difference to expect between new and old biases if the old ones were right.
bool agree(const fusion::DriftMemory& before, const fusion::DriftMemory& now, double shift_dps) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::size_t own = 2 * gyro;  // index in the covariance
    const double sigma_dps = std::sqrt(before.bias_covariance[own] + now.bias_covariance[own]);
    const double apart_dps = now.bias_dps[gyro] - before.bias_dps[gyro] - shift_dps;
    if (std::abs(apart_dps) > Inheritance::kSigmasMost * sigma_dps) return false;
  }
  return true;
}

bool contradict(const SavedState& before, const SavedState& now, const Plan& plan);

// A contradiction about one axis is one of the platform, which turned.
bool axes_contradict(const SavedState& before, const SavedState& now, const Plan& plan) {
  for (const Plan& pair : plan.axes) {
    const auto of_axis = [&](const SavedState& state) { return state.axis == pair.axis; };
    const auto old = std::find_if(before.axes.begin(), before.axes.end(), of_axis);
    const auto own = std::find_if(now.axes.begin(), now.axes.end(), of_axis);
    if (old == before.axes.end() || own == now.axes.end()) continue;
    if (contradict(*old, *own, pair)) return true;
  }
  return false;
}

bool contradict(const SavedState& before, const SavedState& now, const Plan& plan) {
  if (!plan.axes.empty()) return axes_contradict(before, now, plan);
  if (before.devices != now.devices) return false;  // these biases belong to other gyros
  const std::optional<fusion::DriftMemory> old = aged(before, now, plan);
  if (!old) return false;
  // If the configured rate at rest has changed, the platform is at another place, or a mistake was
  // corrected; in the second case the old biases were wrong by the difference.
  return !agree(*old, now.drift, 0.0) &&
         !agree(*old, now.drift, before.rest_rate_dps - now.rest_rate_dps);
}

}  // namespace

void Inheritance::keep(SavedState before) {
  before_ = std::move(before);
  contradicted_ = false;
}

void Inheritance::forget() {
  before_.reset();
  contradicted_ = false;
}

std::optional<SavedState> Inheritance::choose(const std::optional<SavedState>& now,
                                              const Plan& plan, std::uint64_t stops) {
  if (!before_) return now;
  if (!now) return before_;
  if (stops == 0) {
    contradicted_ = contradicted_ || contradict(*before_, *now, plan);
    if (contradicted_) return before_;
  }
  forget();
  return now;
}

}  // namespace vgyro::gateway
